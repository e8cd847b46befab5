"""One station's rays for questions about empty space: how far each is clear, sorted by direction, with summaries per bin.

The bins are those of the station's index (``core/evidence/station_index.py``), but follow from the point spacing and the
station's number of returns alone, so that a tile of a station has the bins of the whole.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from ..evidence.station_index import StationIndex, bin_layout, settle_order, sort_into_bins, sorting_spacing
from ..parallel import spread
from .surface_fit import ROUND_UP, bins_around, clear_ends, fit_planes, patch_of

SINGLE_ERROR = 4e-7
"""Of a sum of three products in single precision, in their lengths."""
COARSE = 4
"""Bins of the coarse level are this many times as wide and as high."""
PATCH = 2
"""So many by so many bins are a patch: returns are fitted with planes, and most voxels told, patch by patch."""
PATCH_REACH = 12.0
"""Spacings by which a station is sorted that a patch and a bin on either side reach at most beyond a return in it: four bins,
a quarter wider than two spacings where pseudo azimuth is slowest, with room for what rounds."""


@dataclass(frozen=True)
class Bins:
    """Rows of pseudo elevation, each cut into columns of pseudo azimuth."""

    rows: float
    """Rows from pole to pole; the last one may be cut, so this need not be whole."""
    row_start: NDArray[np.int64]
    """(R + 1,) number of each row's first bin, and of all bins."""

    @classmethod
    def for_spacing(cls, spacing_rad: float, returns: int) -> Bins:
        """Bins of about two by two spacings, but no more than the station's ``returns``.

        They are those that ``verify`` sorts a whole station into, so that nothing has to be sorted again.
        """
        row_start = bin_layout(sorting_spacing(spacing_rad, returns), returns)
        return cls(float(len(row_start) - 1), row_start)

    @property
    def count(self) -> int:
        return int(self.row_start[-1])

    def merged(self, times: int) -> Bins:
        """Bins ``times`` as large each way."""
        columns = np.diff(self.row_start)
        widest = np.maximum.reduceat(columns, np.arange(0, len(columns), times))
        return Bins(self.rows / times, np.concatenate([[0], np.cumsum(np.maximum(-(-widest // times), 1))]))


@dataclass(frozen=True)
class ClearRays:
    """How far the rays of one station, or of one tile of it, are clear. Metres, from the station; single precision (a
    micrometre at 10 m)."""

    end: NDArray[np.float32]
    """(N, 3) where each ray's clear part ends, sorted by bin; 0 for the rays that another tile answers for."""
    bins: Bins
    bin_start: NDArray[np.int32]
    spacing_rad: float
    nearest: NDArray[np.float32]
    """(B,) how far all of the bin's rays are clear, those of other tiles too; infinite for an empty bin."""
    farthest: NDArray[np.float32]
    """(B,) how far any of the bin's own rays is clear; 0 for none."""
    longest: NDArray[np.float32]
    """(B,) the farthest return; 0 for none."""
    patches: Bins
    plane: NDArray[np.float32]
    """(P, 3) m of the plane m . x = 1 that the returns in and around a patch lie on [1/m]; NaN where they lie on none."""


@dataclass(frozen=True)
class StationRays(ClearRays):
    """The same with summaries, for questions about voxels."""

    limit: NDArray[np.float32]
    """(P, 4) a unit vector n, and the largest n . end [m] of the rays in a patch and one bin around it: no clear part of
    them goes beyond that plane. n is across the surface where the returns lie on one, else along the rays."""
    bound: NDArray[np.float32]
    """(B,) the largest n . end [m] of the bin's rays, n being that of the patch which holds the bin's middle."""
    coarse: Bins
    coarse_farthest: NDArray[np.float32]
    coarse_longest: NDArray[np.float32]


def clear_rays(
    index: StationIndex, total: int, edge: float, own: NDArray[np.bool_] | None = None
) -> ClearRays:
    """The clear parts of the rays to the returns of ``index``, for voxels of ``edge`` metres.

    total : returns of the whole station, of which these may be a tile.
    own : (N,) the returns that this tile answers for; the others only complete the picture at its border.
    """
    spacing_rad = index.spacing_rad
    bins = Bins.for_spacing(spacing_rad, total)
    if own is None and np.array_equal(index.row_start, bins.row_start):
        point, start, mine = index.returns, index.bin_start.astype(np.int32), np.zeros(0, np.bool_)
    else:
        mine = np.zeros(0, np.bool_) if own is None else own
        point, begin, mine = sort_into_bins(index.returns, bins.row_start, mine)
        start = begin.astype(np.int32)
        settle_order(point, mine, start)
    patches = bins.merged(PATCH)
    plane = fit_planes(point, start, bins.row_start, patches.row_start, edge)
    nearest, farthest, longest = (np.empty(bins.count, np.float32) for _ in range(3))
    end = np.empty_like(point)
    clear_ends(
        point, mine, start, bins.row_start, patches.row_start, edge, plane, end, nearest, farthest, longest
    )
    return ClearRays(end, bins, start, spacing_rad, nearest, farthest, longest, patches, plane)


def summarise(rays: ClearRays) -> StationRays:
    """Add what lets most voxels be told without a look at a ray."""
    coarse = rays.bins.merged(COARSE)
    limit, bound = _bounds(
        rays.end, rays.bin_start, rays.bins.row_start, rays.patches.row_start, rays.plane,
        SINGLE_ERROR * float(rays.longest.max(initial=0.0)),
    )
    return StationRays(
        **vars(rays), coarse=coarse, limit=limit, bound=bound,
        coarse_farthest=_coarsen(rays.farthest, rays.bins.row_start, coarse.row_start),
        coarse_longest=_coarsen(rays.longest, rays.bins.row_start, coarse.row_start),
    )


def station_rays(
    index: StationIndex, total: int, edge: float, own: NDArray[np.bool_] | None = None
) -> StationRays:
    """``clear_rays`` with their summaries."""
    return summarise(clear_rays(index, total, edge, own))


@njit(cache=True, nogil=True, fastmath={"nnan", "nsz"})
def _largest(
    end: NDArray[np.float32], begin: int, stop: int, nx: np.float32, ny: np.float32, nz: np.float32
) -> np.float32:
    """Largest n . end of a run of rays; 0 for none, since no clear part begins before the station."""
    best = np.float32(0.0)
    for i in range(begin, stop):
        best = max(best, nx * end[i, 0] + ny * end[i, 1] + nz * end[i, 2])
    return best


@njit(cache=True, nogil=True, parallel=True)
def _bounds(
    end: NDArray[np.float32], start: NDArray[np.int32], row_start: NDArray[np.int64], patch_start: NDArray[np.int64],
    plane: NDArray[np.float32], slack: float,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    limit, bound = np.empty((patch_start[-1], 4), np.float32), np.empty(row_start[-1], np.float32)
    rows = len(row_start) - 1
    stride = spread(len(patch_start) - 1)
    for turn in prange(len(patch_start) - 1):
        patch_row = turn * stride % (len(patch_start) - 1)
        wide = patch_start[patch_row + 1] - patch_start[patch_row]
        first_row, last_row = PATCH * patch_row, min(PATCH * (patch_row + 1), rows)
        for k in range(wide):
            p = patch_start[patch_row] + k
            nx, ny, nz = float(plane[p, 0]), float(plane[p, 1]), float(plane[p, 2])
            if math.isnan(nx):
                elevation = (first_row + last_row) / rows - 1.0
                azimuth = (k + 0.5) * 4.0 / wide
                flat = 1.0 - abs(elevation)
                nx = flat * (1.0 - azimuth if azimuth < 2.0 else azimuth - 3.0)
                ny = flat * (azimuth if azimuth < 1.0 else (2.0 - azimuth if azimuth < 3.0 else azimuth - 4.0))
                nz = elevation
            length = math.sqrt(nx * nx + ny * ny + nz * nz)
            ux, uy, uz = np.float32(nx / length), np.float32(ny / length), np.float32(nz / length)
            most = np.float32(0.0)
            for r in range(max(first_row - 1, 0), min(last_row + 1, rows)):
                base, there = row_start[r], row_start[r + 1] - row_start[r]
                first, last = bins_around(k, wide, there)
                if first < 0:
                    most = max(most, _largest(end, start[base + there + first], start[base + there], ux, uy, uz))
                if last >= there:
                    most = max(most, _largest(end, start[base], start[base + last - there + 1], ux, uy, uz))
                most = max(most, _largest(end, start[base + max(first, 0)], start[base + min(last, there - 1) + 1], ux, uy, uz))
            limit[p, 0], limit[p, 1], limit[p, 2], limit[p, 3] = ux, uy, uz, most * ROUND_UP + slack
        for r in range(first_row, last_row):
            columns = row_start[r + 1] - row_start[r]
            for c in range(columns):
                b, p = row_start[r] + c, patch_start[patch_row] + patch_of(c, columns, wide)
                most = _largest(end, start[b], start[b + 1], limit[p, 0], limit[p, 1], limit[p, 2])
                bound[b] = most * ROUND_UP + slack
    return limit, bound


@njit(cache=True, nogil=True, parallel=True)
def _coarsen(
    values: NDArray[np.float32], row_start: NDArray[np.int64], coarse_start: NDArray[np.int64]
) -> NDArray[np.float32]:
    """Largest value of the bins that a coarse bin shares any direction with."""
    out = np.zeros(coarse_start[-1], np.float32)
    for to in prange(len(coarse_start) - 1):
        coarse_base, coarse_columns = coarse_start[to], coarse_start[to + 1] - coarse_start[to]
        for row in range(COARSE * to, min(COARSE * (to + 1), len(row_start) - 1)):
            base, columns = row_start[row], row_start[row + 1] - row_start[row]
            for c in range(columns):
                value = values[base + c]
                for d in range(c * coarse_columns // columns, ((c + 1) * coarse_columns - 1) // columns + 1):
                    out[coarse_base + d] = max(out[coarse_base + d], value)
    return out
