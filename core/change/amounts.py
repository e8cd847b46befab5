"""How much of each element's solid stands now, and how much of that stood in the reference, counted in voxels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..occupancy.epoch import OCCUPIED, Observation
from ..occupancy.grid import CELLS
from .results import DISAPPEARED
from .voxels import Universe, deep

FOUND_DENSITY = 0.5
"""A part was found when it shows this many occupied voxels for its volume, against the part that stayed: views differ."""


@dataclass(frozen=True)
class Amount:
    """Shares of one element's planned voxels. What nobody saw counts as standing here."""

    absent: float = 0.0
    """Known not to stand now."""
    left: float = 0.0
    """Of these, what is not known to have been absent in the reference: it stood then."""
    came: float = 0.0
    """Absent in the reference, and found now: all of it where its surface was found half as densely as that of the part that
    stayed (nothing shows how much of it is in view), else less in proportion."""
    kept: float = 1.0
    """Absent neither then nor now."""
    deep: float = 0.0
    """Absent now, in parts at least three voxels thick."""
    deep_then: float = 0.0
    """The same, in the reference."""


@dataclass(frozen=True)
class Absent:
    """Planned voxels that are known not to stand in an epoch."""

    cells: NDArray[np.bool_]
    """(B, 512)"""
    deep: NDArray[np.bool_]
    """(B, 512) of these, in parts at least three voxels thick."""

    @classmethod
    def of(cls, world: Universe, state: NDArray[np.uint8]) -> Absent:
        """From the states (B, 512) of the epoch against the model."""
        cells = (state == DISAPPEARED) & world.planned
        return cls(cells, deep(world, cells))


def amounts(
    world: Universe, now: Absent, then: Absent | None, epoch: Observation, elements: int
) -> list[Amount | None]:
    """One for each element, None where no voxel is planned; ``then`` of the reference, None without one."""
    count = np.zeros((elements, 32), np.int64)
    nothing = np.zeros(now.cells.shape, np.bool_)
    was, was_deep = (nothing, nothing) if then is None else (then.cells, then.deep)
    rows = np.arange(len(world.element), dtype=np.int32)
    for of, bricks in ((world.element, rows), (world.further.element, world.further.brick)):
        _count(of, bricks, world.planned, now.cells, now.deep, was, was_deep, epoch.state == OCCUPIED, count)
    code = np.arange(32)
    n, d, t, e, s = ((code >> bit & 1).astype(bool) for bit in range(5))
    planned, gone, left, returned, kept, thick, thick_then, seen_new, seen_kept = (
        count[:, of].sum(axis=1).astype(np.float64)
        for of in (code >= 0, n, n & ~t, t & ~n, ~n & ~t, d, e, t & ~n & s, ~n & ~t & s)
    )
    usual = FOUND_DENSITY * seen_kept / np.maximum(kept, 1.0)
    came = np.minimum(returned, np.where(usual > 0, seen_new / np.maximum(usual, 1e-12), returned * (seen_new > 0)))
    return [
        Amount(*(float(v[row] / planned[row]) for v in (gone, left, came, kept, thick, thick_then)))
        if planned[row] else None
        for row in range(elements)
    ]


@njit(cache=True, nogil=True)
def _count(
    element: NDArray[np.int16], brick: NDArray[np.int32], planned: NDArray[np.bool_], now: NDArray[np.bool_],
    deep_now: NDArray[np.bool_], then: NDArray[np.bool_], deep_then: NDArray[np.bool_], surface: NDArray[np.bool_],
    out: NDArray[np.int64],
) -> None:
    """Planned voxels of each element by the five flags, the first one the lowest bit; ``element`` (N, 512) of bricks (N,)."""
    for n in range(len(element)):
        row = brick[n]
        for cell in range(CELLS):
            if planned[row, cell] and element[n, cell] >= 0:
                out[element[n, cell], (
                    now[row, cell] | deep_now[row, cell] << 1 | then[row, cell] << 2 | deep_then[row, cell] << 3
                    | surface[row, cell] << 4
                )] += 1
