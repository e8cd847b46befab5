"""Returns vote for the voxels they lie in; enough votes make a voxel occupied."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numba import get_num_threads, njit, prange
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..evidence.station_index import place
from ..options import MOST_MIN_POINTS
from .bricks import BrickTable, find, insert
from .grid import CELLS, VoxelGrid, brick_key, cell_of

VOTE = 16
"""Votes are kept in sixteenths of a return, so that their sum depends on no order."""
AT_ONCE = 1 << 19
"""Returns entered at once: what is noted of each of them stays small."""
RUN = 1 << 13
FIRST_BRICKS = 1 << 16
"""Room at the beginning; a system gives memory when it is written."""
EXPECTED_SHARE = 0.5
"""A surface counts as found in a voxel when half of the returns came that one seen head-on would send back: the rest may
be lost to incidence and to the surface's course through the voxel."""
OTHERS = -1
"""Row of a return that another tile answers for. A brick that has no row yet is -2, -3, ...: the first, second, ... of its
run's new ones."""


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def _place(
    offsets: NDArray[np.float32], own: NDArray[np.bool_], station: NDArray[np.float64], anchor: NDArray[np.float64],
    edge: float, expected: float, least: int, slot_key: NDArray[np.int64], slot_row: NDArray[np.int32],
    row: NDArray[np.int32], cell: NDArray[np.int16], weight: NDArray[np.int32], new: NDArray[np.int64],
    news: NDArray[np.int64], bounds: NDArray[np.float64],
) -> None:
    """Row of its brick, cell and weight of each return; ``new``, from the beginning of each run on, the keys of the
    ``news`` bricks that have no row yet. Returns outside of ``bounds`` (2, 3) [m, from the anchor] have none.

    Returns sorted by direction come in long runs of one brick.
    """
    sx, sy, sz = station[0] - anchor[0], station[1] - anchor[1], station[2] - anchor[2]
    per_metre, full = 1.0 / edge, VOTE * least
    dense = expected / (least - 0.5)
    for run in prange(len(news)):
        last_key, last_row, unknown = -1, -1, 0
        for n in range(run * RUN, min((run + 1) * RUN, len(offsets))):
            if len(own) and not own[n]:
                row[n] = OTHERS
                continue
            x, y, z = place(offsets, n)
            if not (
                bounds[0, 0] <= x + sx <= bounds[1, 0] and bounds[0, 1] <= y + sy <= bounds[1, 1]
                and bounds[0, 2] <= z + sz <= bounds[1, 2]
            ):
                row[n] = OTHERS
                continue
            i, j, k = math.floor((x + sx) * per_metre), math.floor((y + sy) * per_metre), math.floor((z + sz) * per_metre)
            here = brick_key(i, j, k)
            if here != last_key:
                last_key, last_row = here, find(here, slot_key, slot_row)
                if last_row < 0:
                    new[run * RUN + unknown] = here
                    last_row = OTHERS - 1 - unknown
                    unknown += 1
            row[n], cell[n] = last_row, cell_of(i, j, k)
            range2 = x * x + y * y + z * z
            weight[n] = VOTE if range2 <= dense else -(-full // int(max(expected / range2 + 0.5, 1.0)))
        news[run] = unknown


@njit(cache=True, nogil=True)
def _enter_new(
    new: NDArray[np.int64], news: NDArray[np.int64], run: int, slot_key: NDArray[np.int64], slot_row: NDArray[np.int32],
    keys: NDArray[np.int64], used: int, new_row: NDArray[np.int32],
) -> tuple[int, int]:
    """Enter the bricks that are not in the table yet, from ``run`` on; stops before a run that may overfill the table.

    Returns (next run, bricks used).
    """
    while run < len(news):
        if used + news[run] > len(keys):
            return run, used
        for n in range(run * RUN, run * RUN + news[run]):
            there = find(new[n], slot_key, slot_row)
            if there < 0:
                there = used
                keys[used] = new[n]
                insert(new[n], there, slot_key, slot_row)
                used += 1
            new_row[n] = there
        run += 1
    return run, used


@njit(cache=True, nogil=True, parallel=True)
def _vote(
    row: NDArray[np.int32], cell: NDArray[np.int16], weight: NDArray[np.int32], new_row: NDArray[np.int32], parts: int,
    least: int, bits: int, tally: NDArray[np.unsignedinteger[Any]],
) -> None:
    """Enter returns; each part of the work has bricks of its own, so that no two add to one voxel at once."""
    need, mask = VOTE * least, (1 << bits) - 1
    enough = need << bits | least
    for part in prange(parts):
        for begin in range(0, len(row), RUN):
            last, r, mine = OTHERS, OTHERS, False
            for n in range(begin, min(begin + RUN, len(row))):
                if row[n] != last:
                    last = r = row[n]
                    if r < OTHERS:
                        r = new_row[begin + OTHERS - 1 - r]
                    mine = r >= 0 and r % parts == part
                if mine:
                    t = int(tally[r, cell[n]])
                    if t != enough:
                        tally[r, cell[n]] = min((t >> bits) + weight[n], need) << bits | min((t & mask) + 1, least)


@njit(cache=True, nogil=True, parallel=True)
def _full(order: NDArray[np.int64], tally: NDArray[np.unsignedinteger[Any]], need: int) -> NDArray[np.bool_]:
    """(B,) bricks with a voxel that reaches ``need``."""
    full = np.zeros(len(order), np.bool_)
    for n in prange(len(order)):
        some = False
        for cell in range(CELLS):
            some |= tally[order[n], cell] >= need
        full[n] = some
    return full


@njit(cache=True, nogil=True, parallel=True)
def _conclude(
    order: NDArray[np.int64], tally: NDArray[np.unsignedinteger[Any]], need: int, mask: int, least: int,
    cells: NDArray[np.bool_], sparse: NDArray[np.int64],
) -> None:
    """Fill (B, 512) the occupied voxels, and (B,) how many of them have fewer returns than ``least``."""
    for n in prange(len(order)):
        few = 0
        for cell in range(CELLS):
            t = tally[order[n], cell]
            cells[n, cell] = t >= need
            few += (t >= need) & ((t & mask) < least)
        sparse[n] = few


@dataclass
class Votes:
    """Votes of an epoch's returns, brick by brick.

    A voxel is occupied with ``least`` returns; where the scan is so sparse that a surface would send fewer back, with half
    of those expected, at least one: each return then carries that many votes more.
    """

    grid: VoxelGrid
    least: int
    within: NDArray[np.float64] | None = None
    """(2, 3) returns outside of this box have no vote [m, local frame]: a street seen through a window would fill bricks."""
    _keys: NDArray[np.int64] = field(default_factory=lambda: np.empty(FIRST_BRICKS, np.int64))
    _used: int = 0

    def __post_init__(self) -> None:
        if not 1 <= self.least <= MOST_MIN_POINTS:
            raise BimVerifyError(f"A voxel can ask for 1 to {MOST_MIN_POINTS} returns, not {self.least}.")
        self._bounds = np.array([[-np.inf] * 3, [np.inf] * 3]) if self.within is None else self.within - self.grid.anchor
        self._bits = int(self.least).bit_length()
        small = (VOTE * self.least) << self._bits < 1 << 16
        self._tally: NDArray[np.unsignedinteger[Any]] = np.empty((len(self._keys), CELLS), np.uint16 if small else np.uint32)
        """Of each voxel its votes, and in the lower ``_bits`` its returns; of neither more than are asked for. Cleared when a
        brick is entered: numpy's empty memory has large pages where the system offers them, its zeros have not."""
        self._table = BrickTable(np.empty(0, np.int64), len(self._keys))

    def _grow(self) -> None:
        keys, tally, used = self._keys, self._tally, self._used
        self._keys = np.empty(len(keys) + len(keys) // 2, np.int64)
        self._tally = np.empty((len(self._keys), CELLS), tally.dtype)
        self._keys[:used], self._tally[:used] = keys[:used], tally[:used]
        self._table = BrickTable(self._keys[:used].copy(), len(self._keys))

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
        row, cell, weight = np.empty(count, np.int32), np.empty(count, np.int16), np.empty(count, np.int32)
        new, new_row = np.empty(count, np.int64), np.empty(count, np.int32)
        news = np.empty(-(-count // RUN), np.int64)
        expected = EXPECTED_SHARE * edge * edge / (spacing_rad * spacing_rad)
        _place(
            offsets, own, station, self.grid.anchor, edge, expected, self.least, self._table.slot_key, self._table.slot_row,
            row, cell, weight, new, news, self._bounds,
        )
        run = 0
        while True:
            known = self._used
            run, self._used = _enter_new(
                new, news, run, self._table.slot_key, self._table.slot_row, self._keys, known, new_row
            )
            self._tally[known : self._used] = 0
            if run == len(news):
                break
            self._grow()
        _vote(row, cell, weight, new_row, get_num_threads(), self.least, self._bits, self._tally)

    def occupied(self) -> Occupied:
        """The occupied voxels so far."""
        order = np.argsort(self._keys[: self._used])
        need = (VOTE * self.least) << self._bits
        order = order[_full(order, self._tally, need)]
        cells, sparse = np.empty((len(order), CELLS), np.bool_), np.empty(len(order), np.int64)
        _conclude(order, self._tally, need, (1 << self._bits) - 1, self.least, cells, sparse)
        return Occupied(BrickTable(self._keys[order]), cells, int(sparse.sum()))


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
