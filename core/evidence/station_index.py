"""The returns of one station, binned by direction.

A station sees the world as a sphere: the returns whose rays pass a query position lie in a few bins around its direction,
at any range, for occupied and for empty evidence alike. Bins are rows of elevation, each cut into columns of azimuth, so
that the columns of a row that a query needs are one run of memory. Both angles are replaced by monotone functions of them
that need no trigonometry per return.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numba import get_num_threads, njit, prange
from numpy.typing import NDArray

from ..parallel import spread

BIN_SPACINGS = 2.0
"""Height of a row in point spacings: a few returns a bin."""
FEWEST_ROWS = 16
NEIGHBOURS = 12
BINS_AT_ONCE = 1024
ROUNDING_RAD = 1e-6


@njit(cache=True, nogil=True, inline="always")
def pseudo_elevation(rho: float, z: float) -> float:
    """Monotone in the elevation, -1 (down) to 1 (up); rho is the horizontal distance."""
    total = rho + abs(z)
    return z / total if total > 0.0 else 0.0


@njit(cache=True, nogil=True, inline="always")
def pseudo_azimuth(x: float, y: float) -> float:
    """Monotone in the azimuth, 0 to 4."""
    total = abs(x) + abs(y)
    if total == 0.0:
        return 0.0
    a = y / total
    if x < 0.0:
        a = 2.0 - a
    elif y < 0.0:
        a += 4.0
    return a


@njit(cache=True, nogil=True, inline="always")
def _row(rho: float, z: float, rows: int) -> int:
    return min(max(int((pseudo_elevation(rho, z) + 1.0) * 0.5 * rows), 0), rows - 1)


@njit(cache=True, nogil=True, inline="always")
def _column(x: float, y: float, columns: int) -> int:
    return min(max(int(pseudo_azimuth(x, y) * 0.25 * columns), 0), columns - 1)


@njit(cache=True, nogil=True, inline="always")
def place(returns: NDArray[np.float32], i: int) -> tuple[float, float, float]:
    """A return in double precision [m, from the station]: what is computed with it is."""
    x, y, z = np.float64(returns[i, 0]), np.float64(returns[i, 1]), np.float64(returns[i, 2])
    return float(x), float(y), float(z)


@njit(cache=True, nogil=True, inline="always")
def _bin_of(returns: NDArray[np.float32], i: int, rows: int, row_start: NDArray[np.int64]) -> int:
    x, y, z = place(returns, i)
    row = _row(math.sqrt(x * x + y * y), z, rows)
    return row_start[row] + _column(x, y, row_start[row + 1] - row_start[row])


@njit(cache=True, nogil=True)
def _bins(returns: NDArray[np.float32], rows: int, row_start: NDArray[np.int64]) -> NDArray[np.int64]:
    out = np.empty(len(returns), np.int64)
    for i in range(len(returns)):
        out[i] = _bin_of(returns, i, rows, row_start)
    return out


def sort_into_bins(
    offsets: NDArray[np.float32], row_start: NDArray[np.int64], own: NDArray[np.bool_]
) -> tuple[NDArray[np.float32], NDArray[np.int64], NDArray[np.bool_]]:
    """Stable counting sort: returns (N, 3) bin after bin, (B + 1,) where each begins, and ``own`` ((N,) or empty) with them."""
    bins, chunks = int(row_start[-1]), get_num_threads()
    start, out, mine = np.empty(bins + 1, np.int64), np.empty_like(offsets), np.empty_like(own)
    where, goes = np.empty(len(offsets), np.int32), np.empty((chunks, bins), np.int32)
    _count_and_place(offsets, own, len(row_start) - 1, row_start, where, goes, start, out, mine)
    return out, start, mine


@njit(cache=True, nogil=True, parallel=True)
def _count_and_place(
    offsets: NDArray[np.float32], own: NDArray[np.bool_], rows: int, row_start: NDArray[np.int64], where: NDArray[np.int32],
    goes: NDArray[np.int32], start: NDArray[np.int64], out: NDArray[np.float32], mine: NDArray[np.bool_],
) -> None:
    """The same result for any number of chunks, the rows of ``goes``. What is filled comes from numpy: its memory has large
    pages where the system offers them, which saves half of the time."""
    n, bins, chunks = len(offsets), row_start[-1], len(goes)
    for c in prange(chunks):
        goes[c] = 0
        for i in range(n * c // chunks, n * (c + 1) // chunks):
            b = _bin_of(offsets, i, rows, row_start)
            where[i] = b
            goes[c, b] += 1
    total = 0
    for b in range(bins):
        start[b] = total
        for c in range(chunks):
            here = goes[c, b]
            goes[c, b] = total
            total += here
    start[bins] = total
    for c in prange(chunks):
        for i in range(n * c // chunks, n * (c + 1) // chunks):
            at = goes[c, where[i]]
            goes[c, where[i]] = at + 1
            out[at, 0] = offsets[i, 0]
            out[at, 1] = offsets[i, 1]
            out[at, 2] = offsets[i, 2]
            if len(own):
                mine[at] = own[i]


@njit(cache=True, nogil=True, inline="always")
def _before(points: NDArray[np.float32], i: int, x: float, y: float, z: float) -> bool:
    if points[i, 0] != x:
        return points[i, 0] < x
    if points[i, 1] != y:
        return points[i, 1] < y
    return points[i, 2] < z


@njit(cache=True, nogil=True)
def _settle_bin(points: NDArray[np.float32], own: NDArray[np.bool_], begin: int, end: int) -> None:
    gap = 1 if end - begin < 12 else (end - begin) // 2
    while gap > 0:  # Shell sort: most bins hold a few returns, one at a pole may hold thousands
        for i in range(begin + gap, end):
            x, y, z = points[i, 0], points[i, 1], points[i, 2]
            if _before(points, i - gap, x, y, z):
                continue
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


@njit(cache=True, nogil=True, parallel=True)
def settle_order(points: NDArray[np.float32], own: NDArray[np.bool_], start: NDArray[np.signedinteger[Any]]) -> None:
    """Put the points of each bin, and what is said of each (``own``, may be empty), in an order that is theirs alone, so that
    the order of reading changes no digit of a sum."""
    parts = (len(start) - 2) // BINS_AT_ONCE + 1
    stride = spread(parts)
    for n in prange(parts):
        part = n * stride % parts
        for b in range(part * BINS_AT_ONCE, min((part + 1) * BINS_AT_ONCE, len(start) - 1)):
            _settle_bin(points, own, start[b], start[b + 1])


@dataclass(frozen=True)
class StationIndex:
    """Returns of one station, sorted by direction; in each bin in an order that does not depend on how they were read."""

    returns: NDArray[np.float32]
    """(N, 3) metres, return minus station; single precision is 0.5 micrometres at 10 m."""
    bin_start: NDArray[np.int64]
    row_start: NDArray[np.int64]
    spacing_rad: float
    """Median angle between neighbouring rays."""
    photo: NDArray[np.float64] | None = None
    """(N, 3) of tie points, in the order of ``returns``: see ``ReturnBlock.photo``."""

    @property
    def rows(self) -> int:
        return len(self.row_start) - 1


def build_index(
    offsets: NDArray[Any], spacing_rad: float | None = None, photo: NDArray[np.float64] | None = None
) -> StationIndex:
    """Index returns (N, 3) given relative to their station [m], none of them at the station itself.

    Without ``spacing_rad`` it is estimated from the returns.
    """
    offsets = np.ascontiguousarray(offsets, dtype=np.float32)
    if spacing_rad is not None:
        return _build(offsets, spacing_rad, photo)
    rough = _build(offsets, math.sqrt(4.0 * math.pi / max(len(offsets), 1)), photo)
    spacing_rad = median_spacing(neighbour_angles(rough, len(offsets))[1])
    if not math.isfinite(spacing_rad):
        return rough
    if 0.5 < spacing_rad / rough.spacing_rad < 2.0:
        return replace(rough, spacing_rad=spacing_rad)
    return _build(rough.returns, spacing_rad, rough.photo)


def _build(offsets: NDArray[np.float32], spacing_rad: float, photo: NDArray[np.float64] | None) -> StationIndex:
    row_start = bin_layout(spacing_rad, len(offsets))
    returns, start, _ = sort_into_bins(offsets, row_start, np.zeros(0, np.bool_))
    if photo is None:
        settle_order(returns, np.zeros(0, np.bool_), start)
    else:
        order = np.lexsort((*offsets.T[::-1], _bins(offsets, len(row_start) - 1, row_start)))
        returns, photo = offsets[order], photo[order]
    return StationIndex(returns, start, row_start, spacing_rad, photo)


def view_cone(index: StationIndex, spacings: float) -> tuple[NDArray[np.float64], float]:
    """Axis (3,) and cosine of the angle of a cone around all directions that have a return within so many ``spacings``.

    What a camera looks at is a small part of its sphere: the rest need not be asked.
    """
    if not len(index.returns):
        return np.array([0.0, 0.0, 1.0]), 2.0
    ray = index.returns.astype(np.float64)
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    axis = ray.sum(axis=0)
    size = float(np.linalg.norm(axis))
    if size < 1e-6 * len(ray):
        return np.array([0.0, 0.0, 1.0]), -2.0
    axis /= size
    widest = math.acos(min(max(float((ray @ axis).min()), -1.0), 1.0)) + math.asin(min(spacings * index.spacing_rad, 1.0))
    return axis, math.cos(min(widest + ROUNDING_RAD, math.pi)) if widest < math.pi else -2.0


def sorting_spacing(spacing_rad: float, returns: int) -> float:
    """The spacing [rad] by which a station is sorted: that of evenly spread ``returns`` if it is about the measured one."""
    even = math.sqrt(4.0 * math.pi / max(returns, 1))
    return even if 0.5 < spacing_rad / even < 2.0 else spacing_rad


def bin_layout(spacing_rad: float, returns: int) -> NDArray[np.int64]:
    """(R + 1,) number of each row's first bin, and of all bins, for so many ``returns``: bins of about two by two spacings."""
    most_rows = max(FEWEST_ROWS, int(math.sqrt(0.8 * returns)))  # no more bins than returns
    rows = int(np.clip(math.pi / (BIN_SPACINGS * spacing_rad), FEWEST_ROWS, most_rows))
    edge = np.linspace(-1.0, 1.0, rows + 1)
    middle = 0.5 * (edge[1:] + edge[:-1])
    cosine = (1.0 - np.abs(middle)) / np.hypot(middle, 1.0 - np.abs(middle))
    columns = np.maximum(np.ceil(2.0 * rows * cosine), 4).astype(np.int64)
    return np.concatenate([[0], np.cumsum(columns)]).astype(np.int64)


@njit(cache=True, nogil=True)
def row_range(q: NDArray[np.float64], radius: float, rows: int) -> tuple[int, int]:
    """First and last row within ``radius`` [rad] of the direction q."""
    elevation = math.atan2(q[2], math.sqrt(q[0] * q[0] + q[1] * q[1]))
    low, high = elevation - radius, elevation + radius
    first = 0 if low <= -0.5 * math.pi else _row(math.cos(low), math.sin(low), rows)
    last = rows - 1 if high >= 0.5 * math.pi else _row(math.cos(high), math.sin(high), rows)
    return first, last


@njit(cache=True, nogil=True)
def azimuth_half_width(q: NDArray[np.float64], radius: float) -> float:
    """Half-width in azimuth [rad] of the cap of this radius around q; pi when the cap holds a pole."""
    rho = math.sqrt(q[0] * q[0] + q[1] * q[1])
    cosine = rho / math.sqrt(rho * rho + q[2] * q[2])
    s = math.sin(radius)
    return math.pi if s >= cosine or radius >= 0.5 * math.pi else math.asin(s / cosine)


@njit(cache=True, nogil=True, inline="always")
def azimuth_range(q: NDArray[np.float64], half: float) -> tuple[float, float]:
    """Where the azimuths within ``half`` [rad] of the direction q begin and end, as shares of the full turn."""
    azimuth = math.atan2(q[1], q[0])
    return (
        pseudo_azimuth(math.cos(azimuth - half), math.sin(azimuth - half)) * 0.25,
        pseudo_azimuth(math.cos(azimuth + half), math.sin(azimuth + half)) * 0.25,
    )


@njit(cache=True, nogil=True)
def column_runs(
    begin: float, end: float, half: float, row: int, row_start: NDArray[np.int64], bin_start: NDArray[np.int64]
) -> tuple[int, int, int, int]:
    """The returns of a row in an ``azimuth_range``, as two runs [a, b) and [c, d) (the second where it wraps)."""
    base = row_start[row]
    columns = row_start[row + 1] - base
    if half >= math.pi * 0.999:
        return bin_start[base], bin_start[base + columns], 0, 0
    first = min(max(int(begin * columns), 0), columns - 1)
    last = min(max(int(end * columns), 0), columns - 1)
    if first <= last and half < 0.5 * math.pi:
        return bin_start[base + first], bin_start[base + last + 1], 0, 0
    if first > last:
        return bin_start[base + first], bin_start[base + columns], bin_start[base], bin_start[base + last + 1]
    return bin_start[base], bin_start[base + columns], 0, 0


@njit(cache=True, nogil=True, parallel=True)
def _neighbour_angles(
    probe: NDArray[np.int64],
    returns: NDArray[np.float32],
    bin_start: NDArray[np.int64],
    row_start: NDArray[np.int64],
    start_radius: float,
    wanted: int,
) -> NDArray[np.float64]:
    """Angle to the ``wanted``-th nearest ray of each probed return."""
    rows = len(row_start) - 1
    out = np.full(len(probe), np.nan)
    for i in prange(len(probe)):
        p = np.array(place(returns, probe[i]))
        length = math.sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2])
        radius = start_radius
        best = np.empty(wanted + 1)
        for _ in range(8):
            best[:] = 10.0
            half = azimuth_half_width(p, radius)
            begin, end = azimuth_range(p, half)
            first, last = row_range(p, radius, rows)
            for row in range(first, last + 1):
                a, b, c, d = column_runs(begin, end, half, row, row_start, bin_start)
                for k in range(b - a + d - c):
                    j = a + k if k < b - a else c + k - (b - a)
                    ox, oy, oz = place(returns, j)
                    norm = math.sqrt(ox * ox + oy * oy + oz * oz)
                    x = p[0] / length - ox / norm
                    y = p[1] / length - oy / norm
                    z = p[2] / length - oz / norm
                    angle = math.sqrt(x * x + y * y + z * z)
                    if angle < best[wanted]:
                        m = wanted
                        while m > 0 and best[m - 1] > angle:
                            best[m] = best[m - 1]
                            m -= 1
                        best[m] = angle
            if best[wanted] <= radius:
                out[i] = best[wanted]
                break
            radius *= 2.0
    return out


@njit(cache=True, nogil=True)
def _hash(p: NDArray[np.uint32]) -> np.uint64:
    h = np.uint64(0x9E3779B97F4A7C15)
    for k in range(3):
        h ^= np.uint64(p[k])
        h *= np.uint64(0xBF58476D1CE4E5B9)
        h ^= h >> np.uint64(29)
    return h


@njit(cache=True, nogil=True, parallel=True)
def _probes(bits: NDArray[np.uint32], below: np.uint64) -> NDArray[np.bool_]:
    out = np.empty(len(bits), np.bool_)
    for i in prange(len(bits)):
        out[i] = _hash(bits[i]) < below
    return out


def neighbour_angles(index: StationIndex, total: int, probes: int = 4000) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Directions (M, 3) of about ``probes`` returns of the ``total`` of a station, and the spacing [rad] around each.

    k rays within an angle a stand for pi a^2 / k of solid angle each, so the spacing is a sqrt(pi / k). The probes are
    chosen by a hash of the return itself: neither order nor tiles change them.
    """
    share = min(probes / max(total, 1), 1.0)
    chosen = np.flatnonzero(_probes(index.returns.view(np.uint32), np.uint64(share * (2.0**64 - 2048))))
    angle = _neighbour_angles(
        chosen, index.returns, index.bin_start, index.row_start, 3.0 * index.spacing_rad, NEIGHBOURS
    )
    return index.returns[chosen].astype(np.float64), angle * math.sqrt(math.pi / NEIGHBOURS)


def median_spacing(angles: NDArray[np.float64]) -> float:
    """Median of the spacings found [rad]; NaN when there are none."""
    found = angles[np.isfinite(angles) & (angles > 0)]
    return float(np.median(found)) if len(found) else math.nan
