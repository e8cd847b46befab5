"""What a station's rays are asked: which bins a small cap of the sky touches, and whether rays meet a cube or end before it."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..evidence.station_index import place, pseudo_azimuth, pseudo_elevation


@njit(cache=True, nogil=True)
def rows_within(elevation: float, radius: float, rows: float, last_row: int) -> tuple[int, int]:
    """Rows that a cap of this radius [rad] may touch; the pseudo elevation never changes faster than the elevation."""
    first = int((elevation - radius + 1.0) * 0.5 * rows)
    last = int((elevation + radius + 1.0) * 0.5 * rows)
    return min(max(first, 0), last_row), min(last, last_row)


@njit(cache=True, nogil=True)
def columns_within(azimuth: float, half: float, columns: int) -> tuple[int, int]:
    """First and last column that azimuths (pseudo, 0 ... 4) within ``half`` may touch; unwrapped, so below 0 too."""
    if half >= 1.0:
        return 0, columns - 1
    first = math.floor((azimuth - half) * 0.25 * columns)
    last = math.floor((azimuth + half) * 0.25 * columns)
    if last - first >= columns:
        return 0, columns - 1
    return first, last


@njit(cache=True, nogil=True, inline="always")
def wrapped(column: int, columns: int) -> int:
    """A column that was counted on across the seam, at most one turn."""
    return column + columns if column < 0 else (column - columns if column >= columns else column)


@njit(cache=True, nogil=True)
def half_azimuth(cosine: float, radius: float) -> float:
    """Upper bound of the half-width in azimuth [rad] of a cap around a direction of this ``cosine`` of the elevation; 4 where
    the cap may hold a pole."""
    if radius * 1.2 >= cosine:
        return 4.0
    ratio = radius / cosine
    return ratio * (1.0 + 0.6 * ratio * ratio)


@njit(cache=True, nogil=True)
def any_farther(
    x: float, y: float, z: float, distance: float, radius: float, nearest: float, rows: float,
    row_start: NDArray[np.int64], farthest: NDArray[np.float32],
) -> bool:
    """Whether any bin that a cap touches holds a ray that is clear beyond ``nearest`` metres."""
    rho = math.sqrt(x * x + y * y)
    first, last = rows_within(pseudo_elevation(rho, z), radius, rows, len(row_start) - 2)
    half = half_azimuth(rho / distance, radius)
    azimuth = pseudo_azimuth(x, y)
    for row in range(first, last + 1):
        base = row_start[row]
        columns = row_start[row + 1] - base
        c0, c1 = columns_within(azimuth, half, columns)
        for c in range(c0, c1 + 1):
            if farthest[base + wrapped(c, columns)] > nearest:
                return True
    return False


@njit(cache=True, nogil=True)
def all_before(
    x: float, y: float, z: float, distance: float, radius: float, half_edge: float, rows: float,
    patch_start: NDArray[np.int64], limit: NDArray[np.float32],
) -> bool:
    """Whether all rays of the patches that a cap touches end before the cube of half-length ``half_edge`` in it."""
    rho = math.sqrt(x * x + y * y)
    first, last = rows_within(pseudo_elevation(rho, z), radius, rows, len(patch_start) - 2)
    half = half_azimuth(rho / distance, radius)
    azimuth = pseudo_azimuth(x, y)
    for row in range(first, last + 1):
        base = patch_start[row]
        wide = patch_start[row + 1] - base
        c0, c1 = columns_within(azimuth, half, wide)
        for c in range(c0, c1 + 1):
            p = base + wrapped(c, wide)
            if depth(p, limit, x, y, z, half_edge) <= limit[p, 3]:
                return False
    return True


@njit(cache=True, nogil=True)
def _meets(ex: float, ey: float, ez: float, x: float, y: float, z: float, half: float) -> bool:
    """Whether the segment from 0 to e meets the cube of half-length ``half`` around (x, y, z): separating axes."""
    ax, ay, az = abs(ex), abs(ey), abs(ez)
    if abs(y * ez - z * ey) > half * (ay + az):
        return False
    if abs(z * ex - x * ez) > half * (az + ax):
        return False
    if abs(x * ey - y * ex) > half * (ax + ay):
        return False
    return (
        abs(0.5 * ex - x) < half + 0.5 * ax and abs(0.5 * ey - y) < half + 0.5 * ay and abs(0.5 * ez - z) < half + 0.5 * az
    )


@njit(cache=True, nogil=True)
def bin_passes(
    b: int, x: float, y: float, z: float, half: float, end: NDArray[np.float32], bin_start: NDArray[np.int32]
) -> bool:
    for i in range(bin_start[b], bin_start[b + 1]):
        ex, ey, ez = place(end, i)
        if _meets(ex, ey, ez, x, y, z, half):
            return True
    return False


@njit(cache=True, nogil=True, inline="always")
def depth(p: int, limit: NDArray[np.float32], x: float, y: float, z: float, half: float) -> float:
    """How far the nearest corner of the cube around (x, y, z) lies along the vector of a patch's limit."""
    nx, ny, nz = limit[p, 0], limit[p, 1], limit[p, 2]
    return nx * x + ny * y + nz * z - half * (abs(nx) + abs(ny) + abs(nz))
