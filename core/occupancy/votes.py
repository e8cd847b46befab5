"""Returns vote for the voxels they lie in; enough votes make a voxel occupied."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .bricks import BrickTable, find, insert
from .grid import CELLS, VoxelGrid, brick_key, cell_of

VOTE = 16
"""Votes are kept in sixteenths of a return, so that their sum depends on no order."""
MOST = 65_535
EXPECTED_SHARE = 0.5
"""A surface counts as found in a voxel when half of the returns came that one seen head-on would send back: the rest may
be lost to incidence and to the surface's course through the voxel."""


@njit(cache=True, nogil=True)
def _vote(
    offsets: NDArray[np.float64], begin: int, own: NDArray[np.bool_], station: NDArray[np.float64],
    anchor: NDArray[np.float64], edge: float, spacing_rad: float, least: int,
    slot_key: NDArray[np.int64], slot_row: NDArray[np.int32], keys: NDArray[np.int64], used: int,
    votes: NDArray[np.uint16], returns: NDArray[np.uint8],
) -> tuple[int, int]:
    """Enter returns from ``begin`` on; stops early when the table is full. Returns (next return, bricks used)."""
    last_key, last_row = -1, -1
    sx, sy, sz = station[0] - anchor[0], station[1] - anchor[1], station[2] - anchor[2]
    expected = EXPECTED_SHARE * edge * edge / (spacing_rad * spacing_rad)
    weight = np.empty(least + 1, np.int64)
    for wanted in range(1, least + 1):
        weight[wanted] = (VOTE * least) // wanted
    for n in range(begin, len(offsets)):
        if len(own) and not own[n]:
            continue
        x, y, z = offsets[n, 0], offsets[n, 1], offsets[n, 2]
        i, j, k = math.floor((x + sx) / edge), math.floor((y + sy) / edge), math.floor((z + sz) / edge)
        key = brick_key(i, j, k)
        if key != last_key:
            row = find(key, slot_key, slot_row)
            if row < 0:
                if used == len(keys):
                    return n, used
                row = used
                keys[row] = key
                insert(key, row, slot_key, slot_row)
                used += 1
            last_key, last_row = key, row
        wanted = int(min(max(expected / (x * x + y * y + z * z) + 0.5, 1.0), least))
        cell = cell_of(i, j, k)
        votes[last_row, cell] = min(int(votes[last_row, cell]) + weight[wanted], MOST)
        returns[last_row, cell] = min(int(returns[last_row, cell]) + 1, 255)
    return len(offsets), used


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
        self, offsets: NDArray[np.float64], station: NDArray[np.float64], spacing_rad: float,
        own: NDArray[np.bool_] | None = None,
    ) -> None:
        """Enter returns (N, 3) [m, from the station] of a ``station`` (3,) [m, local frame]; only the ``own`` (N,) ones."""
        mine = np.zeros(0, np.bool_) if own is None else own
        at = 0
        while True:
            at, self._used = _vote(
                offsets, at, mine, station, self.grid.anchor, self.grid.edge, spacing_rad, self.least,
                self._table.slot_key, self._table.slot_row, self._keys, self._used, self._votes, self._returns,
            )
            if at == len(offsets):
                return
            self._grow()

    def occupied(self) -> Occupied:
        """The occupied voxels so far."""
        order = np.argsort(self._keys[: self._used])
        need = self.least * VOTE
        keys = self._keys[: self._used][order]
        cells = np.zeros((len(keys), CELLS), np.bool_)
        sparse = 0
        for begin in range(0, len(keys), 4096):
            rows = order[begin : begin + 4096]
            part = self._votes[rows] >= need
            sparse += int((part & (self._returns[rows] < self.least)).sum())
            cells[begin : begin + 4096] = part
        full = cells.any(axis=1)
        return Occupied(BrickTable(keys[full]), cells[full], sparse)


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
