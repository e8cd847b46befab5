"""The fast way: each voxel asks each station which of its rays pass.

A voxel seen from a station is a small patch of sky; the rays that could pass it lie in the few bins that the patch touches.
So no ray is walked: voxels that nobody asks about cost nothing, bricks and their eighths behind a surface are told by a few
coarse bins, bins of which all rays end before the voxel by the plane that bounds them, and the first ray that passes settles
a voxel. The question put to a ray is the exact one, whether its clear part meets the voxel's cube.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from ..evidence.station_index import pseudo_azimuth, pseudo_elevation
from .grid import CELLS, brick_corner
from .station_rays import StationRays

PASSED = 1
"""A ray passes through the voxel."""
BETWEEN = 2
"""No ray meets the voxel, but all rays around it pass beyond: rays lie farther apart than voxels there."""
SURFACE = 4
"""Rays lie farther apart than voxels, and the plane of the returns around goes through the voxel."""
CORNER = math.sqrt(3.0) / 2.0
"""Half a voxel's diagonal, in edges: the worst shift of a point from its voxel's middle."""
AROUND_SPACINGS = 1.1
"""Rays this close around a direction enclose it (a square grid of rays leaves 0.71 spacings at most)."""
FEWEST_AROUND = 3
SPARSE_SPACING = 0.5
"""Rays farther apart than this many voxels may miss some (the shortest way through a voxel's middle section)."""


@njit(cache=True, nogil=True)
def _rows_within(elevation: float, radius: float, rows: float, last_row: int) -> tuple[int, int]:
    """Rows that a cap of this radius [rad] may touch; the pseudo elevation never changes faster than the elevation."""
    first = int((elevation - radius + 1.0) * 0.5 * rows)
    last = int((elevation + radius + 1.0) * 0.5 * rows)
    return min(max(first, 0), last_row), min(last, last_row)


@njit(cache=True, nogil=True)
def _columns_within(azimuth: float, half: float, columns: int) -> tuple[int, int]:
    """First and last column that azimuths (pseudo, 0 ... 4) within ``half`` may touch; unwrapped, so below 0 too."""
    if half >= 1.0:
        return 0, columns - 1
    first = math.floor((azimuth - half) * 0.25 * columns)
    last = math.floor((azimuth + half) * 0.25 * columns)
    if last - first >= columns:
        return 0, columns - 1
    return first, last


@njit(cache=True, nogil=True)
def _half_azimuth(cosine: float, radius: float) -> float:
    """Upper bound of the half-width in azimuth [rad] of a cap around a direction of this ``cosine`` of the elevation; 4 where
    the cap may hold a pole."""
    if radius * 1.2 >= cosine:
        return 4.0
    ratio = radius / cosine
    return ratio * (1.0 + 0.6 * ratio * ratio)


@njit(cache=True, nogil=True)
def _any_farther(
    x: float, y: float, z: float, distance: float, radius: float, nearest: float, rows: float,
    row_start: NDArray[np.int64], farthest: NDArray[np.float32],
) -> bool:
    """Whether any bin that a cap touches holds a ray that is clear beyond ``nearest`` metres."""
    rho = math.sqrt(x * x + y * y)
    first, last = _rows_within(pseudo_elevation(rho, z), radius, rows, len(row_start) - 2)
    half = _half_azimuth(rho / distance, radius)
    azimuth = pseudo_azimuth(x, y)
    for row in range(first, last + 1):
        base = row_start[row]
        columns = row_start[row + 1] - base
        c0, c1 = _columns_within(azimuth, half, columns)
        for c in range(c0, c1 + 1):
            if farthest[base + (c + columns if c < 0 else (c - columns if c >= columns else c))] > nearest:
                return True
    return False


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
def _bin_passes(
    b: int, x: float, y: float, z: float, half: float, end: NDArray[np.float32], bin_start: NDArray[np.int32]
) -> bool:
    for i in range(bin_start[b], bin_start[b + 1]):
        if _meets(float(end[i, 0]), float(end[i, 1]), float(end[i, 2]), x, y, z, half):
            return True
    return False


@njit(cache=True, nogil=True)
def _depth(b: int, bound: NDArray[np.float32], x: float, y: float, z: float, half: float) -> float:
    """How far the nearest corner of the cube around (x, y, z) lies along the vector of a bin's bound."""
    nx, ny, nz = float(bound[b, 0]), float(bound[b, 1]), float(bound[b, 2])
    return nx * x + ny * y + nz * z - half * (abs(nx) + abs(ny) + abs(nz))


@njit(cache=True, nogil=True)
def _passed(
    x: float, y: float, z: float, edge: float, radius: float, half: float, elevation: float, azimuth: float, own: int,
    columns: int, end: NDArray[np.float32], bin_start: NDArray[np.int32], rows: float, row_start: NDArray[np.int64],
    bound: NDArray[np.float32],
) -> bool:
    """Whether a ray's clear part meets the voxel around (x, y, z), whose middle lies in bin ``own`` of a row of ``columns``.

    The voxel lies in a cap of ``radius`` [rad] with this ``half`` width in azimuth [rad].
    """
    half_edge = 0.5 * edge
    depth = _depth(own, bound, x, y, z, half_edge)
    if depth > bound[own, 4] and radius * 0.5 * rows <= 1.0 and half * 0.26 * columns <= 1.0:
        return False  # most voxels behind a surface
    if depth <= bound[own, 3] and _bin_passes(own, x, y, z, half_edge, end, bin_start):
        return True  # most voxels in free space
    first, last = _rows_within(elevation, radius, rows, len(row_start) - 2)
    for row in range(first, last + 1):
        base = row_start[row]
        columns = row_start[row + 1] - base
        c0, c1 = _columns_within(azimuth, half, columns)
        for c in range(c0, c1 + 1):
            b = base + (c + columns if c < 0 else (c - columns if c >= columns else c))
            if b != own and _depth(b, bound, x, y, z, half_edge) <= bound[b, 3] and _bin_passes(
                b, x, y, z, half_edge, end, bin_start
            ):
                return True
    return False


@njit(cache=True, nogil=True)
def _between(
    x: float, y: float, z: float, distance: float, edge: float, elevation: float, azimuth: float, cosine: float, own: int,
    spacing_rad: float, bin_start: NDArray[np.int32], rows: float, row_start: NDArray[np.int64],
    nearest: NDArray[np.float32], plane: NDArray[np.float32],
) -> int:
    """BETWEEN, SURFACE or neither, for a voxel that no ray meets and where rays lie farther apart than voxels."""
    half_diagonal = CORNER * edge
    around = AROUND_SPACINGS * spacing_rad
    first, last = _rows_within(elevation, around, rows, len(row_start) - 2)
    half = _half_azimuth(cosine, around)
    seen, beyond = 0, True
    for row in range(first, last + 1):
        base = row_start[row]
        columns = row_start[row + 1] - base
        c0, c1 = _columns_within(azimuth, half, columns)
        for c in range(c0, c1 + 1):
            b = base + (c + columns if c < 0 else (c - columns if c >= columns else c))
            seen += bin_start[b + 1] - bin_start[b]
            beyond &= nearest[b] > distance + half_diagonal
    if seen >= FEWEST_AROUND and beyond:
        return BETWEEN
    m0, m1, m2 = plane[own, 0], plane[own, 1], plane[own, 2]
    if not math.isnan(m0):
        behind = (1.0 - (m0 * x + m1 * y + m2 * z)) / math.sqrt(m0 * m0 + m1 * m1 + m2 * m2)
        if abs(behind) <= half_diagonal:
            return SURFACE
    return 0


@njit(cache=True, nogil=True, parallel=True)
def _label(
    keys: NDArray[np.int64], wanted: NDArray[np.bool_], station: NDArray[np.float64], anchor: NDArray[np.float64],
    edge: float, sector: NDArray[np.float64], spacing_rad: float,
    end: NDArray[np.float32], bin_start: NDArray[np.int32], rows: float, row_start: NDArray[np.int64],
    bound: NDArray[np.float32], nearest: NDArray[np.float32], longest: NDArray[np.float32], plane: NDArray[np.float32],
    coarse_rows: float, coarse_start: NDArray[np.int64], coarse_farthest: NDArray[np.float32],
    coarse_longest: NDArray[np.float32], labels: NDArray[np.uint8],
) -> None:
    for row in prange(len(keys)):
        if not wanted[row].any():
            continue
        i0, j0, k0 = brick_corner(keys[row])
        ox = anchor[0] + edge * i0 - station[0]
        oy = anchor[1] + edge * j0 - station[1]
        oz = anchor[2] + edge * k0 - station[2]
        mx, my, mz = ox + 4.0 * edge, oy + 4.0 * edge, oz + 4.0 * edge
        distance = math.sqrt(mx * mx + my * my + mz * mz)
        size = 8.0 * CORNER * edge
        dense = spacing_rad * (distance + size) <= SPARSE_SPACING * edge
        around = 0.0 if dense else AROUND_SPACINGS * spacing_rad
        limit = coarse_farthest if dense else coarse_longest
        hidden = 0
        far = distance > 8.0 * size  # then the cap of any of its voxels serves all
        cap = 1.02 * CORNER * edge / max(distance - size - CORNER * edge, edge)
        cap_half = _half_azimuth((math.sqrt(mx * mx + my * my) - size) / (distance + size), cap)
        if distance > 2.0 * size:
            radius = max(1.02 * size / (distance - size), around)
            if not _any_farther(mx, my, mz, distance, radius, distance - size, coarse_rows, coarse_start, limit):
                continue
            radius = max(1.02 * 0.5 * size / (distance - size), around)
            for part in range(8):
                x = ox + edge * (2.0 + 4.0 * (part >> 2))
                y = oy + edge * (2.0 + 4.0 * ((part >> 1) & 1))
                z = oz + edge * (2.0 + 4.0 * (part & 1))
                away = math.sqrt(x * x + y * y + z * z)
                if not _any_farther(x, y, z, away, radius, away - 0.5 * size, coarse_rows, coarse_start, limit):
                    hidden |= 1 << part
        for cell in range(CELLS):
            if not wanted[row, cell] or labels[row, cell] & PASSED:
                continue
            if hidden >> (((cell >> 8) & 1) << 2 | ((cell >> 5) & 1) << 1 | ((cell >> 2) & 1)) & 1:
                continue
            x = ox + edge * ((cell >> 6) + 0.5)
            y = oy + edge * (((cell >> 3) & 7) + 0.5)
            z = oz + edge * ((cell & 7) + 0.5)
            square = x * x + y * y
            rho = math.sqrt(square)
            if not far:
                distance = math.sqrt(square + z * z)
                if distance <= 2.0 * CORNER * edge:
                    labels[row, cell] |= PASSED
                    continue
                cap = 1.02 * CORNER * edge / (distance - CORNER * edge)
                cap_half = _half_azimuth(rho / distance, cap)
            elevation, azimuth = pseudo_elevation(rho, z), pseudo_azimuth(x, y)
            r = min(max(int((elevation + 1.0) * 0.5 * rows), 0), len(row_start) - 2)
            columns = row_start[r + 1] - row_start[r]
            own = row_start[r] + min(int(azimuth * 0.25 * columns), columns - 1)
            if _passed(
                x, y, z, edge, cap, cap_half, elevation, azimuth, own, columns, end, bin_start, rows, row_start, bound
            ):
                labels[row, cell] |= PASSED
                continue
            distance = math.sqrt(square + z * z)
            if spacing_rad * distance > SPARSE_SPACING * edge and longest[own] > distance - CORNER * edge:
                if sector[1] - sector[0] < 2.0 * math.pi:
                    angle = math.atan2(y, x) % (2.0 * math.pi)
                    if angle < sector[0] or angle >= sector[1]:
                        continue
                labels[row, cell] |= np.uint8(_between(
                    x, y, z, distance, edge, elevation, azimuth, rho / distance, own, spacing_rad, bin_start, rows,
                    row_start, nearest, plane,
                ))


def label_voxels(
    keys: NDArray[np.int64], wanted: NDArray[np.bool_], station: NDArray[np.float64], anchor: NDArray[np.float64],
    edge: float, rays: StationRays, labels: NDArray[np.uint8], sector: NDArray[np.float64] | None = None,
) -> None:
    """Add to ``labels`` (B, 512) what a ``station`` (3,) says of the ``wanted`` (B, 512) voxels of bricks ``keys`` (B,).

    ``sector`` (2,) is the azimuth range [rad] whose rays lie all round their voxels, when the rays are a tile of the station:
    only voxels in it are told from what lies between rays.
    """
    whole = np.array([0.0, 2.0 * math.pi + 1e-9])
    _label(
        keys, wanted, station, anchor, edge, whole if sector is None else sector, rays.spacing_rad, rays.end,
        rays.bin_start, rays.bins.rows, rays.bins.row_start, rays.bound, rays.nearest, rays.longest, rays.plane,
        rays.coarse.rows, rays.coarse.row_start, rays.coarse_farthest, rays.coarse_longest, labels,
    )
