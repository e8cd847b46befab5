"""Planned solids overlap: a column modelled inside a wall, unjoined walls, a wall that runs through a slab.

A voxel's first element is kept for all voxels, further ones only for the few bricks that have any.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..occupancy.bricks import BrickTable
from ..occupancy.grid import CELLS

Layer = tuple[NDArray[np.int64], NDArray[Any]]
"""Brick keys (N,) and one element for each voxel of these bricks (N, 512), -1 for none."""


@dataclass(frozen=True)
class Further:
    """Elements that hold a voxel beside its first one."""

    brick: NDArray[np.int32]
    """(S,) rows of a brick table, ascending; a brick may come more than once."""
    element: NDArray[Any]
    """(S, 512) rows of ``model.elements``; -1 where there is none."""
    first: NDArray[np.int64]
    """(B + 1,) where those of each brick of the table begin."""

    @classmethod
    def of(cls, layers: Sequence[Layer], table: BrickTable, kind: Any) -> Further:
        """From layers of which each holds one more element of a voxel, for the bricks of a table."""
        brick = np.concatenate([np.zeros(0, np.int32), *(table.rows(keys) for keys, _ in layers)])
        element = np.concatenate([np.zeros((0, CELLS), kind), *(of for _, of in layers)])
        order = np.argsort(brick, kind="stable")
        first = np.searchsorted(brick[order], np.arange(len(table) + 1)).astype(np.int64)
        return cls(brick[order], element[order], first)

    def on(self, table: BrickTable, rows: NDArray[np.int32]) -> Further:
        """The same for another table, of which ``rows`` (B,) are this one's bricks."""
        return Further.of([(table.keys[rows[self.brick]], self.element)], table, self.element.dtype)


def divided(
    count: NDArray[np.int64], element: NDArray[Any], further: Further, counted: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """(E,) voxels of each element, of the ``count`` (E,) that it holds, when those that several hold are divided equally.

    ``element`` (B, 512) holds the voxels first. Only elements that are ``counted`` (E,) take a part.
    """
    share = count.astype(np.float64)
    brick, at = np.unique(further.brick, return_inverse=True)
    layers = [(element[brick], np.arange(len(brick))), (further.element, at)]
    holders = np.zeros((len(brick), CELLS), np.int32)
    for who, row in layers:
        np.add.at(holders, row, (who >= 0) & counted[who])
    for who, row in layers:
        of = (who >= 0) & counted[who] & (holders[row] > 1)
        share -= np.bincount(who[of], weights=1.0 - 1.0 / holders[row][of], minlength=len(share))
    return share


@njit(cache=True, nogil=True, inline="always")
def holds(
    who: int, row: int, cell: int, element: NDArray[np.int16], first: NDArray[np.int64], further: NDArray[np.int16]
) -> bool:
    """Whether an element holds a voxel, as its first one or as a further one."""
    found = element[row, cell] == who
    for s in range(first[row], first[row + 1]):
        found |= further[s, cell] == who
    return bool(found)


@njit(cache=True, nogil=True)
def share_one(
    row: int, cell: int, row_b: int, cell_b: int, element: NDArray[np.int16], first: NDArray[np.int64],
    further: NDArray[np.int16],
) -> bool:
    """Whether an element holds both of two voxels, of which the first has one."""
    if holds(element[row, cell], row_b, cell_b, element, first, further):
        return True
    for s in range(first[row], first[row + 1]):
        if further[s, cell] >= 0 and holds(further[s, cell], row_b, cell_b, element, first, further):
            return True
    return False


@njit(cache=True, nogil=True)
def all_in(
    row: int, cell: int, row_b: int, cell_b: int, element: NDArray[np.int16], first: NDArray[np.int64],
    further: NDArray[np.int16],
) -> bool:
    """Whether every element that holds the first of two voxels holds the second one."""
    if not holds(element[row, cell], row_b, cell_b, element, first, further):
        return False
    for s in range(first[row], first[row + 1]):
        if further[s, cell] >= 0 and not holds(further[s, cell], row_b, cell_b, element, first, further):
            return False
    return True
