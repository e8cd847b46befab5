"""A plan looked at again on other points: elements that it would miss there are planned on both sets of points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..progress import Progress
from ..simulation.scanner import Scanner
from ..simulation.scene import Scene
from .targets import Targets
from .visibility import Requirement, measured_well, view_matrix

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Views:
    """What the places (C) measure of the points (P) of a plan; metres, local frame.

    The same element on the second set of points has the number ``count`` + its own.
    """

    sees: NDArray[np.bool_]
    area: Array
    element: NDArray[np.int32]
    need: Array
    """(count,), or (2 count,) once a second set has joined: area that must be covered [m2]."""


@dataclass(frozen=True)
class SecondLook:
    """Another set of points on the elements, and what is asked of them there."""

    scene: Scene
    scanner: Scanner
    requirement: Requirement
    targets: Targets
    already: NDArray[np.bool_]
    """(P,) points that an existing campaign measures as required."""
    positions: Array
    """(C, 3) of all places."""
    known: int
    """So many of the places, the first, are stations of that campaign."""
    target: Array
    """(E,) area that a plan must cover of each element [m2]."""
    aim: Array
    """(E,) area that it is to aim for [m2]."""

    def lacking(self, chosen: list[int]) -> NDArray[np.bool_]:
        """(E,) elements of which the chosen places cover less than the target on these points."""
        seen = self.already.copy()
        for place in chosen:
            if place >= self.known:
                seen |= measured_well(self.scene, self.positions[place], self.targets, self.scanner, self.requirement)[0]
        return np.asarray(self._area(seen) < self.target - 1e-9)

    def join(self, views: Views, elements: NDArray[np.bool_]) -> Views:
        """The views with the points of these elements as well, of which as much must be covered as can be up to the aim."""
        count = len(self.aim)
        rows = np.flatnonzero(elements[self.targets.element])
        own = Targets(*(v[rows] for v in (
            self.targets.row, self.targets.position, self.targets.normal, self.targets.area, self.targets.element
        )))
        sees = view_matrix(self.scene, self.positions[self.known :], own, self.scanner, self.requirement, Progress())
        sees = np.concatenate([np.repeat(self.already[rows][None], self.known, axis=0), sees])
        can = np.zeros(len(self.targets), np.bool_)
        can[rows] = sees.any(axis=0)
        need = np.zeros(2 * count)
        need[: len(views.need)] = views.need
        at = np.flatnonzero(elements)
        need[count + at] = np.minimum(self.aim, self._area(can))[at] * (1.0 - 1e-9)
        return Views(
            np.concatenate([views.sees, sees], axis=1), np.concatenate([views.area, own.area]),
            np.concatenate([views.element, own.element + np.int32(count)]), need,
        )

    def _area(self, seen: NDArray[np.bool_]) -> Array:
        return np.bincount(
            self.targets.element[seen], weights=self.targets.area[seen], minlength=len(self.target)
        ).astype(np.float64)
