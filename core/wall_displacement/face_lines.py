"""Lines through the faces of panels whose relief is alike: the lines under which the depths of all of them agree best.

Ridges, grooves or stones make the depth of a face ambiguous: a robust line settles on the outer level in one epoch and
between the levels in the next. But panels come out of like moulds, so the depths of all faces of a column in both epochs,
each taken from its own line, have one distribution (the relief and the noise). Lines and distribution are found in turns;
a line is the most likely one under the distribution. Where its zero lies is the same for all and drops out of movements.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

Array = NDArray[np.float64]
BIN_M = 0.0002
RANGE_M = 0.06
"""Depths behind and before a line that count; beyond, a point is of something else."""
LEAST_SMOOTHING_M = 0.0004
STRAY = 0.02
"""Share of points that may lie at any depth: strays, mixed beams."""
TURNS = 6
SEARCH_M = 0.006
LEAST_POINTS, LEAST_HEIGHT_M = 8, 0.05
FRONT_SHARE = 0.3
"""The front of a relief is its foremost level that is at least so common as its commonest."""
BLOCKS = 8


@dataclass(frozen=True)
class FaceLine:
    """y = at + slope (z - about), and the standard deviation at ``about``. Metres."""

    at: float
    slope: float
    about: float
    sigma: float

    def depth(self, z: float | Array) -> float | Array:
        """Of the front of the relief at heights ``z``."""
        return self.at + self.slope * (z - self.about)


@dataclass(frozen=True)
class FacePart:
    """Points of one panel near a joint: place x along the wall, depth y, height z (N,) [m]; the line is wanted at ``about``."""

    x: Array
    y: Array
    z: Array
    about: float

    @property
    def enough(self) -> bool:
        """Whether a line can be laid through."""
        return len(self.y) >= LEAST_POINTS and float(np.ptp(self.z)) >= LEAST_HEIGHT_M


def fit_faces(parts: Sequence[FacePart], noise: float) -> list[FaceLine | None]:
    """A line for each part, None where it has too few points. ``noise`` [m]: standard deviation of single points."""
    used = [k for k, part in enumerate(parts) if part.enough]
    lines: list[FaceLine | None] = [None] * len(parts)
    if not used:
        return lines
    place = np.array([_mean_line(parts[k].y, parts[k].z - parts[k].about, max(5.0 * noise, 0.02)) for k in used])
    smoothing = max(0.5 * noise, LEAST_SMOOTHING_M) / BIN_M
    count = int(2 * RANGE_M / BIN_M) + 1
    for turn in range(TURNS):
        density = _pooled([parts[k] for k in used], place, count, smoothing)
        search = SEARCH_M if turn < 2 else 0.0
        place = np.array([
            _likeliest(parts[k].y, parts[k].z - parts[k].about, at, slope, np.log(density), search)
            for k, (at, slope) in zip(used, place, strict=True)
        ])
    density = _pooled([parts[k] for k in used], place, count, smoothing)
    front = _front(density)
    for k, (at, slope) in zip(used, place.tolist(), strict=True):
        lines[k] = FaceLine(at + front, slope, parts[k].about, _sigma(parts[k], at, slope, np.log(density)))
    return lines


def _pooled(parts: Sequence[FacePart], place: Array, count: int, smoothing: float) -> Array:
    """(count,) density of depths over all parts, each part counted alike, per bin."""
    total = np.zeros(count)
    for part, (at, slope) in zip(parts, place, strict=True):
        bins = np.round((part.y - at - slope * (part.z - part.about) + RANGE_M) / BIN_M)
        inside = bins[(bins >= 0) & (bins < count)].astype(np.int64)
        if len(inside):
            total += np.bincount(inside, minlength=count) / len(inside)
    total = gaussian_filter1d(total, smoothing, mode="constant")
    return np.asarray((1.0 - STRAY) * total / max(total.sum(), 1e-12) + STRAY / count)


def _front(density: Array) -> float:
    """Depth [m] of the foremost common level."""
    inner = density[1:-1]
    peak = (inner >= density[:-2]) & (inner > density[2:]) & (inner > FRONT_SHARE * density.max())
    return float((np.flatnonzero(peak)[-1] + 1) * BIN_M - RANGE_M) if peak.any() else 0.0


@njit(cache=True, nogil=True)
def _mean_line(y, z, scale):  # type: ignore[no-untyped-def]
    """y = a + b z by least squares, in turns without what lies farther off than ``scale``; no level is preferred."""
    a, b = np.median(y), 0.0
    for _ in range(6):
        n, sz, szz, sy, szy = 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(y.size):
            if abs(y[i] - a - b * z[i]) < scale:
                n, sz, szz, sy, szy = n + 1.0, sz + z[i], szz + z[i] * z[i], sy + y[i], szy + z[i] * y[i]
        det = n * szz - sz * sz
        if n < 3.0 or det <= 1e-9 * n * n:
            break
        a, b = (szz * sy - sz * szy) / det, (n * szy - sz * sy) / det
    return a, b


@njit(cache=True, nogil=True)
def _log_likelihood(y, z, a, b, log_density):  # type: ignore[no-untyped-def]
    total, last = 0.0, log_density.size - 1
    for i in range(y.size):
        at = (y[i] - a - b * z[i] + RANGE_M) / BIN_M
        if at <= 0.0 or at >= last:
            total += log_density[0]
            continue
        k = int(at)
        total += log_density[k] + (at - k) * (log_density[k + 1] - log_density[k])
    return total


@njit(cache=True, nogil=True)
def _likeliest(y, z, a, b, log_density, search):  # type: ignore[no-untyped-def]
    """The line of the largest likelihood near (a, b): levels within ``search`` are tried, then scored by Newton's way."""
    if search > 0.0:
        best, level = -np.inf, a
        steps = int(search / (2.0 * BIN_M))
        for k in range(-steps, steps + 1):
            found = _log_likelihood(y, z, a + 2.0 * BIN_M * k, b, log_density)
            if found > best:
                best, level = found, a + 2.0 * BIN_M * k
        a = level
    here = _log_likelihood(y, z, a, b, log_density)
    for _ in range(20):
        ga, gb, info, sz, szz = 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(y.size):
            g = _slope_at(y[i] - a - b * z[i], log_density)
            ga, gb, info = ga - g, gb - g * z[i], info + g * g
            sz, szz = sz + z[i], szz + z[i] * z[i]
        n = float(y.size)
        each = info / n
        det = n * szz - sz * sz
        if each <= 0.0 or det <= 1e-9 * n * n:
            break
        da, db = (szz * ga - sz * gb) / (det * each), (n * gb - sz * ga) / (det * each)
        share, moved = 1.0, False
        for _ in range(8):
            there = _log_likelihood(y, z, a + share * da, b + share * db, log_density)
            if there > here:
                a, b, moved = a + share * da, b + share * db, there - here > 1e-4
                here = there
                break
            share *= 0.5
        if not moved:
            break
    return a, b


@njit(cache=True, nogil=True)
def _slope_at(residual, log_density):  # type: ignore[no-untyped-def]
    """d log density / d residual [1/m]."""
    at = (residual + RANGE_M) / BIN_M
    k = int(at)
    if k < 1 or k > log_density.size - 3:
        return 0.0
    left, right = log_density[k + 1] - log_density[k - 1], log_density[k + 2] - log_density[k]
    return (left + (at - k) * (right - left)) / (2.0 * BIN_M)


def _sigma(part: FacePart, at: float, slope: float, log_density: Array) -> float:
    """Standard deviation of the line at ``about`` [m].

    From the likelihood's slopes summed over strips of the panel's width, as neighbouring points share the surface's
    unevenness; or of points that do not, where that is larger.
    """
    z = part.z - part.about
    slopes = _slopes(part.y - at - slope * z, log_density)
    design = np.column_stack([np.ones_like(z), z])
    each = float(np.mean(slopes**2))
    if each <= 0:
        return float("inf")
    inverse = np.linalg.inv(design.T @ design * each)
    order = np.empty(len(z), np.int64)
    order[np.argsort(part.x, kind="stable")] = np.arange(len(z))
    block = order * BLOCKS // len(z)
    sums = np.stack([np.bincount(block, -slopes * column, BLOCKS) for column in design.T])
    by_block = inverse @ (sums @ sums.T * BLOCKS / (BLOCKS - 1)) @ inverse
    return float(np.sqrt(max(by_block[0, 0], inverse[0, 0])))


@njit(cache=True, nogil=True)
def _slopes(residual, log_density):  # type: ignore[no-untyped-def]
    out = np.empty(residual.size)
    for i in range(residual.size):
        out[i] = _slope_at(residual[i], log_density)
    return out
