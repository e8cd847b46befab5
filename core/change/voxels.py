"""States of voxels between a reference and an epoch, the reference being scans, or the model where those are silent."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from ..occupancy.bricks import BrickTable
from ..occupancy.epoch import EMPTY, NEAR, OCCUPIED, UNSEEN, Observation, cell_set
from ..occupancy.grid import CELLS, VoxelGrid, voxel_index
from ..occupancy.votes import Occupied
from .holders import Further
from .results import CONFIRMED, DISAPPEARED, NEW, NOTHING, UNKNOWN, VoxelCounts
from .solids import SolidVoxels

ROWS = 8192
"""Bricks compared at once: intermediate arrays then stay small."""
TOLERANCE_M = 0.02
"""What stands this close to a planned surface belongs to it: usual building tolerance, as in ``verify``."""


@dataclass(frozen=True)
class Universe:
    """All voxels that a comparison looks at: the model's and those occupied in any epoch."""

    grid: VoxelGrid
    table: BrickTable
    element: NDArray[Any]
    """(B, 512) the first element whose solid holds the voxel, or which stands within the tolerance of it; -1 for none."""
    further: Further
    """The others that hold it."""
    planned: NDArray[np.bool_]
    """(B, 512) the voxel is part of a planned solid."""
    wanted: NDArray[np.bool_]


def universe(solids: SolidVoxels, epochs: list[Occupied]) -> Universe:
    """Join the model's voxels with the occupied ones of all epochs."""
    table = BrickTable(np.unique(np.concatenate([solids.table.keys, *(e.table.keys for e in epochs)])))
    element = np.full((len(table), CELLS), -1, solids.element.dtype)
    of_solids = table.rows(solids.table.keys)
    element[of_solids] = solids.element
    planned = element >= 0
    wanted = planned.copy()
    for epoch in epochs:
        wanted[table.rows(epoch.table.keys)] |= epoch.cells
    around = table.around()
    reach = min(int(np.ceil(TOLERANCE_M / solids.grid.edge)) + 1, 7)
    _adopt(around, planned, wanted, _by_distance(reach), element)
    return Universe(solids.grid, table, element, solids.further.on(table, of_solids), planned, wanted)


def held_voxels(world: Universe, rows: Sequence[int]) -> dict[int, NDArray[np.int64]]:
    """(N, 3) all planned voxels of some elements."""
    found: dict[int, list[NDArray[np.int64]]] = {row: [] for row in rows}
    if not rows:
        return {}
    for begin in range(0, len(world.element), ROWS):
        bricks = slice(begin, begin + ROWS)
        _collect(found, world.table.keys[bricks], np.where(world.planned[bricks], world.element[bricks], -1))
    _collect(found, world.table.keys[world.further.brick], world.further.element)
    return {row: np.concatenate(parts) if parts else np.zeros((0, 3), np.int64) for row, parts in found.items()}


def _collect(
    found: dict[int, list[NDArray[np.int64]]], keys: NDArray[np.int64], element: NDArray[Any]
) -> None:
    brick, cell = np.nonzero(np.isin(element, list(found)))
    owner, index = element[brick, cell], voxel_index(keys[brick], cell)
    for row in np.unique(owner):
        found[int(row)].append(index[owner == row])


def _by_distance(reach: int) -> NDArray[np.int64]:
    """(N, 3) steps to all voxels within ``reach``, nearest first."""
    axis = np.arange(-reach, reach + 1)
    step = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    square = (step**2).sum(axis=1)
    step, square = step[square <= reach**2], square[square <= reach**2]
    return step[np.lexsort((step[:, 2], step[:, 1], step[:, 0], square))].astype(np.int64)


@njit(cache=True, nogil=True, parallel=True)
def _adopt(
    around: NDArray[np.int32], planned: NDArray[np.bool_], wanted: NDArray[np.bool_], steps: NDArray[np.int64],
    element: NDArray[np.int16],
) -> None:
    """Give voxels beside a solid its element; only those inside one are asked, so the order does not matter."""
    for row in prange(len(around)):
        for cell in range(CELLS):
            if planned[row, cell] or not wanted[row, cell]:
                continue
            i, j, k = cell >> 6, (cell >> 3) & 7, cell & 7
            for s in range(len(steps)):
                a, b, c = i + steps[s, 0], j + steps[s, 1], k + steps[s, 2]
                there = around[row, ((a >> 3) + 1) * 9 + ((b >> 3) + 1) * 3 + (c >> 3) + 1]
                if there >= 0:
                    beside = ((a & 7) << 6) | ((b & 7) << 3) | (c & 7)
                    if planned[there, beside]:
                        element[row, cell] = element[there, beside]
                        break


def compare(
    world: Universe, epoch: Observation, reference: Observation | None, place_open: bool = False
) -> NDArray[np.uint8]:
    """(B, 512) CONFIRMED, NEW, DISAPPEARED or UNKNOWN; NOTHING for voxels of no interest to these two.

    Against the model alone, every planned voxel counts as occupied before and every other one as empty, except beside a
    planned surface, where the tolerance of building decides nothing. With a reference epoch its voxels take that place;
    where it saw nothing, the model does. Where ``place_open``, one of the two may be off by more than a planned surface is
    wide, and nothing is new or gone.
    """
    state = np.empty(epoch.state.shape, np.uint8)
    for begin in range(0, len(state), ROWS):
        rows = slice(begin, begin + ROWS)
        was = None if reference is None else reference.state[rows]
        state[rows] = _compare(world.planned[rows], world.element[rows] >= 0, world.wanted[rows], epoch.state[rows], was)
    if place_open:
        state[(state == NEW) | (state == DISAPPEARED)] = UNKNOWN
    return state


def _compare(
    planned: NDArray[np.bool_], beside: NDArray[np.bool_], wanted: NDArray[np.bool_], now: NDArray[np.uint8],
    was: NDArray[np.uint8] | None,
) -> NDArray[np.uint8]:
    there = (now == OCCUPIED) | (now == NEAR)
    if was is None:
        before = planned | beside
        empty_before = ~before
        shown = planned | (now == OCCUPIED)
    else:
        before = (was == OCCUPIED) | (was == NEAR) | ((was == UNSEEN) & planned)
        empty_before = was == EMPTY
        shown = planned | (now == OCCUPIED) | (was == OCCUPIED)
    state = np.full(now.shape, UNKNOWN, np.uint8)
    state[before & there] = CONFIRMED
    state[before & (now == EMPTY)] = DISAPPEARED
    state[empty_before & there] = NEW
    state[~(shown & wanted)] = NOTHING
    return state


def deep(world: Universe, chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(B, 512) the chosen voxels with at least 20 of their 26 neighbours chosen too: parts at least three voxels thick."""
    around = world.table.around()
    out = np.zeros(chosen.shape, np.bool_)
    _deep(around, chosen, out)
    return out


@njit(cache=True, nogil=True, parallel=True)
def _deep(around: NDArray[np.int32], chosen: NDArray[np.bool_], out: NDArray[np.bool_]) -> None:
    for row in prange(len(around)):
        for cell in range(CELLS):
            if not chosen[row, cell]:
                continue
            i, j, k = cell >> 6, (cell >> 3) & 7, cell & 7
            n = 0
            for a in range(-1, 2):
                for b in range(-1, 2):
                    for c in range(-1, 2):
                        n += cell_set(chosen, around, row, i + a, j + b, k + c)
            out[row, cell] = n >= 21


@dataclass(frozen=True)
class VoxelCloud:
    """Voxels as a list, ordered by brick and cell, whatever the tiles and threads that made them."""

    index: NDArray[np.int64]
    """(N, 3)"""
    state: NDArray[np.uint8]
    element: NDArray[np.int32]
    """The first of those that hold it."""
    planned: NDArray[np.bool_]
    absent: NDArray[np.bool_]
    """Of a planned solid, and known not to stand in the last epoch, whether it stood in the reference or not."""


def count_states(state: NDArray[np.uint8], seen: NDArray[np.bool_], names: tuple[str, str]) -> VoxelCounts:
    """How many voxels (B, 512) are in each state, of those that ``voxel_cloud`` takes; ``names`` of epoch and reference."""
    count = np.zeros(256, np.int64)
    for begin in range(0, len(state), ROWS):
        part = state[begin : begin + ROWS]
        count += np.bincount(part[(part != UNKNOWN) | seen[begin : begin + ROWS]], minlength=256)
    return VoxelCounts(*names, *(int(count[code]) for code in (CONFIRMED, NEW, DISAPPEARED, UNKNOWN)))


def voxel_cloud(
    world: Universe, state: NDArray[np.uint8], seen: NDArray[np.bool_], absent: NDArray[np.bool_]
) -> VoxelCloud:
    """All voxels with a state, except the inside of solids of which nobody saw anything (not ``seen`` (B, 512)), and which
    are not known to be ``absent`` (B, 512)."""
    row, cell = np.nonzero((state != NOTHING) & ((state != UNKNOWN) | seen | absent))
    return VoxelCloud(
        voxel_index(world.table.keys[row], cell), state[row, cell],
        world.element[row, cell].astype(np.int32), world.planned[row, cell], absent[row, cell],
    )
