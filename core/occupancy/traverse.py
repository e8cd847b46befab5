"""The exact way: every ray walked voxel by voxel (Amanatides and Woo, 1987). Slow, and what the fast way must equal."""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from .bricks import BrickTable, find
from .grid import brick_key, cell_of


@njit(cache=True, nogil=True, inline="always")
def _first_crossing(start: float, slope: float, cell: int, step: int) -> float:
    if step > 0:
        return (cell + 1 - start) / slope
    if step < 0:
        return (cell - start) / slope
    return math.inf


@njit(cache=True, nogil=True, parallel=True)
def _walk(
    ends: NDArray[np.float32], station: NDArray[np.float64],
    anchor: NDArray[np.float64], edge: float, slot_key: NDArray[np.int64], slot_row: NDArray[np.int32],
    passed: NDArray[np.bool_],
) -> int:
    sx, sy, sz = (station[0] - anchor[0]) / edge, (station[1] - anchor[1]) / edge, (station[2] - anchor[2]) / edge
    steps = 0
    for n in prange(len(ends)):
        gx, gy, gz = float(ends[n, 0]) / edge, float(ends[n, 1]) / edge, float(ends[n, 2]) / edge
        i, j, k = math.floor(sx), math.floor(sy), math.floor(sz)
        di = 1 if gx > 0 else (-1 if gx < 0 else 0)
        dj = 1 if gy > 0 else (-1 if gy < 0 else 0)
        dk = 1 if gz > 0 else (-1 if gz < 0 else 0)
        tx, ty, tz = _first_crossing(sx, gx, i, di), _first_crossing(sy, gy, j, dj), _first_crossing(sz, gz, k, dk)
        wx = 1.0 / abs(gx) if di else math.inf
        wy = 1.0 / abs(gy) if dj else math.inf
        wz = 1.0 / abs(gz) if dk else math.inf
        t = 0.0
        last, row = -1, -1
        while t < 1.0:
            key = brick_key(i, j, k)
            if key != last:
                row = find(key, slot_key, slot_row)
                last = key
            if row >= 0:
                passed[row, cell_of(i, j, k)] = True
            steps += 1
            if tx <= ty and tx <= tz:
                t = tx
                i += di
                tx += wx
            elif ty <= tz:
                t = ty
                j += dj
                ty += wy
            else:
                t = tz
                k += dk
                tz += wz
    return steps


def walk_rays(
    ends: NDArray[np.float32], station: NDArray[np.float64],
    anchor: NDArray[np.float64], edge: float, table: BrickTable, passed: NDArray[np.bool_],
) -> int:
    """Mark in ``passed`` (B, 512) the voxels of the table's bricks that rays go through; returns the steps walked.

    Each ray goes from ``station`` (3,) to its end; ``ends`` (N, 3) [m, from the station].
    """
    return int(_walk(ends, station, anchor, edge, table.slot_key, table.slot_row, passed))
