"""How far along its ray a return proves that space is empty: up to a guard before the surface that it lies on.

The returns around a direction are fitted with a plane, which in a station's view is linear: m . d = 1 / range for every
direction d. Its normal gives the incidence, so that the guard is a depth below the surface and not a length along the ray.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

GUARD_VOXELS = 1.5
"""A ray empties nothing less than this many voxels in front of its surface."""
FLATTEST_COSINE = 0.05
"""Incidence beyond 87 degrees is not told apart."""
EDGE_COSINE = 0.3
"""Assumed where the returns around lie on no plane (edges, plants, wires): a guard of five voxels along the ray."""
FLAT_VOXELS = 0.5
"""Returns lie on a plane when they scatter less than this many voxels about it (root mean square)."""
FEWEST_FITTED = 5
ROWS_AT_ONCE = 16
"""Rows that one thread fits together: the sums of the rows beside them are made twice."""
ROUND_UP = 1.000001
"""Largest values are stored in single precision and must not be less than what they stand for."""
SUMS = 11
"""Of a bin: number; d d^T (xx, xy, xz, yy, yz, zz); d / range (3); 1 / range^2."""


def fit_planes(
    point: NDArray[np.float32], start: NDArray[np.int32], row_start: NDArray[np.int64], edge: float,
    plane: NDArray[np.float32],
) -> None:
    """Fill ``plane`` (B, 3) of the bins whose surroundings (3 x 3 bins) are flat.

    point (N, 3) returns [m, from the station], sorted into bins, in each bin in an order that does not depend on how they
    were read.
    """
    widest = int(np.diff(row_start).max())
    _fit_rows(point, start, row_start, widest, edge, plane)


@njit(cache=True, nogil=True)
def _sum_row(
    point: NDArray[np.float32], start: NDArray[np.int32], first: int, last: int, sums: NDArray[np.float64]
) -> None:
    for b in range(first, last):
        at = sums[b - first]
        at[:] = 0.0
        for i in range(start[b], start[b + 1]):
            x, y, z = float(point[i, 0]), float(point[i, 1]), float(point[i, 2])
            q2 = 1.0 / (x * x + y * y + z * z)
            at[0] += 1.0
            at[1] += x * x * q2
            at[2] += x * y * q2
            at[3] += x * z * q2
            at[4] += y * y * q2
            at[5] += y * z * q2
            at[6] += z * z * q2
            at[7] += x * q2
            at[8] += y * q2
            at[9] += z * q2
            at[10] += q2


@njit(cache=True, nogil=True)
def _join_three(sums: NDArray[np.float64], columns: int, wide: NDArray[np.float64]) -> None:
    """Sums of each bin of a row and of those left and right of it; rows wrap around."""
    for c in range(columns):
        left, right = (c - 1 if c > 0 else columns - 1), (c + 1 if c < columns - 1 else 0)
        for n in range(SUMS):
            wide[c, n] = sums[left, n] + sums[c, n] + sums[right, n]


@njit(cache=True, nogil=True, inline="always")
def _gather(
    row: int, column: int, row_start: NDArray[np.int64], first_row: int, wide: NDArray[np.float64],
    s: NDArray[np.float64],
) -> None:
    """Sum of the 3 x 3 bins around a bin, of which three each are joined already."""
    middle = (column + 0.5) / (row_start[row + 1] - row_start[row])
    s[:] = 0.0
    for r in range(max(row - 1, 0), min(row + 2, len(row_start) - 1)):
        c = column if r == row else int(middle * (row_start[r + 1] - row_start[r]))
        for n in range(SUMS):
            s[n] += wide[r - first_row, c, n]


@njit(cache=True, nogil=True)
def _fit(s: NDArray[np.float64], flat: float, m: NDArray[np.float64]) -> bool:
    """Plane m of returns with these sums; False when they lie on none.

    Least squares of m . d = 1 / range, in a basis along and across the mean direction: the directions lie close together, so
    the part along it is eliminated first.
    """
    n = s[0]
    if n < FEWEST_FITTED:
        return False
    b0, b1, b2 = s[7], s[8], s[9]  # for directions this close, d / range points along the mean direction
    length = math.sqrt(b0 * b0 + b1 * b1 + b2 * b2)
    if length <= 0.0:
        return False
    ex, ey, ez = b0 / length, b1 / length, b2 / length
    if abs(ez) < 0.9:
        k = 1.0 / math.sqrt(ex * ex + ey * ey)
        ux, uy, uz = -ey * k, ex * k, 0.0
    else:
        k = 1.0 / math.sqrt(ey * ey + ez * ez)
        ux, uy, uz = 0.0, -ez * k, ey * k
    wx, wy, wz = ey * uz - ez * uy, ez * ux - ex * uz, ex * uy - ey * ux
    aex, aey, aez = s[1] * ex + s[2] * ey + s[3] * ez, s[2] * ex + s[4] * ey + s[5] * ez, s[3] * ex + s[5] * ey + s[6] * ez
    aux, auy, auz = s[1] * ux + s[2] * uy + s[3] * uz, s[2] * ux + s[4] * uy + s[5] * uz, s[3] * ux + s[5] * uy + s[6] * uz
    awx, awy, awz = s[1] * wx + s[2] * wy + s[3] * wz, s[2] * wx + s[4] * wy + s[5] * wz, s[3] * wx + s[5] * wy + s[6] * wz
    see = ex * aex + ey * aey + ez * aez
    seu = ex * aux + ey * auy + ez * auz
    sew = ex * awx + ey * awy + ez * awz
    suu = ux * aux + uy * auy + uz * auz - seu * seu / see
    suw = ux * awx + uy * awy + uz * awz - seu * sew / see
    sww = wx * awx + wy * awy + wz * awz - sew * sew / see
    det = suu * sww - suw * suw
    if suu <= 0.0 or sww <= 0.0 or det <= 1e-4 * suu * sww:
        return False
    bu, bw = -seu * length / see, -sew * length / see  # b has no part across the mean direction
    cu, cw = (bu * sww - bw * suw) / det, (bw * suu - bu * suw) / det
    ce = (length - seu * cu - sew * cw) / see
    slope = math.sqrt(ce * ce + cu * cu + cw * cw)
    if ce <= 0.0:
        return False
    # the residuals are of 1 / range; across the surface they are range^2 times as large, less the cosine 1 / (range slope)
    scatter = math.sqrt(max(s[10] - ce * length, 0.0) / n) * math.sqrt(n / s[10]) / slope
    if scatter > flat:
        return False
    m[0] = ce * ex + cu * ux + cw * wx
    m[1] = ce * ey + cu * uy + cw * wy
    m[2] = ce * ez + cu * uz + cw * wz
    return True


@njit(cache=True, nogil=True, parallel=True)
def _fit_rows(
    point: NDArray[np.float32], start: NDArray[np.int32], row_start: NDArray[np.int64], widest: int, edge: float,
    plane: NDArray[np.float32],
) -> None:
    rows = len(row_start) - 1
    for block in prange((rows + ROWS_AT_ONCE - 1) // ROWS_AT_ONCE):
        begin, end = block * ROWS_AT_ONCE, min((block + 1) * ROWS_AT_ONCE, rows)
        first, last = max(begin - 1, 0), min(end + 1, rows)
        sums, wide = np.empty((widest, SUMS)), np.empty((last - first, widest, SUMS))
        for row in range(first, last):
            _sum_row(point, start, row_start[row], row_start[row + 1], sums)
            _join_three(sums, row_start[row + 1] - row_start[row], wide[row - first])
        s, m = np.empty(SUMS), np.empty(3)
        for row in range(begin, end):
            for column in range(row_start[row + 1] - row_start[row]):
                b = row_start[row] + column
                if start[b] == start[b + 1]:
                    continue
                _gather(row, column, row_start, first, wide, s)
                if _fit(s, FLAT_VOXELS * edge, m):
                    plane[b, 0], plane[b, 1], plane[b, 2] = m[0], m[1], m[2]


@njit(cache=True, nogil=True, parallel=True)
def clear_ends(
    point: NDArray[np.float32], own: NDArray[np.bool_], start: NDArray[np.int32], edge: float, plane: NDArray[np.float32],
    nearest: NDArray[np.float32], farthest: NDArray[np.float32], longest: NDArray[np.float32],
) -> None:
    """Turn returns ``point`` (N, 3) [m, from the station] into the ends of their rays' clear parts.

    Those that are not ``own`` (N,) become 0 (none does when that is empty). Fills, per bin [m]: ``nearest``, how far all its
    rays are clear, ``farthest``, how far any own one is, and ``longest``, the farthest return.
    """
    for b in prange(len(start) - 1):
        slope = math.sqrt(float(plane[b, 0]) ** 2.0 + float(plane[b, 1]) ** 2.0 + float(plane[b, 2]) ** 2.0)
        near, far, last = math.inf, 0.0, 0.0
        for i in range(start[b], start[b + 1]):
            x, y, z = float(point[i, 0]), float(point[i, 1]), float(point[i, 2])
            reach = math.sqrt(x * x + y * y + z * z)
            cosine = EDGE_COSINE
            if not math.isnan(slope):
                cosine = min(max(1.0 / (reach * slope), FLATTEST_COSINE), 1.0)
            free = max(reach - GUARD_VOXELS * edge / cosine, 0.0)
            near, last = min(near, free), max(last, reach)
            share = free / reach
            if len(own) and not own[i]:
                share = 0.0
            else:
                far = max(far, free)
            point[i, 0], point[i, 1], point[i, 2] = x * share, y * share, z * share
        nearest[b], farthest[b], longest[b] = near, far * ROUND_UP, last * ROUND_UP
