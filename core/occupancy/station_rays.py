"""One station's rays for questions about empty space: how far each is clear, sorted by direction, with summaries per bin.

The bins are those of the station's index (``core/evidence/station_index.py``), but follow from the point spacing and the
station's number of returns alone, so that a tile of a station has the bins of the whole.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import get_num_threads, njit, prange
from numpy.typing import NDArray

from ..evidence.station_index import StationIndex, bin_layout, pseudo_azimuth, pseudo_elevation
from .surface_fit import ROUND_UP, clear_ends, fit_planes

SINGLE_ERROR = 4e-7
"""Of a sum of three products in single precision, in their lengths."""
COARSE = 4
"""Bins of the coarse level are this many times as wide and as high."""


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
        even = math.sqrt(4.0 * math.pi / max(returns, 1))
        if 0.5 < spacing_rad / even < 2.0:
            spacing_rad = even
        row_start = bin_layout(spacing_rad, returns)
        return cls(float(len(row_start) - 1), row_start)

    def coarse(self) -> Bins:
        """Bins ``COARSE`` times as large each way."""
        columns = np.diff(self.row_start)
        widest = np.maximum.reduceat(columns, np.arange(0, len(columns), COARSE))
        return Bins(self.rows / COARSE, np.concatenate([[0], np.cumsum(np.maximum(-(-widest // COARSE), 1))]))


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
    plane: NDArray[np.float32]
    """(B, 3) m of the plane m . x = 1 that the returns around lie on [1/m]; NaN where they lie on none."""


@dataclass(frozen=True)
class StationRays(ClearRays):
    """The same with summaries of bins, for questions about voxels."""

    bound: NDArray[np.float32]
    """(B, 5) a unit vector n, the largest n . end of the bin's rays, and that of the rays of the 3 x 3 bins around [m]: no
    clear part of them goes beyond that plane. n is across the surface where the returns lie on one, else along the rays."""
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
        end, start, own_sorted = _single(index.returns), index.bin_start.astype(np.int32), np.zeros(0, np.bool_)
    else:
        mine = np.zeros(0, np.bool_) if own is None else own
        end, start, own_sorted = _sort(index.returns, mine, bins.rows, bins.row_start, get_num_threads())
    _settle_order(end, own_sorted, start)
    count = int(bins.row_start[-1])
    plane = np.full((count, 3), np.nan, np.float32)
    fit_planes(end, start, bins.row_start, edge, plane)
    nearest, farthest, longest = (np.empty(count, np.float32) for _ in range(3))
    clear_ends(end, own_sorted, start, edge, plane, nearest, farthest, longest)
    return ClearRays(end, bins, start, spacing_rad, nearest, farthest, longest, plane)


def summarise(rays: ClearRays) -> StationRays:
    """Add what lets most voxels be told without a look at a ray."""
    coarse = rays.bins.coarse()
    return StationRays(
        **vars(rays), coarse=coarse,
        bound=_bounds(
            rays.end, rays.bin_start, rays.bins.row_start, rays.plane, SINGLE_ERROR * float(rays.longest.max(initial=0.0))
        ),
        coarse_farthest=_coarsen(rays.farthest, rays.bins.row_start, coarse.row_start),
        coarse_longest=_coarsen(rays.longest, rays.bins.row_start, coarse.row_start),
    )


def station_rays(
    index: StationIndex, total: int, edge: float, own: NDArray[np.bool_] | None = None
) -> StationRays:
    """``clear_rays`` with their summaries."""
    return summarise(clear_rays(index, total, edge, own))


@njit(cache=True, nogil=True, parallel=True)
def _single(returns: NDArray[np.float64]) -> NDArray[np.float32]:
    out = np.empty((len(returns), 3), np.float32)
    for i in prange(len(returns)):
        out[i, 0], out[i, 1], out[i, 2] = returns[i, 0], returns[i, 1], returns[i, 2]
    return out


@njit(cache=True, nogil=True, inline="always")
def _bin_of(x: float, y: float, z: float, rows: float, row_start: NDArray[np.int64]) -> int:
    last = len(row_start) - 2
    row = min(max(int((pseudo_elevation(math.sqrt(x * x + y * y), z) + 1.0) * 0.5 * rows), 0), last)
    columns = row_start[row + 1] - row_start[row]
    return int(row_start[row]) + min(int(pseudo_azimuth(x, y) * 0.25 * columns), columns - 1)


@njit(cache=True, nogil=True, parallel=True)
def _sort(
    returns: NDArray[np.float64], own: NDArray[np.bool_], rows: float, row_start: NDArray[np.int64], chunks: int
) -> tuple[NDArray[np.float32], NDArray[np.int32], NDArray[np.bool_]]:
    """Counting sort by bin, to single precision; the same for any number of chunks."""
    n, bins = len(returns), row_start[-1]
    where = np.empty(n, np.int32)
    place = np.zeros((chunks, bins), np.int32)
    for c in prange(chunks):
        for i in range(n * c // chunks, n * (c + 1) // chunks):
            b = _bin_of(returns[i, 0], returns[i, 1], returns[i, 2], rows, row_start)
            where[i] = b
            place[c, b] += 1
    start = np.empty(bins + 1, np.int32)
    total = 0
    for b in range(bins):
        start[b] = total
        for c in range(chunks):
            here = place[c, b]
            place[c, b] = total
            total += here
    start[bins] = total
    out = np.empty((n, 3), np.float32)
    mine = np.empty(n if len(own) else 0, np.bool_)
    for c in prange(chunks):
        for i in range(n * c // chunks, n * (c + 1) // chunks):
            at = place[c, where[i]]
            place[c, where[i]] = at + 1
            out[at, 0] = returns[i, 0]
            out[at, 1] = returns[i, 1]
            out[at, 2] = returns[i, 2]
            if len(own):
                mine[at] = own[i]
    return out, start, mine


@njit(cache=True, nogil=True, inline="always")
def _before(points: NDArray[np.float32], i: int, x: float, y: float, z: float) -> bool:
    if points[i, 0] != x:
        return points[i, 0] < x
    if points[i, 1] != y:
        return points[i, 1] < y
    return points[i, 2] < z


@njit(cache=True, nogil=True, parallel=True)
def _settle_order(points: NDArray[np.float32], own: NDArray[np.bool_], start: NDArray[np.int32]) -> None:
    """Put the points of each bin in an order of their own, so that the order of reading changes no digit of a sum."""
    for b in prange(len(start) - 1):
        begin, end = start[b], start[b + 1]
        gap = (end - begin) // 2
        while gap > 0:  # Shell sort: most bins hold a few returns, one at a pole may hold thousands
            for i in range(begin + gap, end):
                x, y, z = points[i, 0], points[i, 1], points[i, 2]
                mine = own[i] if len(own) else True
                j = i
                while j >= begin + gap and not _before(points, j - gap, x, y, z):
                    points[j, 0], points[j, 1], points[j, 2] = points[j - gap, 0], points[j - gap, 1], points[j - gap, 2]
                    if len(own):
                        own[j] = own[j - gap]
                    j -= gap
                points[j, 0], points[j, 1], points[j, 2] = x, y, z
                if len(own):
                    own[j] = mine
            gap //= 2


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
    end: NDArray[np.float32], start: NDArray[np.int32], row_start: NDArray[np.int64], plane: NDArray[np.float32],
    slack: float,
) -> NDArray[np.float32]:
    out = np.zeros((len(start) - 1, 5), np.float32)
    rows = len(row_start) - 1
    for row in prange(rows):
        columns = row_start[row + 1] - row_start[row]
        for column in range(columns):
            b = row_start[row] + column
            nx, ny, nz = float(plane[b, 0]), float(plane[b, 1]), float(plane[b, 2])
            if math.isnan(nx):
                elevation = (row + 0.5) * 2.0 / rows - 1.0
                azimuth = (column + 0.5) * 4.0 / columns
                flat = 1.0 - abs(elevation)
                nx = flat * (1.0 - azimuth if azimuth < 2.0 else azimuth - 3.0)
                ny = flat * (azimuth if azimuth < 1.0 else (2.0 - azimuth if azimuth < 3.0 else azimuth - 4.0))
                nz = elevation
            length = math.sqrt(nx * nx + ny * ny + nz * nz)
            ux, uy, uz = np.float32(nx / length), np.float32(ny / length), np.float32(nz / length)
            own = _largest(end, start[b], start[b + 1], ux, uy, uz)
            around = own
            for r in range(max(row - 1, 0), min(row + 2, rows)):
                base, there = row_start[r], row_start[r + 1] - row_start[r]
                first, last = column * there // columns - 1, ((column + 1) * there - 1) // columns + 1
                if last - first >= there:
                    first, last = 0, there - 1
                if first < 0:
                    around = max(around, _largest(end, start[base + there + first], start[base + there], ux, uy, uz))
                if last >= there:
                    around = max(around, _largest(end, start[base], start[base + last - there + 1], ux, uy, uz))
                first, last = max(first, 0), min(last, there - 1)
                around = max(around, _largest(end, start[base + first], start[base + last + 1], ux, uy, uz))
            out[b, 0], out[b, 1], out[b, 2] = ux, uy, uz
            out[b, 3], out[b, 4] = own * ROUND_UP + slack, around * ROUND_UP + slack
    return out


@njit(cache=True, nogil=True)
def _coarsen(
    values: NDArray[np.float32], row_start: NDArray[np.int64], coarse_start: NDArray[np.int64]
) -> NDArray[np.float32]:
    """Largest value of the bins that a coarse bin shares any direction with."""
    out = np.zeros(coarse_start[-1], np.float32)
    for row in range(len(row_start) - 1):
        base, columns = row_start[row], row_start[row + 1] - row_start[row]
        to = row // COARSE
        coarse_base, coarse_columns = coarse_start[to], coarse_start[to + 1] - coarse_start[to]
        for c in range(columns):
            value = values[base + c]
            for d in range(c * coarse_columns // columns, ((c + 1) * coarse_columns - 1) // columns + 1):
                out[coarse_base + d] = max(out[coarse_base + d], value)
    return out
