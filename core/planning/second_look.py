"""A plan looked at again on other points: elements that it would miss there are planned on both sets of points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .cover import ENOUGH, Array


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

    sees: NDArray[np.bool_]
    """(C, P) which of these points each place measures as required."""
    area: Array
    element: NDArray[np.int32]
    target: Array
    """(E,) area that a plan must cover of each element [m2]."""
    aim: Array
    """(E,) area that it is to aim for [m2]."""

    @property
    def reachable(self) -> Array:
        """(E,) area that some place measures [m2]."""
        return self._area(self.sees.any(axis=0))

    def lacking(self, chosen: list[int]) -> NDArray[np.bool_]:
        """(E,) elements of which the chosen places cover less of these points than the target and than can be reached."""
        covered = self._area(self.sees[chosen].any(axis=0))
        return np.asarray(covered < np.minimum(self.target, self.reachable) - ENOUGH)

    def join(self, views: Views, elements: NDArray[np.bool_]) -> Views:
        """The views with the points of these elements as well, of which as much must be covered as can be up to the aim."""
        count = len(self.aim)
        own = elements[self.element]
        need = np.zeros(2 * count)
        need[: len(views.need)] = views.need
        at = np.flatnonzero(elements)
        need[count + at] = np.minimum(self.aim, self.reachable)[at] * (1.0 - 1e-9)
        return Views(
            np.concatenate([views.sees, self.sees[:, own]], axis=1), np.concatenate([views.area, self.area[own]]),
            np.concatenate([views.element, self.element[own] + np.int32(count)]), need,
        )

    def _area(self, seen: NDArray[np.bool_]) -> Array:
        return area_by_element(self.area, self.element, seen, len(self.aim))


def area_by_element(area: Array, element: NDArray[np.int32], seen: NDArray[np.bool_], count: int) -> Array:
    """(count,) area of the points seen, by element [m2]."""
    return np.bincount(element[seen], weights=area[seen], minlength=count).astype(np.float64)
