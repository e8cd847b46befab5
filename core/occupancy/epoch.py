"""Occupancy of one epoch: which voxels are occupied, empty or unknown to its scans."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from ..evidence.collect import StationIndexes
from ..evidence.gather import SensorModel
from ..progress import Progress
from ..scans.store import in_sector
from .bricks import BrickTable
from .free_space import BETWEEN, PASSED, SURFACE, label_voxels
from .grid import BITS, CELLS, VoxelGrid
from .station_rays import PATCH_REACH, station_rays
from .votes import Occupied, Votes

UNSEEN, EMPTY, NEAR, OCCUPIED = 0, 1, 2, 3
"""Nobody knows; rays pass; a neighbour is occupied, and the grid cannot tell which of the two; occupied."""


def occupied_voxels(
    stations: StationIndexes, grid: VoxelGrid, least: int, sensor: SensorModel, progress: Progress,
    within: NDArray[np.float64] | None = None,
) -> Occupied:
    """The voxels that at least ``least`` returns of an epoch lie in (fewer where the scan is sparse, see ``Votes``).

    within : (2, 3) box outside of which nothing is asked [m, local frame].
    """
    votes = Votes(grid, least, within)
    for station, index, sector in stations.visit(sensor, progress):
        votes.add(index.returns, stations.position[station], index.spacing_rad, owned(index.returns, sector))
    return votes.occupied()


def owned(returns: NDArray[np.float32], sector: NDArray[np.float64] | None) -> NDArray[np.bool_] | None:
    """(N,) whether a tile's azimuth range (2,) [rad] holds each return (N, 3); None when it is all of them."""
    return None if sector is None else in_sector(returns, *sector)


def observe(
    stations: StationIndexes, grid: VoxelGrid, occupied: Occupied, table: BrickTable, wanted: NDArray[np.bool_],
    sensor: SensorModel, progress: Progress,
) -> Observation:
    """What an epoch says of the ``wanted`` (B, 512) voxels of the table's bricks."""
    state = settled(occupied, table, wanted)
    conclude(state, free_space(stations, grid, table, wanted & (state == UNSEEN), sensor, progress))
    return Observation(table, state)


def free_space(
    stations: StationIndexes, grid: VoxelGrid, table: BrickTable, asked: NDArray[np.bool_], sensor: SensorModel,
    progress: Progress,
) -> NDArray[np.uint8]:
    """(B, 512) what the rays of all stations say of the ``asked`` (B, 512) voxels of the table's bricks."""
    labels = np.zeros((len(table), CELLS), np.uint8)
    for station, index, sector in stations.visit(sensor, progress, PATCH_REACH):
        rays = station_rays(index, stations.count(station), grid.edge, owned(index.returns, sector))
        label_voxels(table.keys, asked, stations.position[station], grid.anchor, grid.edge, rays, labels, sector)
    return labels


def settled(occupied: Occupied, table: BrickTable, wanted: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """(B, 512) OCCUPIED and NEAR for ``wanted`` voxels, else UNSEEN: no ray empties these, so none needs to be asked.

    A ray that grazes an occupied voxel, and noise at the border of two, would else empty what stands.
    """
    state = np.empty((len(table), CELLS), np.uint8)
    around = occupied.table.around(table.keys)
    _settle(wanted, around, np.packbits(occupied.cells, axis=1, bitorder="little"), state)
    return state


def conclude(state: NDArray[np.uint8], labels: NDArray[np.uint8]) -> None:
    """Enter what rays said of voxels that are neither occupied nor near one.

    A ray that passes goes before what is read between rays, so a voxel needs no other station once one has passed it.
    """
    surface = (labels & SURFACE) > 0
    passed = (labels & PASSED) > 0
    rest = state == UNSEEN
    state[rest & surface & ~passed] = NEAR
    state[rest & (passed | (~surface & ((labels & BETWEEN) > 0)))] = EMPTY


@dataclass(frozen=True)
class Observation:
    """UNSEEN, EMPTY, NEAR or OCCUPIED for voxels of ``table``'s bricks, (B, 512)."""

    table: BrickTable
    state: NDArray[np.uint8]


def neighbour_keys(keys: NDArray[np.int64]) -> NDArray[np.int64]:
    """(N, 27) keys of the bricks around each brick; itself in the middle."""
    step = np.array([
        (i << (2 * BITS)) + (j << BITS) + k for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1)
    ], dtype=np.int64)
    return keys[:, None] + step


@njit(cache=True, nogil=True, inline="always")
def cell_set(cells: NDArray[np.bool_], around: NDArray[np.int32], row: int, i: int, j: int, k: int) -> bool:
    """Whether the voxel (i, j, k), counted from a brick's first one, -8 ... 15, is set."""
    n = ((i >> 3) + 1) * 9 + ((j >> 3) + 1) * 3 + (k >> 3) + 1
    there = around[row, n]
    return there >= 0 and cells[there, ((i & 7) << 6) | ((j & 7) << 3) | (k & 7)]


@njit(cache=True, nogil=True, inline="always")
def _run(runs: NDArray[np.uint8], around: NDArray[np.int32], row: int, i: int, j: int, k: int) -> int:
    """The eight voxels along z at (i, j), -1 ... 8, of a brick's neighbour ``k`` of 3 along z, a bit each."""
    there = around[row, ((i >> 3) + 1) * 9 + ((j >> 3) + 1) * 3 + k]
    return int(runs[there, ((i & 7) << 3) | (j & 7)]) if there >= 0 else 0


@njit(cache=True, nogil=True, parallel=True)
def _settle(
    wanted: NDArray[np.bool_], around: NDArray[np.int32], runs: NDArray[np.uint8], state: NDArray[np.uint8]
) -> None:
    """``runs``: (B, 64) of the occupied bricks, a bit for each voxel along z."""
    for row in prange(len(wanted)):
        nobody = True
        for n in range(27):
            nobody &= around[row, n] < 0
        if nobody:
            state[row] = UNSEEN
            continue
        wide = np.empty((10, 10), np.int64)  # a bit for each voxel along z that is occupied or beside one that is
        for i in range(10):
            for j in range(10):
                ten = _run(runs, around, row, i - 1, j - 1, 0) >> 7
                ten |= _run(runs, around, row, i - 1, j - 1, 1) << 1
                ten |= _run(runs, around, row, i - 1, j - 1, 2) << 9
                wide[i, j] = ten | (ten >> 1) | (ten >> 2)
        for i in range(8):
            for j in range(8):
                near = 0
                for di in range(3):
                    near |= wide[i + di, j] | wide[i + di, j + 1] | wide[i + di, j + 2]
                stands = _run(runs, around, row, i, j, 1)
                for k in range(8):  # without branches: any voxel may be either
                    cell = (i << 6) | (j << 3) | k
                    state[row, cell] = wanted[row, cell] * (NEAR * ((near >> k) & 1) + (OCCUPIED - NEAR) * ((stands >> k) & 1))
