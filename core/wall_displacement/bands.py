"""The returns near the joints, out of all of an epoch: at edges every return counts, elsewhere a few suffice."""

from __future__ import annotations

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from .epoch import Epoch
from .panels import inner_edges
from .wall import CELL_M, REACH_M, Wall, WallPoints

Array = NDArray[np.float64]


def returns_near_joints(
    epoch: Epoch, wall: Wall, bounds: list[tuple[float, float]], heights: list[list[float]], reach: float
) -> list[WallPoints]:
    """Per column its returns within ``reach`` [m] of one of its ``heights`` (wall frame) and near the wall's surface."""
    edges = inner_edges(bounds)
    first = np.concatenate([[0], np.cumsum([len(h) for h in heights])]).astype(np.int64)
    middle = np.array([z for h in heights for z in h], dtype=np.float64)
    column = _columns_of(epoch.points, wall.origin, wall.axes, wall.low, wall.surface, edges, first, middle, reach)
    rows = np.flatnonzero(column >= 0)
    rows = rows[np.argsort(column[rows].astype(np.int16 if len(bounds) < 30_000 else np.int32), kind="stable")]
    ends = np.cumsum(np.bincount(column[rows], minlength=len(bounds)))
    stations = wall.to_wall(epoch.stations)
    return [
        WallPoints(wall.to_wall(epoch.points[own]), epoch.station[own], stations) for own in np.split(rows, ends[:-1])
    ]


@njit(cache=True, nogil=True, parallel=True)
def _columns_of(points, origin, axes, low, surface, edges, first, middle, reach):  # type: ignore[no-untyped-def]
    """(N,) number of the column that a point near a joint belongs to, -1 for all others."""
    out = np.full(len(points), -1, np.int32)
    for i in prange(len(points)):
        a, b, c = points[i, 0] - origin[0], points[i, 1] - origin[1], points[i, 2] - origin[2]
        x = axes[0, 0] * a + axes[0, 1] * b + axes[0, 2] * c
        cell = np.searchsorted(edges, x)
        if cell % 2 == 0:
            continue
        column = cell // 2
        z = axes[2, 0] * a + axes[2, 1] * b + axes[2, 2] * c
        near = False
        for k in range(first[column], first[column + 1]):
            near = near or abs(z - middle[k]) < reach
        if not near:
            continue
        row, level = int(np.floor((x - low[0]) / CELL_M)), int(np.floor((z - low[1]) / CELL_M))
        if row < 0 or level < 0 or row >= surface.shape[0] or level >= surface.shape[1]:
            continue
        y = axes[1, 0] * a + axes[1, 1] * b + axes[1, 2] * c
        if abs(y - surface[row, level]) < REACH_M:
            out[i] = column
    return out
