"""Elements whose whole open surface is also that of another one, so that no scan can tell whether they stand.

Elements modelled twice, and rafters in a roof that is modelled solid down to their underside. A whole and its parts share their
surface too, but there nothing is in doubt: what stands is both.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..model.elements import BuildingModel
from ..model.on_element import ElementSurfaces
from ..model.samples import SurfaceSamples
from .parts import Parts

SAME_SURFACE_M = 0.002
"""Surfaces this close together, facing the same way, are one to any scanner."""
SAME_SHARE = 0.75
"""What is left of the open surface is then less than makes an element absent or present."""
MOST_ASKED = 400
"""Positions of an element that are asked for: shares to two percent."""


def find_twins(
    model: BuildingModel, samples: SurfaceSamples, surfaces: ElementSurfaces, parts: Parts = frozenset()
) -> NDArray[np.int64]:
    """(E,) row of the element that nearly the whole open surface of each one also belongs to; -1 for none.

    A part and its whole are no such pair.
    """
    count = len(model.elements)
    low, high = model.element_bounds
    low, high = low - SAME_SURFACE_M, high + SAME_SURFACE_M
    first = samples.first_of(count)
    volume = np.prod(high - low, axis=1)
    twin = np.full(count, -1, np.int64)
    for row in range(count):
        common = np.prod(np.maximum(np.minimum(high, high[row]) - np.maximum(low, low[row]), 0.0), axis=1)
        common[row] = 0.0
        best = SAME_SHARE
        for other in np.flatnonzero(common > SAME_SHARE * volume[row]):
            if (row, int(other)) in parts or (int(other), row) in parts:
                continue
            share = _shared(row, int(other), samples, first, surfaces)
            if share >= best and (twin[row] < 0 or share > best):
                twin[row], best = other, share
    return twin


def _shared(
    row: int, other: int, samples: SurfaceSamples, first: NDArray[np.int64], surfaces: ElementSurfaces
) -> float:
    """Share of an element's open surface that lies on a surface of the other one."""
    at = np.arange(first[row], first[row + 1])
    at = at[samples.exposed[at]]
    if not len(at) or first[other] == first[other + 1]:
        return 0.0
    at = at[:: -(-len(at) // MOST_ASKED)]
    on = surfaces.face_at(
        samples.position[at].astype(np.float64), samples.normal[at].astype(np.float64), np.full(len(at), other, np.int32),
        np.full(len(at), samples.triangle[first[other]], np.int32), SAME_SURFACE_M,
    )
    return float(samples.area[at][on >= 0].sum() / samples.area[at].sum())
