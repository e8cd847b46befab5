"""Returns vote for the voxels they lie in; enough votes make a voxel occupied."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numba import get_num_threads, njit, prange
from numpy.typing import NDArray

from ..evidence.station_index import place
from .bricks import BrickTable, find, insert
from .grid import CELLS, VoxelGrid, brick_key, cell_of

VOTE = 16
"""Votes are kept in sixteenths of a return, so that their sum depends on no order."""
MOST = 65_535
AT_ONCE = 1 << 19
"""Returns entered at once: what is noted of each of them stays small."""
RUN = 1 << 13
EXPECTED_SHARE = 0.5
"""A surface counts as found in a voxel when half of the returns came that one seen head-on would send back: the rest may
be lost to incidence and to the surface's course through the voxel."""


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def _place(
    offsets: NDArray[np.float32], own: NDArray[np.bool_], station: NDArray[np.float64], anchor: NDArray[np.float64],
    edge: float, expected: float, least: int, slot_key: NDArray[np.int64], slot_row: NDArray[np.int32],
    key: NDArray[np.int64], row: NDArray[np.int32], cell: NDArray[np.int16], weight: NDArray[np.int32],
) -> None:
    """Brick (its key, -1 for another tile's return, and its row, -1 where there is none yet), cell and weight of each return.

    Returns sorted by direction come in long runs of one brick.
    """
    sx, sy, sz = station[0] - anchor[0], station[1] - anchor[1], station[2] - anchor[2]
    for run in prange((len(offsets) + RUN - 1) // RUN):
        last_key, last_row = -1, -1
        for n in range(run * RUN, min((run + 1) * RUN, len(offsets))):
            if len(own) and not own[n]:
                key[n], row[n] = -1, -1
                continue
            x, y, z = place(offsets, n)
            i, j, k = math.floor((x + sx) / edge), math.floor((y + sy) / edge), math.floor((z + sz) / edge)
            here = brick_key(i, j, k)
            if here != last_key:
                last_key, last_row = here, find(here, slot_key, slot_row)
            key[n], row[n], cell[n] = here, last_row, cell_of(i, j, k)
            wanted = int(min(max(expected / (x * x + y * y + z * z) + 0.5, 1.0), least))
            weight[n] = (VOTE * least) // wanted


@njit(cache=True, nogil=True)
def _enter_new(
    key: NDArray[np.int64], begin: int, slot_key: NDArray[np.int64], slot_row: NDArray[np.int32], keys: NDArray[np.int64],
    used: int, row: NDArray[np.int32],
) -> tuple[int, int]:
    """Enter the bricks that are not in the table yet, from return ``begin`` on; stops when the table is full.

    Returns (next return, bricks used).
    """
    for n in range(begin, len(key)):
        if row[n] < 0 <= key[n]:
            there = find(key[n], slot_key, slot_row)
            if there < 0:
                if used == len(keys):
                    return n, used
                there = used
                keys[used] = key[n]
                insert(key[n], there, slot_key, slot_row)
                used += 1
            row[n] = there
    return len(key), used


@njit(cache=True, nogil=True, parallel=True)
def _vote(
    row: NDArray[np.int32], cell: NDArray[np.int16], weight: NDArray[np.int32], parts: int, votes: NDArray[np.uint16],
    returns: NDArray[np.uint8],
) -> None:
    """Enter returns; each part of the work has bricks of its own, so that no two add to one voxel at once."""
    for part in prange(parts):
        last, mine = np.int32(-1), False
        for n in range(len(row)):
            r = row[n]
            if r != last:
                last, mine = r, r >= 0 and r % parts == part
            if mine:
                c = cell[n]
                votes[r, c] = min(int(votes[r, c]) + weight[n], MOST)
                returns[r, c] = min(int(returns[r, c]) + 1, 255)


@njit(cache=True, nogil=True, parallel=True)
def _conclude(
    order: NDArray[np.int64], votes: NDArray[np.uint16], returns: NDArray[np.uint8], need: int, least: int,
    cells: NDArray[np.bool_], sparse: NDArray[np.int64],
) -> None:
    for n in prange(len(order)):
        row = order[n]
        for cell in range(CELLS):
            cells[n, cell] = votes[row, cell] >= need
            sparse[n] += cells[n, cell] and returns[row, cell] < least


@dataclass
class Votes:
    """Votes of an epoch's returns, brick by brick.

    A voxel is occupied with ``least`` returns; where the scan is so sparse that a surface would send fewer back, with half
    of those expected, at least one: each return then carries that many votes more.
    """

    grid: VoxelGrid
    least: int
    _keys: NDArray[np.int64] = field(default_factory=lambda: np.empty(1024, np.int64))
    _votes: NDArray[np.uint16] = field(default_factory=lambda: np.zeros((1024, CELLS), np.uint16))
    _returns: NDArray[np.uint8] = field(default_factory=lambda: np.zeros((1024, CELLS), np.uint8))
    _used: int = 0

    def __post_init__(self) -> None:
        self._table = BrickTable(np.empty(0, np.int64), len(self._keys))

    def _grow(self) -> None:
        rows = len(self._keys) + len(self._keys) // 2 + 1024
        for array in (self._keys, self._votes, self._returns):  # in place where the system can, and zero beyond
            array.resize((rows, *array.shape[1:]), refcheck=False)
        self._table = BrickTable(self._keys[: self._used].copy(), len(self._keys))

    def add(
        self, offsets: NDArray[np.float32], station: NDArray[np.float64], spacing_rad: float,
        own: NDArray[np.bool_] | None = None,
    ) -> None:
        """Enter returns (N, 3) [m, from the station] of a ``station`` (3,) [m, local frame]; only the ``own`` (N,) ones."""
        for begin in range(0, len(offsets), AT_ONCE):
            part = slice(begin, begin + AT_ONCE)
            self._add(offsets[part], station, spacing_rad, np.zeros(0, np.bool_) if own is None else own[part])

    def _add(
        self, offsets: NDArray[np.float32], station: NDArray[np.float64], spacing_rad: float, own: NDArray[np.bool_]
    ) -> None:
        count, edge = len(offsets), self.grid.edge
        key, row = np.empty(count, np.int64), np.empty(count, np.int32)
        cell, weight = np.empty(count, np.int16), np.empty(count, np.int32)
        expected = EXPECTED_SHARE * edge * edge / (spacing_rad * spacing_rad)
        _place(
            offsets, own, station, self.grid.anchor, edge, expected, self.least, self._table.slot_key, self._table.slot_row,
            key, row, cell, weight,
        )
        at = 0
        while True:
            at, self._used = _enter_new(key, at, self._table.slot_key, self._table.slot_row, self._keys, self._used, row)
            if at == count:
                break
            self._grow()
        _vote(row, cell, weight, get_num_threads(), self._votes, self._returns)

    def occupied(self) -> Occupied:
        """The occupied voxels so far."""
        order = np.argsort(self._keys[: self._used])
        keys = self._keys[: self._used][order]
        cells, sparse = np.zeros((len(keys), CELLS), np.bool_), np.zeros(len(keys), np.int64)
        _conclude(order, self._votes, self._returns, self.least * VOTE, self.least, cells, sparse)
        full = cells.any(axis=1)
        return Occupied(BrickTable(keys[full]), cells[full], int(sparse.sum()))


@dataclass(frozen=True)
class Occupied:
    """The occupied voxels of an epoch: bricks by ascending key."""

    table: BrickTable
    cells: NDArray[np.bool_]
    """(B, 512)"""
    sparse: int
    """How many of them have fewer returns than the threshold, because a surface there sends so few back."""

    @property
    def count(self) -> int:
        return int(self.cells.sum())
