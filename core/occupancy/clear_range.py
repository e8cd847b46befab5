"""How far along its ray a return proves that space is empty: up to a guard before the surface that it lies on.

The returns around a direction are fitted with a plane, which in a station's view is linear: m . d = 1 / range for every
direction d. Its normal gives the incidence, so that the guard is a depth below the surface and not a length along the ray.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from ..evidence.station_index import StationIndex

GUARD_VOXELS = 1.5
"""A ray empties nothing less than this many voxels in front of its surface."""
FLATTEST_COSINE = 0.05
"""Incidence beyond 87 degrees is not told apart."""
EDGE_COSINE = 0.3
"""Assumed where the returns around lie on no plane (edges, plants, wires): a guard of five voxels along the ray."""
FLAT_VOXELS = 0.5
"""Returns lie on a plane when they scatter less than this many voxels about it (root mean square)."""
MOST_FITTED = 36


@dataclass(frozen=True)
class ClearRange:
    """Of one station's returns, in the order of its index."""

    share: NDArray[np.float32]
    """(N,) of the way to the return that its ray proves empty, 0 ... 1."""
    farthest: NDArray[np.float32]
    """(B,) metres, the farthest that any ray of a bin proves empty; 0 for an empty bin."""
    longest: NDArray[np.float32]
    """(B,) metres, the farthest return of a bin; 0 for an empty bin."""
    plane: NDArray[np.float32]
    """(B, 3) m of the plane that the returns around lie on [1/m]; NaN where they lie on none."""


def clear_range(index: StationIndex, edge: float) -> ClearRange:
    """Clear ranges of all returns of a station for voxels of ``edge`` metres.

    The returns of each bin of the index are put in an order of their own first, so that the order in which they were read
    changes no digit of a fit.
    """
    _settle_order(index.returns, index.bin_start)
    bins = len(index.bin_start) - 1
    plane = np.full((bins, 3), np.nan, np.float32)
    share = np.zeros(len(index.returns), np.float32)
    farthest, longest = np.zeros(bins, np.float32), np.zeros(bins, np.float32)
    row_of = np.repeat(np.arange(index.rows), np.diff(index.row_start)).astype(np.int32)
    _clear(index.returns, index.bin_start, index.row_start, row_of, edge, plane, share, farthest, longest)
    return ClearRange(share, farthest, longest, plane)


@njit(cache=True, nogil=True, inline="always")
def _before(returns: NDArray[np.float64], i: int, x: float, y: float, z: float) -> bool:
    if returns[i, 0] != x:
        return returns[i, 0] < x
    if returns[i, 1] != y:
        return returns[i, 1] < y
    return returns[i, 2] < z


@njit(cache=True, nogil=True, parallel=True)
def _settle_order(returns: NDArray[np.float64], bin_start: NDArray[np.int64]) -> None:
    for b in prange(len(bin_start) - 1):
        begin, end = bin_start[b], bin_start[b + 1]
        gap = (end - begin) // 2
        while gap > 0:  # Shell sort: most bins hold a few returns, one at a pole may hold thousands
            for i in range(begin + gap, end):
                x, y, z = returns[i, 0], returns[i, 1], returns[i, 2]
                j = i
                while j >= begin + gap and not _before(returns, j - gap, x, y, z):
                    returns[j] = returns[j - gap]
                    j -= gap
                returns[j, 0], returns[j, 1], returns[j, 2] = x, y, z
            gap //= 2


@njit(cache=True, nogil=True, inline="always")
def _neighbours(
    bin_number: int, row: int, row_start: NDArray[np.int64], bin_start: NDArray[np.int64], runs: NDArray[np.int64]
) -> int:
    """Runs of returns in the bins around a bin, as pairs in ``runs``; how many pairs."""
    rows = len(row_start) - 1
    columns = row_start[row + 1] - row_start[row]
    column = bin_number - row_start[row]
    middle = (column + 0.5) / columns
    n = 0
    for r in range(max(row - 1, 0), min(row + 2, rows)):
        there = row_start[r + 1] - row_start[r]
        c = column if r == row else int(middle * there)
        if there <= 3:
            runs[2 * n], runs[2 * n + 1] = bin_start[row_start[r]], bin_start[row_start[r + 1]]
            n += 1
            continue
        first, last = c - 1, c + 1
        if first < 0:
            runs[2 * n], runs[2 * n + 1] = bin_start[row_start[r + 1] - 1], bin_start[row_start[r + 1]]
            n += 1
            first = 0
        if last >= there:
            runs[2 * n], runs[2 * n + 1] = bin_start[row_start[r]], bin_start[row_start[r] + 1]
            n += 1
            last = there - 1
        runs[2 * n], runs[2 * n + 1] = bin_start[row_start[r] + first], bin_start[row_start[r] + last + 1]
        n += 1
    return n


@njit(cache=True, nogil=True)
def _fit(
    returns: NDArray[np.float64], runs: NDArray[np.int64], count: int, own: NDArray[np.float64], flat: float,
    m: NDArray[np.float64],
) -> bool:
    """Plane m of the returns in the runs, seen around the direction of ``own``; False when they lie on none."""
    total = 0
    for n in range(count):
        total += runs[2 * n + 1] - runs[2 * n]
    if total < 5:
        return False
    step = max((total + MOST_FITTED - 1) // MOST_FITTED, 1)
    r0 = math.sqrt(own[0] ** 2 + own[1] ** 2 + own[2] ** 2)
    e = own / r0
    u = np.array([-e[1], e[0], 0.0]) if abs(e[2]) < 0.9 else np.array([0.0, -e[2], e[1]])
    u /= math.sqrt(u[0] ** 2 + u[1] ** 2 + u[2] ** 2)
    w = np.array([e[1] * u[2] - e[2] * u[1], e[2] * u[0] - e[0] * u[2], e[0] * u[1] - e[1] * u[0]])
    s1 = s2 = s11 = s12 = s22 = sy = s1y = s2y = syy = 0.0
    used = 0
    k = 0
    for n in range(count):
        for i in range(runs[2 * n], runs[2 * n + 1]):
            k += 1
            if k % step:
                continue
            x, y, z = returns[i, 0], returns[i, 1], returns[i, 2]
            along = x * e[0] + y * e[1] + z * e[2]
            if along <= 0.0:
                continue
            a = (x * u[0] + y * u[1] + z * u[2]) / along
            b = (x * w[0] + y * w[1] + z * w[2]) / along
            v = r0 / along - 1.0
            used += 1
            s1 += a
            s2 += b
            s11 += a * a
            s12 += a * b
            s22 += b * b
            sy += v
            s1y += a * v
            s2y += b * v
            syy += v * v
    if used < 5:
        return False
    s11 -= s1 * s1 / used
    s12 -= s1 * s2 / used
    s22 -= s2 * s2 / used
    s1y -= s1 * sy / used
    s2y -= s2 * sy / used
    syy -= sy * sy / used
    det = s11 * s22 - s12 * s12
    if det <= 1e-4 * s11 * s22 or det <= 0.0:
        return False
    ca = (s1y * s22 - s2y * s12) / det
    cb = (s2y * s11 - s1y * s12) / det
    c0 = 1.0 + (sy - ca * s1 - cb * s2) / used
    length = math.sqrt(c0 * c0 + ca * ca + cb * cb)
    # the residuals are of range / r0; along the normal they shrink with the cosine of the incidence, 1 / length
    rms = math.sqrt(max(syy - ca * s1y - cb * s2y, 0.0) / used) * r0 / length
    if rms > flat or c0 <= 0.0:
        return False
    for axis in range(3):
        m[axis] = (c0 * e[axis] + ca * u[axis] + cb * w[axis]) / r0
    return True


@njit(cache=True, nogil=True, parallel=True)
def _clear(
    returns: NDArray[np.float64], bin_start: NDArray[np.int64], row_start: NDArray[np.int64],
    row_of: NDArray[np.int32], edge: float, plane: NDArray[np.float32], share: NDArray[np.float32],
    farthest: NDArray[np.float32], longest: NDArray[np.float32],
) -> None:
    for b in prange(len(bin_start) - 1):
        begin, end = bin_start[b], bin_start[b + 1]
        if begin == end:
            continue
        runs = np.empty(24, np.int64)
        m = np.empty(3)
        count = _neighbours(b, row_of[b], row_start, bin_start, runs)
        flat = _fit(returns, runs, count, returns[(begin + end) // 2], FLAT_VOXELS * edge, m)
        slope = 0.0
        if flat:
            slope = math.sqrt(m[0] * m[0] + m[1] * m[1] + m[2] * m[2])
            for axis in range(3):
                plane[b, axis] = m[axis]
        best, last = 0.0, 0.0
        for i in range(begin, end):
            x, y, z = returns[i, 0], returns[i, 1], returns[i, 2]
            reach = math.sqrt(x * x + y * y + z * z)
            cosine = EDGE_COSINE
            if flat:
                cosine = min(max(1.0 / (reach * slope), FLATTEST_COSINE), 1.0)
            free = max(reach - GUARD_VOXELS * edge / cosine, 0.0)
            share[i] = free / reach
            best, last = max(best, free), max(last, reach)
        farthest[b], longest[b] = best * 1.000001, last * 1.000001
