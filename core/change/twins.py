"""Elements modelled twice: two of them with the same surface at the same place, so that no scan can tell which one stands."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..model.elements import BuildingModel
from ..model.on_element import ElementSurfaces
from ..model.samples import SurfaceSamples

SAME_SURFACE_M = 0.002
"""Surfaces this close together, facing the same way, are one to any scanner."""
SAME_SHARE = 0.75
"""Twins share this much of their open surfaces, both ways: what is left is less than makes an element absent or present."""


def find_twins(model: BuildingModel, samples: SurfaceSamples, surfaces: ElementSurfaces) -> NDArray[np.int64]:
    """(E,) row of the element that shares nearly the whole open surface of each one and has no other itself; -1 for none.

    A part that lies on a larger element is no twin of it: the other way, little of that one's surface is shared.
    """
    count = len(model.elements)
    corner = model.vertices[model.triangles].reshape(-1, 3)
    first = np.minimum(3 * model.triangle_start[:-1].astype(np.int64), max(len(corner) - 1, 0))
    low = np.minimum.reduceat(corner, first) - SAME_SURFACE_M
    high = np.maximum.reduceat(corner, first) + SAME_SURFACE_M
    volume = np.prod(high - low, axis=1)
    twin = np.full(count, -1, np.int64)
    for row in range(count):
        common = np.prod(np.maximum(np.minimum(high, high[row]) - np.maximum(low, low[row]), 0.0), axis=1)
        alike = (common > SAME_SHARE * volume) & (common > SAME_SHARE * volume[row])
        for other in np.flatnonzero(alike & (np.arange(count) > row)):
            if min(_shared(row, other, samples, surfaces), _shared(other, row, samples, surfaces)) >= SAME_SHARE:
                for a, b in ((row, other), (other, row)):
                    twin[a] = b if twin[a] < 0 else twin[a]
    return twin


def _shared(row: int, other: int, samples: SurfaceSamples, surfaces: ElementSurfaces) -> float:
    """Share of an element's open surface that lies on a surface of the other one."""
    mine, its = (slice(*np.searchsorted(samples.element, [k, k + 1])) for k in (row, other))
    mine_open = np.arange(mine.start, mine.stop)[samples.exposed[mine]]
    if not len(mine_open) or its.start == its.stop:
        return 0.0
    on = surfaces.face_at(
        samples.position[mine_open].astype(np.float64), samples.normal[mine_open].astype(np.float64),
        np.full(len(mine_open), other, np.int32), np.full(len(mine_open), samples.triangle[its.start], np.int32),
        SAME_SURFACE_M,
    )
    area = samples.area[mine_open]
    return float(area[on >= 0].sum() / area.sum())
