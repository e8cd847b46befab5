"""The fast way: each voxel asks each station which of its rays pass.

A voxel seen from a station is a small patch of sky; the rays that could pass it lie in the few bins of the station's index
that the patch touches, sorted already. So no ray is walked: voxels that nobody asks about cost nothing, and the first ray
that passes settles a voxel. The question put to a ray is the exact one, whether its clear part meets the voxel's cube.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from ..evidence.station_index import StationIndex, pseudo_azimuth, pseudo_elevation
from .clear_range import ClearRange
from .grid import CELLS, brick_corner

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


@njit(cache=True, nogil=True, inline="always")
def _rows_within(x: float, y: float, z: float, radius: float, rows: int) -> tuple[int, int]:
    """Rows that a cap of this radius [rad] may touch; the pseudo elevation never changes faster than the elevation."""
    p = pseudo_elevation(math.sqrt(x * x + y * y), z)
    first = int((p - radius + 1.0) * 0.5 * rows)
    last = int((p + radius + 1.0) * 0.5 * rows)
    return max(first, 0), min(last, rows - 1)


@njit(cache=True, nogil=True, inline="always")
def _columns_within(azimuth: float, half: float, columns: int) -> tuple[int, int]:
    """First and last column that azimuths (pseudo, 0 ... 4) within ``half`` may touch; unwrapped, so below 0 too."""
    if half >= 1.0:
        return 0, columns - 1
    first = math.floor((azimuth - half) * 0.25 * columns)
    last = math.floor((azimuth + half) * 0.25 * columns)
    if last - first >= columns:
        return 0, columns - 1
    return first, last


@njit(cache=True, nogil=True, inline="always")
def _half_azimuth(x: float, y: float, distance: float, radius: float) -> float:
    """Upper bound of a cap's half-width in azimuth [rad]; 4 where it may hold a pole."""
    cosine = math.sqrt(x * x + y * y) / distance
    if radius * 1.2 >= cosine:
        return 4.0
    ratio = radius / cosine
    return ratio * (1.0 + 0.6 * ratio * ratio)


@njit(cache=True, nogil=True, inline="always")
def _meets(
    px: float, py: float, pz: float, end: float, x: float, y: float, z: float, half: float
) -> bool:
    """Whether the segment from 0 to ``end`` of the way to p meets the cube of half-length ``half`` around (x, y, z)."""
    low, high = 0.0, end
    for axis in range(3):
        p = px if axis == 0 else (py if axis == 1 else pz)
        c = x if axis == 0 else (y if axis == 1 else z)
        if p == 0.0:
            if abs(c) > half:
                return False
            continue
        a, b = (c - half) / p, (c + half) / p
        if a > b:
            a, b = b, a
        low, high = max(low, a), min(high, b)
    return low < high


@njit(cache=True, nogil=True)
def _any_farther(
    x: float, y: float, z: float, distance: float, radius: float, nearest: float, row_start: NDArray[np.int64],
    farthest: NDArray[np.float32],
) -> bool:
    """Whether any bin that a cap touches holds a ray that is clear beyond ``nearest`` metres."""
    rows = len(row_start) - 1
    first, last = _rows_within(x, y, z, radius, rows)
    half = _half_azimuth(x, y, distance, radius)
    azimuth = pseudo_azimuth(x, y)
    for row in range(first, last + 1):
        base = row_start[row]
        columns = row_start[row + 1] - base
        c0, c1 = _columns_within(azimuth, half, columns)
        for c in range(c0, c1 + 1):
            if farthest[base + c % columns] > nearest:
                return True
    return False


@njit(cache=True, nogil=True)
def _look(
    x: float, y: float, z: float, edge: float, returns: NDArray[np.float64], bin_start: NDArray[np.int64],
    row_start: NDArray[np.int64], spacing_rad: float, share: NDArray[np.float32], farthest: NDArray[np.float32],
    longest: NDArray[np.float32], plane: NDArray[np.float32],
) -> int:
    """What one station says of the voxel around (x, y, z) [m, from the station]."""
    rows = len(row_start) - 1
    distance = math.sqrt(x * x + y * y + z * z)
    half_diagonal = CORNER * edge
    if distance <= 2.0 * half_diagonal:
        return PASSED
    near = distance - half_diagonal
    radius = 1.02 * half_diagonal / near
    sparse = spacing_rad * distance > SPARSE_SPACING * edge
    around = AROUND_SPACINGS * spacing_rad
    reach = max(radius, around) if sparse else radius
    first, last = _rows_within(x, y, z, reach, rows)
    half = _half_azimuth(x, y, distance, reach)
    azimuth = pseudo_azimuth(x, y)
    seen, beyond, hides = 0, 0, False
    closest, closest_bin = 10.0, -1
    row = min(max(int((pseudo_elevation(math.sqrt(x * x + y * y), z) + 1.0) * 0.5 * rows), 0), rows - 1)
    columns = row_start[row + 1] - row_start[row]
    b = row_start[row] + min(int(azimuth * 0.25 * columns), columns - 1)
    if farthest[b] > near:  # most voxels in free space are settled by the rays right at their middle
        for i in range(bin_start[b], bin_start[b + 1]):
            if _meets(returns[i, 0], returns[i, 1], returns[i, 2], share[i], x, y, z, 0.5 * edge):
                return PASSED
    for row in range(first, last + 1):
        base = row_start[row]
        columns = row_start[row + 1] - base
        c0, c1 = _columns_within(azimuth, half, columns)
        for c in range(c0, c1 + 1):
            b = base + c % columns
            if (longest[b] if sparse else farthest[b]) <= near:
                hides |= longest[b] > 0.0
                continue
            for i in range(bin_start[b], bin_start[b + 1]):
                px, py, pz = returns[i, 0], returns[i, 1], returns[i, 2]
                cx, cy, cz = y * pz - z * py, z * px - x * pz, x * py - y * px
                p2 = px * px + py * py + pz * pz
                off2 = cx * cx + cy * cy + cz * cz
                ahead = x * px + y * py + z * pz > 0.0
                if not ahead:
                    continue
                if off2 <= half_diagonal * half_diagonal * p2 and _meets(
                    px, py, pz, share[i], x, y, z, 0.5 * edge
                ):
                    return PASSED
                if sparse:
                    angle2 = off2 / (p2 * distance * distance)
                    if angle2 <= around * around:
                        seen += 1
                        if share[i] * math.sqrt(p2) > distance + half_diagonal:
                            beyond += 1
                    if angle2 < closest:
                        closest, closest_bin = angle2, b
    if not sparse:
        return 0
    if seen >= FEWEST_AROUND and beyond == seen and not hides:
        return BETWEEN
    if closest_bin >= 0 and closest <= around * around and not math.isnan(plane[closest_bin, 0]):
        m0, m1, m2 = plane[closest_bin, 0], plane[closest_bin, 1], plane[closest_bin, 2]
        behind = (1.0 - (m0 * x + m1 * y + m2 * z)) / math.sqrt(m0 * m0 + m1 * m1 + m2 * m2)
        if abs(behind) <= half_diagonal:
            return SURFACE
    return 0


@njit(cache=True, nogil=True, parallel=True)
def _label(
    keys: NDArray[np.int64], wanted: NDArray[np.bool_], station: NDArray[np.float64], anchor: NDArray[np.float64],
    edge: float, sector: NDArray[np.float64], returns: NDArray[np.float64], bin_start: NDArray[np.int64],
    row_start: NDArray[np.int64], spacing_rad: float, share: NDArray[np.float32], farthest: NDArray[np.float32],
    longest: NDArray[np.float32], plane: NDArray[np.float32], labels: NDArray[np.uint8],
) -> None:
    for row in prange(len(keys)):
        i0, j0, k0 = brick_corner(keys[row])
        ox = anchor[0] + edge * i0 - station[0]
        oy = anchor[1] + edge * j0 - station[1]
        oz = anchor[2] + edge * k0 - station[2]
        mx, my, mz = ox + 4.0 * edge, oy + 4.0 * edge, oz + 4.0 * edge
        distance = math.sqrt(mx * mx + my * my + mz * mz)
        size = 8.0 * CORNER * edge
        dense = spacing_rad * (distance + size) <= SPARSE_SPACING * edge
        around = 0.0 if dense else AROUND_SPACINGS * spacing_rad
        limit = farthest if dense else longest
        if distance > 2.0 * size:
            radius = 1.02 * size / (distance - size) + around
            if not _any_farther(mx, my, mz, distance, radius, distance - size, row_start, limit):
                continue
        hidden = 0
        if distance > 2.0 * size:
            radius = 1.02 * 0.5 * size / (distance - size) + around
            for part in range(8):
                x = ox + edge * (2.0 + 4.0 * (part >> 2))
                y = oy + edge * (2.0 + 4.0 * ((part >> 1) & 1))
                z = oz + edge * (2.0 + 4.0 * (part & 1))
                away = math.sqrt(x * x + y * y + z * z)
                if not _any_farther(x, y, z, away, radius, away - 0.5 * size, row_start, limit):
                    hidden |= 1 << part
        for cell in range(CELLS):
            if not wanted[row, cell] or labels[row, cell] & PASSED:
                continue
            if hidden >> (((cell >> 8) & 1) << 2 | ((cell >> 5) & 1) << 1 | ((cell >> 2) & 1)) & 1:
                continue
            x = ox + edge * ((cell >> 6) + 0.5)
            y = oy + edge * (((cell >> 3) & 7) + 0.5)
            z = oz + edge * ((cell & 7) + 0.5)
            if sector[1] - sector[0] < 2.0 * math.pi:
                azimuth = math.atan2(y, x) % (2.0 * math.pi)
                if azimuth < sector[0] or azimuth >= sector[1]:
                    continue
            labels[row, cell] |= np.uint8(_look(
                x, y, z, edge, returns, bin_start, row_start, spacing_rad, share, farthest, longest, plane
            ))


def label_voxels(
    keys: NDArray[np.int64], wanted: NDArray[np.bool_], station: NDArray[np.float64], anchor: NDArray[np.float64],
    edge: float, index: StationIndex, clear: ClearRange, labels: NDArray[np.uint8],
    sector: NDArray[np.float64] | None = None,
) -> None:
    """Add to ``labels`` (B, 512) what a ``station`` (3,) says of the ``wanted`` (B, 512) voxels of bricks ``keys`` (B,).

    ``sector`` (2,) limits it to voxels in an azimuth range [rad], when the index holds one tile of the station only.
    """
    whole = np.array([0.0, 2.0 * math.pi + 1e-9])
    _label(
        keys, wanted, station, anchor, edge, whole if sector is None else sector, index.returns, index.bin_start,
        index.row_start, index.spacing_rad, clear.share, clear.farthest, clear.longest, clear.plane,
        labels,
    )
