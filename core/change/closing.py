"""Gone voxels reach up to what still stands: the zone that the guard of rays left undecided is closed.

Rays empty nothing within a voxel and a half of a surface, so a removed wall keeps a seam along floor, ceiling and its remaining
part. Where gone parts at least three voxels thick meet such a seam, it is gone too, unless returns show a surface of the same
element there. Seams along other elements are told by their contact: returns there are those of the neighbour.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from ..occupancy.epoch import OCCUPIED, Observation
from .holders import all_in, share_one
from .results import DISAPPEARED, NOTHING
from .voxels import Universe, deep

STEPS = 4
"""From the middle of a gone part to its border, and three voxels on: the guard at moderate incidence."""
CONTACT = 2
"""Voxels this close to another element may hold that one's returns."""


def close_gone(world: Universe, epoch: Observation, state: NDArray[np.uint8]) -> None:
    """Enter in ``state`` (B, 512) the seams of gone parts as disappeared."""
    gone = (state == DISAPPEARED) & world.planned
    seed = deep(world, gone)
    if not seed.any():
        return
    around = world.table.around()
    near = np.flatnonzero(np.isin(around, np.flatnonzero(seed.any(axis=1))).any(axis=1)).astype(np.int64)
    may = np.zeros(state.shape, np.bool_)
    first, further = world.further.first, world.further.element
    _fillable(near, around, world.element, first, further, world.planned, epoch.state == OCCUPIED, gone, may)
    for _ in range(STEPS):
        more = seed.copy()
        _spread(near, around, world.element, first, further, may, seed, more)
        seed = more
    state[seed & (state != NOTHING)] = DISAPPEARED


@njit(cache=True, nogil=True, inline="always")
def _place(around: NDArray[np.int32], row: int, i: int, j: int, k: int) -> tuple[int, int]:
    return (
        around[row, ((i >> 3) + 1) * 9 + ((j >> 3) + 1) * 3 + (k >> 3) + 1],
        ((i & 7) << 6) | ((j & 7) << 3) | (k & 7),
    )


@njit(cache=True, nogil=True)
def _touches_another(
    around: NDArray[np.int32], element: NDArray[np.int16], first: NDArray[np.int64], further: NDArray[np.int16],
    planned: NDArray[np.bool_], row: int, i: int, j: int, k: int, own: int,
) -> bool:
    """Whether a voxel of a solid that does not hold cell ``own`` of the brick lies within CONTACT of (i, j, k), which may lie
    in the brick beside."""
    for a in range(-CONTACT, CONTACT + 1):
        for b in range(-CONTACT, CONTACT + 1):
            for c in range(-CONTACT, CONTACT + 1):
                there, cell = _place(around, row, i + a, j + b, k + c)
                if there >= 0 and planned[there, cell] and not all_in(there, cell, row, own, element, first, further):
                    return True
    return False


@njit(cache=True, nogil=True, parallel=True)
def _fillable(
    near: NDArray[np.int64], around: NDArray[np.int32], element: NDArray[np.int16], first: NDArray[np.int64],
    further: NDArray[np.int16], planned: NDArray[np.bool_], occupied: NDArray[np.bool_], gone: NDArray[np.bool_],
    may: NDArray[np.bool_],
) -> None:
    for n in prange(len(near)):
        row = near[n]
        for cell in range(512):
            if not planned[row, cell]:
                continue
            if gone[row, cell]:
                may[row, cell] = True
                continue
            i, j, k = cell >> 6, (cell >> 3) & 7, cell & 7
            free = True
            for a in range(-1, 2):
                for b in range(-1, 2):
                    for c in range(-1, 2):
                        there, other = _place(around, row, i + a, j + b, k + c)
                        if free and there >= 0 and occupied[there, other] and (
                            element[there, other] < 0 or share_one(row, cell, there, other, element, first, further)
                        ):
                            free = _touches_another(
                                around, element, first, further, planned, row, i + a, j + b, k + c, cell
                            )
            may[row, cell] = free


@njit(cache=True, nogil=True, parallel=True)
def _spread(
    near: NDArray[np.int64], around: NDArray[np.int32], element: NDArray[np.int16], first: NDArray[np.int64],
    further: NDArray[np.int16], may: NDArray[np.bool_], seed: NDArray[np.bool_], out: NDArray[np.bool_],
) -> None:
    for n in prange(len(near)):
        row = near[n]
        for cell in range(512):
            if seed[row, cell] or not may[row, cell]:
                continue
            i, j, k = cell >> 6, (cell >> 3) & 7, cell & 7
            for step in range(6):
                d = 1 if step & 1 else -1
                there, other = _place(
                    around, row, i + d * (step >> 1 == 0), j + d * (step >> 1 == 1), k + d * (step >> 1 == 2)
                )
                if there >= 0 and seed[there, other] and all_in(row, cell, there, other, element, first, further):
                    out[row, cell] = True
                    break
