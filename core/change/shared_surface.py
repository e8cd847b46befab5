"""Which positions of an element's open surface lie on the surface of another one too: returns there may be either one's.

Elements modelled twice, boards modelled within the wall that they formed, rafters in a roof that is modelled solid down to
their underside, a column flush with the wall around it. A whole and its parts share their surface too, but there nothing is
in doubt: what stands is both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.elements import BuildingModel
from ..model.on_element import ElementSurfaces
from ..model.samples import SurfaceSamples
from .parts import Parts

SAME_SURFACE_M = 0.002
"""Surfaces this close together, facing the same way, are one to any scanner."""
ASKED_AT_ONCE = 500_000


@dataclass(frozen=True)
class SharedSurface:
    """Pairs of a position and another element whose surface lies there too."""

    sample: NDArray[np.int64]
    """(K,) rows of the samples."""
    element: NDArray[np.int64]
    """(K,) whose they are."""
    partner: NDArray[np.int64]
    """(K,) the other element."""
    area: NDArray[np.float64]
    """(K,) m2 that the position stands for."""

    def in_doubt(self, samples: int, gone: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(samples,) whether a partner that is not known to be ``gone`` (E,) has the position too."""
        doubt = np.zeros(samples, np.bool_)
        doubt[self.sample[~gone[self.partner]]] = True
        return doubt

    def main_partner(self, row: int, gone: NDArray[np.bool_]) -> int:
        """The element, not known to be ``gone`` (E,), that has most of the open surface of ``row``; -1 where there is none."""
        of = (self.element == row) & ~gone[self.partner]
        if not of.any():
            return -1
        return int(np.argmax(np.bincount(self.partner[of], weights=self.area[of])))


def find_shared(
    model: BuildingModel, samples: SurfaceSamples, surfaces: ElementSurfaces, parts: Parts = frozenset()
) -> SharedSurface:
    """All such pairs among the exposed ``samples``; a part and its whole are none."""
    low, high = model.element_bounds
    low, high = low - SAME_SURFACE_M, high + SAME_SURFACE_M
    first = samples.first_of(len(model.elements))
    found: list[tuple[NDArray[np.int64], NDArray[np.int64]]] = []
    rows: list[NDArray[np.int64]] = []
    others: list[NDArray[np.int64]] = []
    waiting = 0
    for row in range(len(model.elements)):
        own = np.arange(first[row], first[row + 1])
        own = own[samples.exposed[own]]
        if not len(own):
            continue
        place = samples.position[own]
        near = (low <= high[row]).all(axis=1) & (high >= low[row]).all(axis=1)
        for other in np.flatnonzero(near).tolist():
            if other == row or (row, other) in parts or (other, row) in parts or first[other] == first[other + 1]:
                continue
            within = own[((place >= low[other]) & (place <= high[other])).all(axis=1)]
            rows.append(within)
            others.append(np.full(len(within), other))
            waiting += len(within)
        if waiting > ASKED_AT_ONCE:
            found.append(_on_others(np.concatenate(rows), np.concatenate(others), samples, first, surfaces))
            rows, others, waiting = [], [], 0
    if waiting:
        found.append(_on_others(np.concatenate(rows), np.concatenate(others), samples, first, surfaces))
    none = np.zeros(0, np.int64)
    sample, partner = (np.concatenate([none, *(f[k] for f in found)]) for k in (0, 1))
    return SharedSurface(sample, samples.element[sample].astype(np.int64), partner, samples.area[sample])


def _on_others(
    sample: NDArray[np.int64], other: NDArray[np.int64], samples: SurfaceSamples, first: NDArray[np.int64],
    surfaces: ElementSurfaces,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Those of the pairs whose position lies on a surface of the other element."""
    on = surfaces.face_at(
        samples.position[sample].astype(np.float64), samples.normal[sample].astype(np.float64), other.astype(np.int32),
        samples.triangle[first[other]].astype(np.int32), SAME_SURFACE_M,
    )
    return sample[on >= 0], other[on >= 0]
