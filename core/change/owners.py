"""Elements by voxel while the model's solids are entered, one after the other."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..occupancy.bricks import BrickTable, find, insert
from ..occupancy.grid import CELLS, brick_key, cell_of
from .holders import Layer


class Owners:
    """Elements by voxel while they are entered, one after the other; those that find a voxel taken, in ``over``."""

    def __init__(self, kind: type, elements: int) -> None:
        self.keys = np.empty(0, np.int64)
        self.element: NDArray[Any] = np.empty((0, CELLS), kind)
        self.used = 0
        self.table = BrickTable(self.keys)
        self.over: Owners | None = None
        self.by_surface = np.zeros(elements, np.bool_)
        """Elements that are entered by their surface."""

    def _room(self, bricks: int) -> None:
        wanted = self.used + bricks
        if wanted <= len(self.keys):
            return
        more = max(wanted, len(self.keys) + len(self.keys) // 4) - len(self.keys)
        self.keys = np.concatenate([self.keys, np.empty(more, np.int64)])
        self.element = np.concatenate([self.element, np.full((more, CELLS), -1, self.element.dtype)])
        self.table = BrickTable(self.keys[: self.used], len(self.keys))

    def _next(self) -> Owners:
        if self.over is None:
            self.over = Owners(self.element.dtype.type, 0)
            self.over.by_surface = self.by_surface
        return self.over

    def enter(self, mask: NDArray[np.bool_], first: NDArray[np.int64], row: int) -> int:
        """Give the set voxels of a box (layers, rows, columns) whose corner is ``first`` (x, y, z) to an element, and say
        how many there are. Afterwards only those are set that had another one before."""
        self._room(_bricks_met(mask))
        self.used, found, taken = _enter(
            mask, first[0], first[1], first[2], row, self.table.slot_key, self.table.slot_row, self.keys, self.used,
            self.element,
        )
        if taken:
            self._next().enter(mask, first, row)
        return int(found)

    def enter_surface(self, corner: NDArray[np.float64], row: int, under: Owners | None = None) -> None:
        """Give the voxels in no solid that triangles (T, 3, 3), in voxel units, go through to an element; with ``under``
        only those that another surface holds there."""
        below = under or Owners(self.element.dtype.type, 0)
        at = taken = 0
        while at < len(corner):
            self._room(4096)
            at, self.used, met = _enter_surface(
                corner, at, row, self.table.slot_key, self.table.slot_row, self.keys, self.used, self.element,
                self.by_surface, under is not None, below.table.slot_key, below.table.slot_row, below.element,
            )
            taken += met
        if taken:
            self._next().enter_surface(corner, row, self)

    def layers(self) -> list[Layer]:
        """Bricks by ascending key, and the same for each further element of a voxel."""
        order = np.argsort(self.keys[: self.used])
        own = self.keys[: self.used][order], self.element[: self.used][order]
        return [own, *(self.over.layers() if self.over else [])]


def _bricks_met(mask: NDArray[np.bool_]) -> int:
    """At most so many bricks hold the set voxels of a box."""
    return min(int(np.prod(np.array(mask.shape) // 8 + 2)), int(np.count_nonzero(mask)))


@njit(cache=True, nogil=True)
def _enter(  # type: ignore[no-untyped-def]
    mask, i0, j0, k0, who, slot_key, slot_row, keys, used, element
):
    found = taken = 0
    last, row = -1, -1
    for k in range(mask.shape[0]):
        for j in range(mask.shape[1]):
            for i in range(mask.shape[2]):
                if not mask[k, j, i]:
                    continue
                found += 1
                key = brick_key(i0 + i, j0 + j, k0 + k)
                if key != last:
                    last = key
                    row = find(key, slot_key, slot_row)
                    if row < 0:
                        row = used
                        keys[row] = key
                        insert(key, row, slot_key, slot_row)
                        used += 1
                cell = cell_of(i0 + i, j0 + j, k0 + k)
                if element[row, cell] < 0:
                    element[row, cell] = who
                    mask[k, j, i] = False
                else:
                    taken += 1
    return used, found, taken


@njit(cache=True, nogil=True)
def _enter_surface(  # type: ignore[no-untyped-def]
    corner, at, who, slot_key, slot_row, keys, used, element, by_surface, has_below, below_key, below_row, below
):
    """Points on triangles at most half a voxel apart; stops at the triangle for which the table has no more room."""
    taken = 0
    for t in range(at, len(corner)):
        a, b, c = corner[t, 0], corner[t, 1], corner[t, 2]
        ab, ac, bc = b - a, c - a, c - b
        longest = math.sqrt(max((ab * ab).sum(), (ac * ac).sum(), (bc * bc).sum()))
        steps = int(2.0 * longest) + 2
        for m in range(steps + 1):
            for n in range(steps + 1 - m):
                u, v = m / steps, n / steps
                i = math.floor(a[0] + u * ab[0] + v * ac[0])
                j = math.floor(a[1] + u * ab[1] + v * ac[1])
                k = math.floor(a[2] + u * ab[2] + v * ac[2])
                key, cell = brick_key(i, j, k), cell_of(i, j, k)
                if has_below:
                    row = find(key, below_key, below_row)
                    before = below[row, cell] if row >= 0 else -1
                    if before < 0 or before == who or not by_surface[before]:
                        continue
                row = find(key, slot_key, slot_row)
                if row < 0:
                    if used == len(keys):
                        return t, used, taken
                    row = used
                    keys[row] = key
                    insert(key, row, slot_key, slot_row)
                    used += 1
                before = element[row, cell]
                if before < 0:
                    element[row, cell] = who
                elif before != who and by_surface[before]:
                    taken += 1
    return len(corner), used, taken
