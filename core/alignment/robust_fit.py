"""Robust point-to-plane adjustment of a rigid motion, balanced over the faces of the elements."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .planned_surface import Matches

TUKEY = 4.685
"""Tukey's biweight: 95 % efficient on normal errors, and nothing beyond 4.7 sigma pulls at all."""
MAD_TO_SIGMA = 1.4826
MEDIAN_VARIANCE = 1.57
"""Variance of a median over that of a mean of as many normal errors: pi / 2."""
LEAST_WITHIN = 0.3
"""Least spread within faces in units of the noise: on average over incidence a normal distance has half of it."""
LEAST_BETWEEN = 0.1
"""Least spread between faces in units of the noise: no building is to plan, and no model's chords are, to 0.2 mm."""
FINE_HALF_SUPPORT = 100
"""Matches at which a face counts half in the fine stage: on a trim or a sill of fewer most beams touch an edge, and mixed
pixels bias it as a whole (0.5 mm on the height of a house whose slabs all fit, before this was counted)."""
FEWEST_IN_PATCH = 8
"""Matches below which a face says nothing: the median of fewer is at the mercy of one mixed pixel."""


@dataclass(frozen=True)
class FineWeights:
    """Weights of the fine stage and the spreads that they were made from."""

    match: NDArray[np.float64]
    """(M,) of each match, 1/m2."""
    face: NDArray[np.float64]
    """(P,) 0..1 of each face: 0 where it moved or has too few matches."""
    between: float
    """Spread of faces about their planned place, metres."""
    within: float
    """Spread of returns within a face, metres."""


def jacobian(position: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """(M, 6) change of the point-to-plane residual with the motion; positions (M, 3) [m] from the centre."""
    return np.hstack([np.cross(position, normal), normal])


def coarse_weights(matches: Matches, patches: int, scale: float) -> NDArray[np.float64]:
    """(M,) Geman-McClure weights at one scale [m], each face counting as the root of its matches."""
    count = np.bincount(matches.patch, minlength=patches)
    kernel = (scale**2 / (scale**2 + matches.residual**2)) ** 2
    return kernel / np.sqrt(count[matches.patch])


def fine_weights(
    matches: Matches, patches: int, *, sigma: float, largest: float
) -> FineWeights:
    """Weigh matches by how their face fits as a whole, and how they fit their face.

    A face deviates as a whole (as-built against planned) with a spread between faces, and its returns scatter about
    that. Both spreads are medians of absolute deviations; ``sigma`` is the noise of one return, ``largest`` the widest
    spread between faces that is believed. A face weighs s Tukey(median) / (within^2 / n + between^2), with s growing
    from 0 to 1 with its size (small faces are mostly edge), shared by its
    returns and cut by Tukey about the face's own median.
    """
    median, count = group_medians(matches.residual, matches.patch, patches)
    inner = matches.residual - median[matches.patch]
    used = count >= FEWEST_IN_PATCH
    within = MAD_TO_SIGMA * weighted_median(np.abs(inner), 1.0 / np.maximum(count[matches.patch], 1))
    within = max(within, LEAST_WITHIN * sigma)
    of_median = MEDIAN_VARIANCE * within**2 / np.maximum(count, 1)
    between = largest
    if used.any():
        share = np.sqrt(count[used])
        seen = MAD_TO_SIGMA * weighted_median(np.abs(median[used]), share)
        between = float(np.sqrt(max(seen**2 - weighted_median(of_median[used], share), 0.0)))
    between = float(np.clip(between, LEAST_BETWEEN * sigma, largest))
    spread = np.sqrt(between**2 + of_median)
    face = np.where(used, tukey(median / spread), 0.0)
    size = count / (count + FINE_HALF_SUPPORT)
    per_return = face * size / (within**2 + np.maximum(count, 1) * between**2)
    return FineWeights(per_return[matches.patch] * tukey(inner / within), face, between, within)


def tukey(u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Biweight of standardised residuals."""
    return np.square(np.clip(1.0 - np.square(u / TUKEY), 0.0, None))


def group_medians(
    values: NDArray[np.float64], group: NDArray[np.int32], groups: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Lower median (G,) of the values in each group (0 where empty), and their number (G,)."""
    order = np.lexsort((values, group))
    count = np.bincount(group, minlength=groups)
    start = np.cumsum(count) - count
    middle = np.minimum(start + np.maximum(count - 1, 0) // 2, max(len(values) - 1, 0))
    if not len(values):
        return np.zeros(groups), count
    return np.where(count > 0, values[order][middle], 0.0), count


def weighted_median(values: NDArray[np.float64], weights: NDArray[np.float64]) -> float:
    """Smallest value at which half of the weight is reached."""
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, 0.5 * total[-1])])
