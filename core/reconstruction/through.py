"""Where a floor does not lie: rays pass its level."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import binary_closing, binary_opening

from ..planes.cloud import Cloud
from ..planes.surfels import Surfels

Array = NDArray[np.float64]

CELL_M = 0.06
UP_COS = 0.9
MOST_RAYS = 4_000_000
IN_FLOOR_M = (0.05, 0.15)
"""So far below a floor is its slab, and above the last step of a stair."""
SMOOTH_CELLS = 3
BEFORE_END_M = 0.05
X_AXIS = np.array([1.0, 0.0])


def seen_through(
    cloud: Cloud, surfels: Surfels, floor: float, low: Array, shape: tuple[int, ...], along: Array = X_AXIS,
    within: NDArray[np.bool_] | None = None,
) -> NDArray[np.bool_]:
    """Cells of CELL_M from ``low``, rows ``along`` (2,), in which rays pass just below the level ``floor``.

    Only those ``within`` count, if given.
    """
    passes = np.zeros(shape, dtype=np.int32)
    step = max(1, len(cloud.points) // MOST_RAYS)
    _mark(
        cloud.points[::step], cloud.station[::step], cloud.stations, low, CELL_M, along, floor - IN_FLOOR_M[1],
        floor - IN_FLOOR_M[0], passes,
    )
    own = passes > 0 if within is None else (passes > 0) & within
    through = binary_closing(own, iterations=SMOOTH_CELLS) & ~floor_cells(surfels, floor, low, shape, along)
    return np.asarray(binary_opening(through, iterations=SMOOTH_CELLS - 1))


def floor_cells(surfels: Surfels, floor: float, low: Array, shape: tuple[int, ...], along: Array = X_AXIS) -> NDArray[np.bool_]:
    """Cells of the same raster in which the floor was seen."""
    there = (surfels.normal[:, 2] > UP_COS) & (np.abs(surfels.position[:, 2] - floor) < IN_FLOOR_M[0])
    cell = np.floor((turned(surfels.position[there, :2], along) - low) / CELL_M).astype(np.int64)
    cell = cell[((cell >= 0) & (cell < shape)).all(axis=1)]
    out = np.zeros(shape, dtype=np.bool_)
    out[cell[:, 0], cell[:, 1]] = True
    return out


def turned(places: Array, along: Array) -> Array:
    """(N, 2) places in plan, along and to the left of a direction."""
    return np.asarray(places @ np.array([[along[0], -along[1]], [along[1], along[0]]]))


def passing(cloud: Cloud, floor: float) -> NDArray[np.bool_]:
    """(N,) whether the ray of a return passes all of what would be a floor's slab."""
    out = np.zeros(len(cloud.points), dtype=np.bool_)
    _passing(cloud.points, cloud.station, cloud.stations, floor - IN_FLOOR_M[1], floor - IN_FLOOR_M[0], out)
    return out


@njit(cache=True, nogil=True)
def _mark(points, station, stations, low, cell, along, bottom, top, out):  # type: ignore[no-untyped-def]
    """Count the rays that pass through each cell between two heights."""
    nx, ny = out.shape
    for i in range(len(points)):
        o = stations[station[i]]
        t0, t1 = _between(points[i], o, bottom, top)
        if t0 < 0.0:
            continue
        dx, dy = points[i, 0] - o[0], points[i, 1] - o[1]
        steps = int((t1 - t0) * np.sqrt(dx * dx + dy * dy) / (0.7 * cell)) + 1
        last = -1
        for k in range(steps + 1):
            t = t0 + (t1 - t0) * k / steps
            x, y = o[0] + t * dx, o[1] + t * dy
            ix = int(np.floor((x * along[0] + y * along[1] - low[0]) / cell))
            iy = int(np.floor((y * along[0] - x * along[1] - low[1]) / cell))
            if ix < 0 or iy < 0 or ix >= nx or iy >= ny:
                continue
            here = ix * ny + iy
            if here != last:
                out[ix, iy] += 1
                last = here


@njit(cache=True, nogil=True)
def _passing(points, station, stations, bottom, top, out):  # type: ignore[no-untyped-def]
    for i in range(len(points)):
        out[i] = _between(points[i], stations[station[i]], bottom, top)[0] >= 0.0


@njit(cache=True, nogil=True)
def _between(point, origin, bottom, top):  # type: ignore[no-untyped-def]
    """Shares of the ray at which it enters and leaves what lies between two heights; -1 where it does not pass all of it."""
    dx, dy, dz = point[0] - origin[0], point[1] - origin[1], point[2] - origin[2]
    length = np.sqrt(dx * dx + dy * dy + dz * dz)
    if length < 0.3 or dz == 0.0:
        return -1.0, -1.0
    t0, t1 = (bottom - origin[2]) / dz, (top - origin[2]) / dz
    if t0 > t1:
        t0, t1 = t1, t0
    if t0 < 0.0 or t1 > 1.0 - BEFORE_END_M / length:
        return -1.0, -1.0
    return t0, t1
