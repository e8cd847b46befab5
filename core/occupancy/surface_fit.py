"""How far along its ray a return proves that space is empty: up to a guard before the surface that it lies on.

The returns around a direction are fitted with a plane, which in a station's view is linear: m . d = 1 / range for every
direction d. Its normal gives the incidence, so that the guard is a depth below the surface and not a length along the ray.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from ..evidence.station_index import place
from ..parallel import spread
from .ray_tests import wrapped

GUARD_VOXELS = 1.5
"""A ray empties nothing less than this many voxels in front of its surface."""
FLATTEST_COSINE = 0.05
"""Incidence beyond 87 degrees is not told apart."""
EDGE_COSINE = 0.3
"""Assumed where the returns around lie on no plane (edges, plants, wires): a guard of five voxels along the ray."""
FLAT_VOXELS = 0.5
"""Returns lie on a plane when they scatter less than this many voxels about it (root mean square)."""
FEWEST_FITTED = 5
ROWS_AT_ONCE = 8
"""Rows of patches that one thread fits together: the sums of the rows beside them are made twice."""
ROUND_UP = 1.000001
"""Largest values are stored in single precision and must not be less than what they stand for."""
SUMS = 11
"""Of a bin: number; d d^T (xx, xy, xz, yy, yz, zz); d / range (3); 1 / range^2."""


@njit(cache=True, nogil=True, inline="always")
def patch_of(column: int, columns: int, wide: int) -> int:
    """Which of the ``wide`` patches of a row holds the middle of a bin of a row of ``columns``."""
    return (2 * column + 1) * wide // (2 * columns)


@njit(cache=True, nogil=True, inline="always")
def bins_around(patch: int, wide: int, columns: int) -> tuple[int, int]:
    """First and last bin, in a row of ``columns``, of those that one of ``wide`` patches touches, and one on either side;
    unwrapped, but never the same bin twice."""
    first, last = patch * columns // wide - 1, ((patch + 1) * columns - 1) // wide + 1
    if last - first >= columns:
        return 0, columns - 1
    return first, last


def fit_planes(
    point: NDArray[np.float32], start: NDArray[np.int32], row_start: NDArray[np.int64], patch_start: NDArray[np.int64],
    edge: float,
) -> NDArray[np.float32]:
    """(P, 3) planes of the patches where the returns in and one bin around them are flat, NaN elsewhere.

    point (N, 3) returns [m, from the station], sorted into bins, in each bin in an order that does not depend on how they
    were read.
    """
    widest = int(np.diff(row_start).max())
    rows = -(-(len(row_start) - 1) // (len(patch_start) - 1))
    return _fit_rows(point, start, row_start, patch_start, rows, widest, edge)


@njit(cache=True, nogil=True, error_model="numpy")
def _sum_row(
    point: NDArray[np.float32], start: NDArray[np.int32], first: int, last: int, sums: NDArray[np.float64]
) -> None:
    for b in range(first, last):
        xx, xy, xz, yy, yz, zz, bx, by, bz, total = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(start[b], start[b + 1]):
            x, y, z = place(point, i)
            q2 = 1.0 / (x * x + y * y + z * z)
            x2, y2, z2 = x * q2, y * q2, z * q2
            xx += x * x2
            xy += x * y2
            xz += x * z2
            yy += y * y2
            yz += y * z2
            zz += z * z2
            bx += x2
            by += y2
            bz += z2
            total += q2
        at = sums[b - first]
        at[0] = start[b + 1] - start[b]
        at[1], at[2], at[3], at[4], at[5], at[6] = xx, xy, xz, yy, yz, zz
        at[7], at[8], at[9], at[10] = bx, by, bz, total


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
    point: NDArray[np.float32], start: NDArray[np.int32], row_start: NDArray[np.int64], patch_start: NDArray[np.int64],
    high: int, widest: int, edge: float,
) -> NDArray[np.float32]:
    """``high``: rows of bins in a row of patches."""
    plane = np.empty((patch_start[-1], 3), np.float32)
    rows, patch_rows = len(row_start) - 1, len(patch_start) - 1
    blocks = (patch_rows + ROWS_AT_ONCE - 1) // ROWS_AT_ONCE
    stride = spread(blocks)
    for turn in prange(blocks):
        block = turn * stride % blocks
        begin, stop = block * ROWS_AT_ONCE, min((block + 1) * ROWS_AT_ONCE, patch_rows)
        first, last = max(high * begin - 1, 0), min(high * stop + 1, rows)
        sums = np.empty((last - first, widest, SUMS))
        for row in range(first, last):
            _sum_row(point, start, row_start[row], row_start[row + 1], sums[row - first])
        s, m = np.empty(SUMS), np.empty(3)
        for patch_row in range(begin, stop):
            wide = patch_start[patch_row + 1] - patch_start[patch_row]
            for k in range(wide):
                s[:] = 0.0
                for r in range(max(high * patch_row - 1, 0), min(high * (patch_row + 1) + 1, rows)):
                    columns = row_start[r + 1] - row_start[r]
                    low, top = bins_around(k, wide, columns)
                    for c in range(low, top + 1):
                        at = sums[r - first, wrapped(c, columns)]
                        for n in range(SUMS):
                            s[n] += at[n]
                p = patch_start[patch_row] + k
                if _fit(s, FLAT_VOXELS * edge, m):
                    plane[p, 0], plane[p, 1], plane[p, 2] = m[0], m[1], m[2]
                else:
                    plane[p, 0], plane[p, 1], plane[p, 2] = np.nan, np.nan, np.nan
    return plane


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def clear_ends(
    point: NDArray[np.float32], own: NDArray[np.bool_], start: NDArray[np.int32], row_start: NDArray[np.int64],
    patch_start: NDArray[np.int64], edge: float, plane: NDArray[np.float32], end: NDArray[np.float32],
    nearest: NDArray[np.float32], farthest: NDArray[np.float32], longest: NDArray[np.float32],
) -> None:
    """Fill ``end`` (N, 3), the ends of the clear parts of the rays to returns ``point`` (N, 3) [m, from the station].

    Those that are not ``own`` (N,) become 0 (none does when that is empty). Fills, per bin [m]: ``nearest``, how far all its
    rays are clear, ``farthest``, how far any own one is, and ``longest``, the farthest return.
    """
    rows = len(row_start) - 1
    high = (rows + len(patch_start) - 2) // (len(patch_start) - 1)
    stride, guard = spread(rows), GUARD_VOXELS * edge
    for turn in prange(rows):
        row = turn * stride % rows
        base, columns = row_start[row], row_start[row + 1] - row_start[row]
        patches, wide = patch_start[row // high], patch_start[row // high + 1] - patch_start[row // high]
        for c in range(columns):
            b, p = base + c, patches + patch_of(c, columns, wide)
            slope = math.sqrt(float(plane[p, 0]) ** 2 + float(plane[p, 1]) ** 2 + float(plane[p, 2]) ** 2)
            along, least, most = 0.0, guard / EDGE_COSINE, guard / EDGE_COSINE
            if not math.isnan(slope):  # the cosine of the incidence is 1 / (range slope)
                along, least, most = guard * slope, guard, guard / FLATTEST_COSINE
            near, far, last = math.inf, 0.0, 0.0
            for i in range(start[b], start[b + 1]):
                x, y, z = place(point, i)
                reach = math.sqrt(x * x + y * y + z * z)
                free = max(reach - min(max(along * reach, least), most), 0.0)
                near, last = min(near, free), max(last, reach)
                share = free / reach
                if len(own) and not own[i]:
                    share = 0.0
                else:
                    far = max(far, free)
                end[i, 0], end[i, 1], end[i, 2] = x * share, y * share, z * share
            nearest[b], farthest[b], longest[b] = near, far * ROUND_UP, last * ROUND_UP
