"""Did an element leave its planned place, or does what was found nearby only hide that place?

A surface parallel to an element's own, a hand before it, fits a moved element as well as a lining or a ceiling with the element
standing untouched behind. Only beams tell the two apart: those that pass through the planned place, those that still return
from it, and those that the surface stopped although the model leaves the way to the planned place open.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom

from ..model.on_element import ElementSurfaces
from ..model.raycast import RayScene
from ..model.samples import SurfaceSamples
from .own_evidence import ERROR_RATE, LEAST_OPPOSED, clearly_inside, clearly_outside, shows_standing
from .sightings import AT, BEYOND, Sightings
from .slide import ALONG
from .thresholds import Thresholds

Leaving = Literal["LEFT", "HIDES", "STANDS", "OPEN"]
"""Of an element that fits another place: its planned one is empty, or is hidden by what was found though it should be in view;
it stands at the planned one; or it may stand there, hidden."""
ACROSS = 0.5
"""Faces whose normal has this cosine with a shift leave their plane by it; those along it stay in theirs and tell nothing."""
BEFORE_M = 0.02
"""What a beam meets this close before a position is the position's own face, or covers it."""


@dataclass(frozen=True)
class PlaceLeft:
    """Different beams that tell whether an element left its planned place for another one."""

    at: int
    """Returned from the planned place, of faces across the shift."""
    through: int
    """Clearly passed through the planned place."""
    stopped: int
    """Stopped before it by a surface that fits the other place, where the model leaves the way open."""
    stopped_anyway: int
    """The same, where by the model another element stands in the way too."""

    @property
    def passed(self) -> bool:
        """Whether so many beams through it would be unlikely if it stood: at edges and recesses some always pass."""
        return bool(binom.sf(self.through - 1, self.at + self.through, LEAST_OPPOSED) < ERROR_RATE)

    def should_be_seen(self, share: float) -> bool:
        """Whether more than ``share`` of its hidden place should be in view by the model (exact binomial test)."""
        return bool(binom.sf(self.stopped - 1, self.stopped + self.stopped_anyway, share) < ERROR_RATE)


@dataclass(frozen=True)
class PlannedPlaces:
    """What was seen in the direction of the planned places of all elements. Local frame, metres."""

    seen: Sightings
    """(M,) sorted by sample."""
    origins: NDArray[np.float64]
    """(M, 3) of their rays."""
    samples: SurfaceSamples
    first: NDArray[np.int64]
    """(E + 1,) each element's first row of ``seen``."""
    scene: RayScene
    surfaces: ElementSurfaces
    window: float
    registration_sigma: float

    @classmethod
    def of(
        cls, seen: Sightings, origins: NDArray[np.float64], samples: SurfaceSamples, scene: RayScene,
        surfaces: ElementSurfaces, window: float, registration_sigma: float, elements: int,
    ) -> PlannedPlaces:
        """Of ``elements`` elements in all, as planned in ``scene``."""
        first = np.searchsorted(seen.sample, samples.first_of(elements)).astype(np.int64)
        return cls(seen, origins, samples, first, scene, surfaces, window, registration_sigma)

    def left(self, row: int, shift: NDArray[np.float64], through: int) -> PlaceLeft:
        """Beams that tell whether element ``row`` left its place by ``shift`` (3,).

        ``through`` beams pass it by more than the window. Of two places closer together than two windows, a
        return tells of the nearer one.
        """
        own = slice(int(self.first[row]), int(self.first[row + 1]))
        seen, origin = self.seen.rows(own), self.origins[own]
        along = self.samples.normal[seen.sample] @ shift
        across = seen.on_face & ~seen.explained & (np.abs(along) >= ACROSS * np.linalg.norm(shift))
        off, half = seen.deviation, np.minimum(self.window, 0.5 * np.abs(along))
        behind = np.flatnonzero(across & (off < -half) & (off >= -self.window))
        behind = behind[clearly_inside(
            seen.rows(behind), self.samples, origin[behind], self.surfaces, self.registration_sigma
        )]
        stops = np.flatnonzero(across & (off > half) & (np.abs(off - along) <= self.window))
        ray = self.samples.position[seen.sample[stops]] - origin[stops]
        length = np.maximum(np.linalg.norm(ray, axis=1), BEFORE_M)
        _, met = self.scene.first_hit(origin[stops], ray / length[:, None], length - BEFORE_M)
        key = seen.ray_key(stops)
        free = np.unique(key[(met < 0) | (self.scene.element[met] == row)])
        return PlaceLeft(
            len(np.unique(seen.ray_key(across & (np.abs(off) <= half)))),
            through + len(np.unique(seen.ray_key(behind))), len(free), len(np.unique(key)) - len(free),
        )

    def leaving(self, row: int, shift: NDArray[np.float64], through: int, stays: bool, t: Thresholds) -> Leaving:
        """Whether element ``row``, which fits the place off by ``shift`` (3,), left its planned one.

        ``through`` as in ``left``; ``stays``: much of it overlaps its planned place from there.
        """
        left = self.left(row, shift, through)
        if left.passed:
            return "LEFT"
        if shows_standing(left.at, left.through + left.stopped, t.present_share) or shows_standing(
            *self.strip(row, shift), t.absent_share
        ):
            return "STANDS"
        return "HIDES" if stays and left.should_be_seen(t.present_share) else "OPEN"

    def strip(self, row: int, shift: NDArray[np.float64]) -> tuple[int, int]:
        """Different beams that (return from, pass) the part of the faces along ``shift`` (3,) that it would leave.

        Those that come so near to its new edge that part of their light may meet it there tell nothing.
        """
        own = slice(int(self.first[row]), int(self.first[row + 1]))
        seen, origin = self.seen.rows(own), self.origins[own]
        normal = self.samples.normal[seen.sample]
        state = seen.state(self.window)
        told = seen.on_face & ~seen.explained & ((state == AT) | (state == BEYOND))
        told &= np.abs(normal @ shift) < ALONG * np.linalg.norm(shift)
        k = np.flatnonzero(told)
        k = k[clearly_outside(seen.rows(k), self.samples, origin[k], self.surfaces, shift, self.registration_sigma)]
        returned, passed = (len(np.unique(seen.ray_key(k[state[k] == what]))) for what in (AT, BEYOND))
        return returned, passed
