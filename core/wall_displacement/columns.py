"""Panel columns between vertical joints, and horizontal joints within a column."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
FACE_BIN_M = 0.1
NEAREST_JOINTS_M = 0.15
LARGEST_GAP_M = 0.15
SEGMENTS = 8
LEAST_NOISE_M = 0.0005


@dataclass(frozen=True)
class Face:
    """Depth of the face along the height of one column: running median of 10 cm strips, and the residuals of its points."""

    z: Array
    y: Array
    residual: Array
    threshold: float
    """Metres behind the face at which a point counts as recessed: the dominant thickness of the panels' relief and noise."""
    noise: float
    """Standard deviation of the points before the face [m]."""


@dataclass(frozen=True)
class FoundJoint:
    """A horizontal joint of one epoch: height, extent, depth [m], and the share of the column's width it was seen on."""

    height: float
    low: float
    high: float
    depth: float
    completeness: float


def trace_face(points: Array) -> Face:
    """The face of a column's points (N, 3), wall frame."""
    z = points[:, 2]
    edges = np.arange(z.min(), z.max() + FACE_BIN_M, FACE_BIN_M)
    index = np.clip(np.digitize(z, edges) - 1, 0, len(edges) - 1)
    order, keys, first, count = _by_strip(points[:, 1], index)
    middle = points[order, 1][first + count // 2]
    height = edges[keys] + FACE_BIN_M / 2
    reach = 2
    running = np.array([np.median(middle[max(k - reach, 0) : k + reach + 1]) for k in range(len(middle))])
    if len(height) > 3:
        lines = [np.polyfit(height[s], middle[s], 1) for s in (slice(0, 4), slice(-4, None))]
        running[:2], running[-2:] = np.polyval(lines[0], height[:2]), np.polyval(lines[1], height[-2:])
    residual = points[:, 1] - np.interp(z, height, running)
    front = residual[(residual > 0) & (residual < 0.05)]
    noise = max(1.4826 * float(np.median(front)) if len(front) else 0.0, LEAST_NOISE_M)
    relief = _dominant_depth(residual, index)
    return Face(height, running, residual, relief + max(2.0 * noise, 0.002), noise)


def _by_strip(
    values: Array, strip: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Order by strip and value; the strips that have values, where each begins in that order, and its count."""
    share = (values - values.min()) / (2.0 * np.ptp(values) + 1e-12)
    order = np.argsort(strip + share)
    count = np.bincount(strip)
    keys = np.flatnonzero(count)
    return order, keys, (np.cumsum(count) - count)[keys], count[keys]


def _dominant_depth(residual: Array, strip: NDArray[np.int64]) -> float:
    """How far behind the face the relief of most strips goes: the median of the strips' lower ends."""
    order, _, first, count = _by_strip(residual, strip)
    ends = residual[order][first + (count * 0.03).astype(np.int64)]
    return float(max(-np.median(ends[count >= min(10, count.max())]), 0.0))


def vertical_joints(points: Array, depth: Array, spacing: float) -> Array:
    """Positions x [m] of the vertical joints of a wall; ``depth`` (N,) behind the wall's smooth surface (recessed > 0)."""
    x, z = points[:, 0], points[:, 2]
    width = max(0.02, 1.1 * spacing)
    bins = max(int(np.ptp(x) / width), 1)
    levels = max(int(np.ptp(z) / max(0.1, 2 * spacing)), 1)
    column = np.minimum(((x - x.min()) / max(np.ptp(x), 1e-9) * bins).astype(np.int64), bins - 1)
    level = np.minimum(((z - z.min()) / max(np.ptp(z), 1e-9) * levels).astype(np.int64), levels - 1)
    deepest = np.zeros((bins, levels))
    np.maximum.at(deepest, (column, level), np.minimum(depth, 0.06))
    seen = np.zeros((bins, levels), np.bool_)
    seen[column, level] = True
    number = seen.sum(axis=1)
    # a joint is as high as the wall: between the lines of a coarse scan a few strays say nothing
    well = number >= 0.25 * np.median(number[number > 0])
    mean = np.where(well, deepest.sum(1) / np.maximum(number, 1), 0.0)
    usual = np.median(mean[well])
    spread = 1.4826 * np.median(np.abs(mean[well] - usual))
    limit = max(usual + 5 * spread, usual + 0.003, 0.5 * mean.max())
    found, k = [], 0
    while k < bins:
        if mean[k] > limit:
            last = k
            while last + 1 < bins and (mean[last + 1] > limit or (last + 2 < bins and mean[last + 2] > limit)):
                last += 1
            weight = mean[k : last + 1] - usual
            inside = (column >= k) & (column <= last) & (depth > max(0.5 * limit, 0.004))
            middle = float(np.median(x[inside])) if inside.any() else x.min() + (k + 0.5 * weight.size) * width
            if k > 0 and last < bins - 1:
                found.append(middle)
            k = last
        k += 1
    return np.array(found)


def horizontal_joints(points: Array, face: Face, spacing: float) -> list[FoundJoint]:
    """Joints of a column, from the steps that the recessed points make in the cumulative histogram of heights.

    A step must be made by lines all along the column's width, as a joint is and a stain of relief is not.
    """
    x, z = points[:, 0], points[:, 2]
    recessed = face.residual < -face.threshold
    if recessed.sum() < 3:
        return []
    lines = int(np.clip(np.ptp(x) / max(spacing, 0.02), 3, 48))
    line = np.minimum(((x - x.min()) / max(np.ptp(x), 1e-9) * lines).astype(np.int64), lines - 1)
    window = max(0.05, 1.25 * spacing)
    step = min(0.01, _freedman_diaconis(z[recessed]))
    count = int(np.ptp(z) / step) + 1
    hit = np.zeros((count, lines), np.bool_)
    at = np.minimum(((z - z.min()) / step).astype(np.int64), count - 1)
    hit[at[recessed], line[recessed]] = True
    reach = max(int(window / step / 2), 1)
    cumulative = np.concatenate([np.zeros((1, lines)), np.cumsum(hit, axis=0)])
    upper, lower = np.minimum(np.arange(count) + reach + 1, count), np.maximum(np.arange(count) - reach, 0)
    coverage = ((cumulative[upper] - cumulative[lower]) > 0).mean(axis=1)
    usual = float(np.median(coverage))
    limit = max(0.3, usual + 0.25, 0.35 * coverage.max())
    found: list[FoundJoint] = []
    for k in np.argsort(-coverage, kind="stable"):
        if coverage[k] < limit:
            break
        middle = z.min() + (k + 0.5) * step
        if any(abs(middle - j.height) < NEAREST_JOINTS_M for j in found):
            continue
        near = recessed & (np.abs(z - middle) < window)
        height = float(np.median(z[near]))
        if any(abs(height - j.height) < NEAREST_JOINTS_M for j in found):
            continue
        if height - z.min() < NEAREST_JOINTS_M or z.max() - height < NEAREST_JOINTS_M:
            continue
        near = recessed & (np.abs(z - height) < window)
        segment = np.minimum(((x[near] - x.min()) / max(np.ptp(x), 1e-9) * SEGMENTS).astype(np.int64), SEGMENTS - 1)
        low, high = np.quantile(z[near], (0.05, 0.95))
        depth = float(-np.quantile(face.residual[near], 0.2))
        found.append(FoundJoint(height, float(low), float(high), depth, len(np.unique(segment)) / SEGMENTS))
    return sorted(_main_joints(found), key=lambda j: j.height)


def _main_joints(found: list[FoundJoint]) -> list[FoundJoint]:
    """Without the shallow grooves of a bricked face, where the depths fall in two groups more than a factor of 2 apart."""
    # seen from below or above, a deep joint shows no more than its soffit: beyond 3 cm depths tell nothing
    depths = np.sort([min(j.depth, 0.03) for j in found])
    if len(depths) < 3:
        return found
    ratio = depths[1:] / np.maximum(depths[:-1], 1e-4)
    k = int(np.argmax(ratio))
    return [j for j in found if min(j.depth, 0.03) > depths[k]] if ratio[k] > 2.0 else found


def _freedman_diaconis(values: Array) -> float:
    """Bin width 2 IQR / n^(1/3) of the heights [m]."""
    quarter = np.quantile(values, (0.25, 0.75))
    return float(max(2 * (quarter[1] - quarter[0]) / len(values) ** (1 / 3), 1e-3))
