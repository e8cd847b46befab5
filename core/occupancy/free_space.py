"""The fast way: each voxel asks each station which of its rays pass.

A voxel seen from a station is a small patch of sky; the rays that could pass it lie in the few bins that the patch touches.
So no ray is walked: voxels that nobody asks about cost nothing, bricks and their eighths behind a surface are told by a few
coarse bins, bins of which all rays end before the voxel by the plane that bounds them, and the first ray that passes settles
a voxel. The question put to a ray is the exact one, whether its clear part meets the voxel's cube.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from ..evidence.station_index import pseudo_azimuth, pseudo_elevation
from ..parallel import spread
from .grid import CELLS, SIDE, brick_corner
from .ray_tests import all_before, any_farther, bin_passes, columns_within, depth, half_azimuth, rows_within, wrapped
from .station_rays import PATCH, StationRays
from .surface_fit import patch_of

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
BRICKS_AT_ONCE = 64
LOWER = np.uint64(0xFFFFFFFF)
"""The first four of eight voxels."""
SPARSE_SPACING = 0.5
"""Rays farther apart than this many voxels may miss some (the shortest way through a voxel's middle section)."""


@njit(cache=True, nogil=True)
def _passed(
    x: float, y: float, z: float, edge: float, radius: float, half: float, elevation: float, azimuth: float, own: int,
    patch: int, end: NDArray[np.float32], bin_start: NDArray[np.int32], rows: float, row_start: NDArray[np.int64],
    patch_start: NDArray[np.int64], limit: NDArray[np.float32], bound: NDArray[np.float32],
) -> bool:
    """Whether a ray's clear part meets the voxel around (x, y, z), with its middle in bin ``own``, and that bin's in ``patch``.

    The voxel lies in a cap of ``radius`` [rad] with this ``half`` width in azimuth [rad].
    """
    half_edge = 0.5 * edge
    if depth(patch, limit, x, y, z, half_edge) <= bound[own] and bin_passes(own, x, y, z, half_edge, end, bin_start):
        return True  # most voxels in free space
    first, last = rows_within(elevation, radius, rows, len(row_start) - 2)
    for row in range(first, last + 1):
        base = row_start[row]
        columns = row_start[row + 1] - base
        patches = patch_start[row // PATCH]
        wide = patch_start[row // PATCH + 1] - patches
        c0, c1 = columns_within(azimuth, half, columns)
        for c in range(c0, c1 + 1):
            column = wrapped(c, columns)
            b, p = base + column, patches + patch_of(column, columns, wide)
            if b != own and depth(p, limit, x, y, z, half_edge) <= bound[b] and bin_passes(
                b, x, y, z, half_edge, end, bin_start
            ):
                return True
    return False


@njit(cache=True, nogil=True)
def _between(
    x: float, y: float, z: float, distance: float, edge: float, elevation: float, azimuth: float, cosine: float,
    patch: int, spacing_rad: float, bin_start: NDArray[np.int32], rows: float, row_start: NDArray[np.int64],
    nearest: NDArray[np.float32], plane: NDArray[np.float32],
) -> int:
    """BETWEEN, SURFACE or neither, for a voxel that no ray meets and where rays lie farther apart than voxels."""
    half_diagonal = CORNER * edge
    around = AROUND_SPACINGS * spacing_rad
    first, last = rows_within(elevation, around, rows, len(row_start) - 2)
    half = half_azimuth(cosine, around)
    seen, beyond = 0, True
    for row in range(first, last + 1):
        base = row_start[row]
        columns = row_start[row + 1] - base
        c0, c1 = columns_within(azimuth, half, columns)
        for c in range(c0, c1 + 1):
            b = base + wrapped(c, columns)
            seen += bin_start[b + 1] - bin_start[b]
            beyond &= nearest[b] > distance + half_diagonal
    if seen >= FEWEST_AROUND and beyond:
        return BETWEEN
    m0, m1, m2 = plane[patch, 0], plane[patch, 1], plane[patch, 2]
    if not math.isnan(m0):
        behind = (1.0 - (m0 * x + m1 * y + m2 * z)) / math.sqrt(m0 * m0 + m1 * m1 + m2 * m2)
        if abs(behind) <= half_diagonal:
            return SURFACE
    return 0


@njit(cache=True, nogil=True, inline="always")
def _open(wanted: NDArray[np.uint64], labels: NDArray[np.uint64], row: int, run: int) -> np.uint64:
    """Of a run of eight voxels along z, a byte each: 1 where it is wanted and no ray has passed it yet."""
    return wanted[row, run] & ~labels[row, run]


@njit(cache=True, nogil=True)
def _open_eighths(wanted: NDArray[np.uint64], labels: NDArray[np.uint64], row: int) -> int:
    """A bit for each eighth of a brick that holds an open voxel."""
    some = 0
    for run in range(CELLS // SIDE):
        voxels = _open(wanted, labels, row, run)
        if voxels:
            first = (run >> 3) & 4 | (run >> 1) & 2
            if voxels & LOWER:
                some |= 1 << first
            if voxels & ~LOWER:
                some |= 2 << first
    return some


@njit(cache=True, nogil=True)
def _hidden_eighths(
    asked: int, ox: float, oy: float, oz: float, edge: float, radius: float, dense: bool, rows: float,
    patch_start: NDArray[np.int64], limit: NDArray[np.float32], coarse_rows: float, coarse_start: NDArray[np.int64],
    reach: NDArray[np.float32],
) -> int:
    """A bit for each eighth of the brick with its corner at (ox, oy, oz) that all rays end before, or that nobody asks about.

    Each eighth lies in a cap of ``radius`` [rad]. Where rays lie ``dense`` their limits tell; else also what lies between
    rays counts, so that only their ``reach`` does.
    """
    hidden = 0
    for part in range(8):
        x = ox + edge * (2.0 + 4.0 * (part >> 2))
        y = oy + edge * (2.0 + 4.0 * ((part >> 1) & 1))
        z = oz + edge * (2.0 + 4.0 * (part & 1))
        away = math.sqrt(x * x + y * y + z * z)
        if not asked >> part & 1:
            out_of_reach = True
        elif dense:
            out_of_reach = all_before(x, y, z, away, radius, 2.0 * edge, rows / PATCH, patch_start, limit)
        else:
            nearest = away - 4.0 * CORNER * edge
            out_of_reach = not any_farther(x, y, z, away, radius, nearest, coarse_rows, coarse_start, reach)
        if out_of_reach:
            hidden |= 1 << part
    return hidden


@njit(cache=True, nogil=True, parallel=True)
def _label(
    keys: NDArray[np.int64], wanted: NDArray[np.uint64], labels_of_runs: NDArray[np.uint64], station: NDArray[np.float64],
    anchor: NDArray[np.float64], edge: float, sector: NDArray[np.float64], spacing_rad: float,
    end: NDArray[np.float32], bin_start: NDArray[np.int32], rows: float, row_start: NDArray[np.int64],
    patch_start: NDArray[np.int64], limit: NDArray[np.float32], bound: NDArray[np.float32],
    nearest: NDArray[np.float32], longest: NDArray[np.float32], plane: NDArray[np.float32],
    coarse_rows: float, coarse_start: NDArray[np.int64], coarse_farthest: NDArray[np.float32],
    coarse_longest: NDArray[np.float32], labels: NDArray[np.uint8],
) -> None:
    blocks = (len(keys) + BRICKS_AT_ONCE - 1) // BRICKS_AT_ONCE
    stride = spread(blocks)
    for turn in prange(blocks):
        begin = turn * stride % blocks * BRICKS_AT_ONCE
        for row in range(begin, min(begin + BRICKS_AT_ONCE, len(keys))):
            some = _open_eighths(wanted, labels_of_runs, row)
            if some == 0:
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
            reach = coarse_farthest if dense else coarse_longest
            far = distance > 8.0 * size  # then the cap of any of its voxels serves all
            cap = 1.02 * CORNER * edge / max(distance - size - CORNER * edge, edge)
            cap_half = half_azimuth((math.sqrt(mx * mx + my * my) - size) / (distance + size), cap)
            hidden = 0
            if distance > 2.0 * size:
                radius = max(1.02 * size / (distance - size), around)
                if not any_farther(mx, my, mz, distance, radius, distance - size, coarse_rows, coarse_start, reach):
                    continue
                hidden = _hidden_eighths(
                    some, ox, oy, oz, edge, max(1.02 * 0.5 * size / (distance - size), around), dense, rows, patch_start, limit,
                    coarse_rows, coarse_start, reach,
                )
            for run in range(CELLS // SIDE):
                voxels = _open(wanted, labels_of_runs, row, run)
                if voxels == 0:
                    continue
                covered = hidden >> ((run >> 3) & 4 | (run >> 1) & 2) & 3
                if covered == 3:
                    continue
                for k in range(SIDE):
                    if not (voxels >> np.uint64(8 * k)) & np.uint64(1) or covered >> (k >> 2) & 1:
                        continue
                    cell = run * SIDE + k
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
                        cap_half = half_azimuth(rho / distance, cap)
                    elevation, azimuth = pseudo_elevation(rho, z), pseudo_azimuth(x, y)
                    r = min(max(int((elevation + 1.0) * 0.5 * rows), 0), len(row_start) - 2)
                    columns = row_start[r + 1] - row_start[r]
                    column = min(int(azimuth * 0.25 * columns), columns - 1)
                    own = row_start[r] + column
                    patches = patch_start[r // PATCH]
                    wide = patch_start[r // PATCH + 1] - patches
                    patch = patches + min(int(azimuth * 0.25 * wide), wide - 1)
                    behind = (
                        wide >= 32 and cap * 0.5 * rows <= 1.0 and cap_half * 0.56 * wide <= 1.0
                        and depth(patch, limit, x, y, z, 0.5 * edge) > limit[patch, 3]
                    )  # most voxels behind a surface; near a pole rows differ too much for one bin more to be wide enough
                    if not behind and _passed(
                        x, y, z, edge, cap, cap_half, elevation, azimuth, own,
                        patches + patch_of(column, columns, wide), end, bin_start, rows, row_start, patch_start, limit, bound,
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
                            x, y, z, distance, edge, elevation, azimuth, rho / distance, patch, spacing_rad, bin_start, rows,
                            row_start, nearest, plane,
                        ))


def _runs(cells: NDArray[Any]) -> NDArray[np.uint64]:
    """(B, 64) the bytes (B, 512) of bricks, eight together, the first lowest."""
    return cells.view("<u8")


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
        keys, _runs(wanted), _runs(labels), station, anchor, edge, whole if sector is None else sector, rays.spacing_rad,
        rays.end, rays.bin_start, rays.bins.rows, rays.bins.row_start, rays.patches.row_start, rays.limit, rays.bound,
        rays.nearest, rays.longest, rays.plane, rays.coarse.rows, rays.coarse.row_start, rays.coarse_farthest,
        rays.coarse_longest, labels,
    )
