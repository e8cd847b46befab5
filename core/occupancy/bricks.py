"""Bricks by key: a hash table that kernels fill and ask, and the 27 bricks around each."""

from __future__ import annotations

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from .grid import BITS

FREE = -1
_SPREAD = np.uint64(0x9E3779B97F4A7C15)


@njit(cache=True, nogil=True, inline="always")
def _slot(key: int, size: int) -> int:
    mixed = np.uint64(key) * _SPREAD
    return int(np.int64((mixed ^ (mixed >> np.uint64(29))) & np.uint64(size - 1)))


@njit(cache=True, nogil=True)
def find(key: int, slot_key: NDArray[np.int64], slot_row: NDArray[np.int32]) -> int:
    """Row of a key, -1 when it is not in the table."""
    size = len(slot_key)
    at = _slot(key, size)
    while slot_row[at] != FREE:
        if slot_key[at] == key:
            return int(slot_row[at])
        at = (at + 1) & (size - 1)
    return -1


@njit(cache=True, nogil=True)
def insert(key: int, row: int, slot_key: NDArray[np.int64], slot_row: NDArray[np.int32]) -> None:
    """Enter a key that is not in the table yet."""
    size = len(slot_key)
    at = _slot(key, size)
    while slot_row[at] != FREE:
        at = (at + 1) & (size - 1)
    slot_key[at] = key
    slot_row[at] = row


@njit(cache=True, nogil=True)
def _fill(keys: NDArray[np.int64], slot_key: NDArray[np.int64], slot_row: NDArray[np.int32]) -> None:
    for row in range(len(keys)):
        insert(keys[row], row, slot_key, slot_row)


class BrickTable:
    """Keys (N,) and where each is: ``slot_key`` and ``slot_row`` are what kernels take."""

    def __init__(self, keys: NDArray[np.int64], room: int = 0) -> None:
        """``room``: keys that the table shall be able to take."""
        self.keys = keys
        size = 16
        while size < 2 * max(len(keys), room) + 2:
            size *= 2
        self.slot_key = np.zeros(size, np.int64)
        self.slot_row = np.full(size, FREE, np.int32)
        _fill(keys, self.slot_key, self.slot_row)

    def __len__(self) -> int:
        return len(self.keys)

    def around(self, keys: NDArray[np.int64] | None = None) -> NDArray[np.int32]:
        """(N, 27) rows of the bricks around each of ``keys`` (N,), or of the table's own (itself in the middle, 13); -1 where
        there is none."""
        return _around(self.keys if keys is None else keys, self.slot_key, self.slot_row)

    def rows(self, keys: NDArray[np.int64]) -> NDArray[np.int32]:
        """(M,) rows of keys (M,), -1 where a key is not in the table."""
        return _rows(keys, self.slot_key, self.slot_row)


@njit(cache=True, nogil=True, parallel=True)
def _rows(keys: NDArray[np.int64], slot_key: NDArray[np.int64], slot_row: NDArray[np.int32]) -> NDArray[np.int32]:
    out = np.empty(len(keys), np.int32)
    for i in prange(len(keys)):
        out[i] = find(keys[i], slot_key, slot_row)
    return out


@njit(cache=True, nogil=True, parallel=True)
def _around(keys: NDArray[np.int64], slot_key: NDArray[np.int64], slot_row: NDArray[np.int32]) -> NDArray[np.int32]:
    out = np.empty((len(keys), 27), np.int32)
    for row in prange(len(keys)):
        n = 0
        for di in range(-1, 2):
            for dj in range(-1, 2):
                for dk in range(-1, 2):
                    key = keys[row] + (np.int64(di) << (2 * BITS)) + (np.int64(dj) << BITS) + np.int64(dk)
                    out[row, n] = find(key, slot_key, slot_row)
                    n += 1
    return out
