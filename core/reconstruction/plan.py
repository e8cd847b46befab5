"""The plan of a storey as a raster: heights of the ceiling, and where the air below it is free."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, label
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..planes.cloud import Cloud
from ..planes.surfels import Surfels
from .faces import UPRIGHT
from .levels import UNDER_FLOOR_M, Storey
from .through import CELL_M, MOST_RAYS, UP_COS, seen_through

Array = NDArray[np.float64]

LEAST_ROOM_HEIGHT_M = 1.7
CEILING_COS = 0.4
FILL_M = 0.6
"""The ceiling is taken to go on this far beyond where it was seen."""
SLAB_M = (0.04, 0.36)
"""The air that decides about rooms: this far below the ceiling, above doors and most furniture."""
STEP_M = 0.2
"""A step of the ceiling that parts rooms: the head of a door is that much lower, unevenness and slopes are not."""
LEAST_PASSES = 2
LEAST_ROOM_M2 = 0.6
LEAST_WELL_M2 = 6.0
"""Where a floor is open over a smaller area, as for a stair, the storeys are parted all the same."""


@dataclass(frozen=True)
class PlanRaster:
    """Cells of ``cell`` metres from ``low``; [ix, iy]."""

    low: Array
    cell: float
    ceiling: Array
    """Height above each cell, not a number where none is near."""
    floor: Array
    """Height of the floor seen in each cell, not a number where none was."""
    free: NDArray[np.bool_]
    """Air was seen below the ceiling."""
    rooms: NDArray[np.int32]
    """0, or the number of the connected piece of free cells."""

    def centres(self, ix: NDArray[np.int64], iy: NDArray[np.int64]) -> Array:
        """(N, 2) middles of cells."""
        return np.asarray(self.low + (np.stack([ix, iy], axis=1) + 0.5) * self.cell)

    def cells(self, places: Array) -> NDArray[np.int64]:
        """(N, 2) cells of places in plan; the nearest of the raster for those beyond it."""
        cell = np.floor((places - self.low) / self.cell).astype(np.int64)
        return np.clip(cell, 0, np.array(self.rooms.shape) - 1)


def make_plan(cloud: Cloud, surfels: Surfels, storey: Storey) -> PlanRaster:
    """Rasters of one storey."""
    z = surfels.position[:, 2]
    inside = surfels.where((z > storey.floor - 0.3) & (z < storey.top + 0.03))
    xy = inside.position[:, :2]
    own = cloud.stations[list(storey.stations), :2]
    low = np.maximum(xy.min(axis=0), own.min(axis=0) - 60.0) - 3 * CELL_M
    high = np.minimum(xy.max(axis=0), own.max(axis=0) + 60.0) + 3 * CELL_M
    shape = tuple(int(v) for v in (high - low) / CELL_M + 1)
    within = np.all((xy > low) & (xy < high), axis=1)
    inside = inside.where(within)
    cell = ((inside.position[:, :2] - low) / CELL_M).astype(np.int64)
    height = inside.position[:, 2]
    ends = np.ones(len(inside), dtype=np.bool_)
    if np.isfinite(storey.past):
        well = _wells(seen_through(cloud, surfels, storey.past, low, shape))
        ends = (height < storey.past - UNDER_FLOOR_M) | well[cell[:, 0], cell[:, 1]]
    ceiling = _ceiling(inside.where(ends), cell[ends], height[ends], storey, shape)
    floor = np.full(shape, np.nan)
    level = (inside.normal[:, 2] > UP_COS) & (np.abs(height - storey.floor) < 0.3)
    floor[cell[level, 0], cell[level, 1]] = height[level]
    free = np.zeros(shape, dtype=np.int32)
    step = max(1, len(cloud.points) // MOST_RAYS)
    _mark_free(
        cloud.points[::step], cloud.station[::step], cloud.stations, low, CELL_M, ceiling, SLAB_M[0], SLAB_M[1],
        float(np.nanmin(ceiling)) - SLAB_M[1] if np.isfinite(ceiling).any() else np.inf, free,
    )
    barrier = np.zeros(shape, dtype=np.bool_)
    above = ceiling[cell[:, 0], cell[:, 1]]
    with np.errstate(invalid="ignore"):
        upright = (np.abs(inside.normal[:, 2]) < 2 * UPRIGHT) & (height > above - SLAB_M[1] - 0.1) & (height < above - 0.02)
    barrier[cell[upright, 0], cell[upright, 1]] = True
    air = (free >= LEAST_PASSES) & ~barrier
    if storey.beside:
        air &= ~_wells(seen_through(cloud, surfels, storey.floor, low, shape))
    rooms = _connected(air, ceiling)
    size = np.bincount(rooms.ravel()) * CELL_M**2
    rooms[size[rooms] < LEAST_ROOM_M2] = 0
    return PlanRaster(low, CELL_M, ceiling, floor, air, rooms)


def _wells(through: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Those of the cells that are larger than a stair's opening."""
    piece, _ = label(through)
    large = np.bincount(piece.ravel()) * CELL_M**2 > LEAST_WELL_M2
    large[0] = False
    return np.asarray(large[piece])


def _connected(air: NDArray[np.bool_], ceiling: Array) -> NDArray[np.int32]:
    """Number of the connected piece of air of each cell, 0 for none; a step of the ceiling (the head of a door) parts."""
    number = np.full(air.shape, -1, dtype=np.int64)
    number[air] = np.arange(int(air.sum()))
    pairs = []
    for a, b in ((np.s_[1:, :], np.s_[:-1, :]), (np.s_[:, 1:], np.s_[:, :-1])):
        with np.errstate(invalid="ignore"):
            joined = air[a] & air[b] & (np.abs(ceiling[a] - ceiling[b]) < STEP_M)
        pairs.append(np.stack([number[a][joined], number[b][joined]]))
    i, j = np.concatenate(pairs, axis=1)
    count = int(air.sum())
    graph = coo_array((np.ones(len(i), dtype=np.int8), (i, j)), shape=(count, count))
    out = np.zeros(air.shape, dtype=np.int32)
    out[air] = connected_components(graph, directed=False)[1] + 1
    return out


def _ceiling(
    inside: Surfels, cell: NDArray[np.int64], height: Array, storey: Storey, shape: tuple[int, ...]
) -> Array:
    ceiling = np.full(shape, -np.inf)
    if storey.has_ceiling:
        down = (inside.normal[:, 2] < -CEILING_COS) & (height > storey.floor + LEAST_ROOM_HEIGHT_M)
        np.maximum.at(ceiling, (cell[down, 0], cell[down, 1]), height[down])
    else:
        up = (inside.normal[:, 2] > UP_COS) & (np.abs(height - storey.floor) < 0.1)
        ceiling[cell[up, 0], cell[up, 1]] = storey.ceiling
    seen = np.isfinite(ceiling)
    if not seen.any():
        return np.full(shape, np.nan)
    distance, nearest = distance_transform_edt(~seen, return_indices=True)
    filled = ceiling[tuple(nearest)]
    return np.where(distance * CELL_M <= FILL_M, filled, np.nan)


@njit(cache=True, nogil=True)
def _mark_free(points, station, stations, low, cell, ceiling, near, far, lowest, out):  # type: ignore[no-untyped-def]
    """Count the rays that pass through the air below the ceiling of each cell."""
    nx, ny = ceiling.shape
    for i in range(len(points)):
        o = stations[station[i]]
        dx, dy, dz = points[i, 0] - o[0], points[i, 1] - o[1], points[i, 2] - o[2]
        length = np.sqrt(dx * dx + dy * dy + dz * dz)
        if length < 0.3:
            continue
        t1 = 1.0 - 0.05 / length
        t0 = 0.0
        if o[2] < lowest:
            if dz <= 0.0:
                continue
            t0 = (lowest - o[2]) / dz
        if t0 >= t1:
            continue
        plan = np.sqrt(dx * dx + dy * dy)
        steps = int((t1 - t0) * max(plan / (0.7 * cell), abs(dz) / 0.1)) + 1
        last = -1
        for k in range(steps + 1):
            t = t0 + (t1 - t0) * k / steps
            ix = int((o[0] + t * dx - low[0]) / cell)
            iy = int((o[1] + t * dy - low[1]) / cell)
            if ix < 0 or iy < 0 or ix >= nx or iy >= ny:
                continue
            here = ix * ny + iy
            if here == last:
                continue
            c = ceiling[ix, iy]
            z = o[2] + t * dz
            if z <= c - near and z >= c - far:
                out[ix, iy] += 1
                last = here
