"""Robust point-to-plane adjustment of a rigid motion, balanced over the faces of the elements."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .planned_surface import Matches

TUKEY = 4.685
"""Tukey's biweight: 95 % efficient on normal errors, and nothing beyond 4.7 sigma pulls at all."""
MAD_TO_SIGMA = 1.4826
FEWEST_IN_PATCH = 8
"""Matches below which a face says nothing: the median of fewer is at the mercy of one mixed pixel."""


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
) -> tuple[NDArray[np.float64], NDArray[np.float64], float, float]:
    """Weights of matches (M,) [1/m2] and faces (P,), and the spreads between and within faces [m].

    A face deviates as a whole (as-built against planned) with a spread between faces, and its returns scatter about
    that. Both spreads are medians of absolute deviations; ``sigma`` is the noise of one return, ``largest`` the widest
    spread between faces that is believed. A face weighs Tukey(median) / (within^2 / n + between^2), shared by its returns
    and cut by Tukey about the face's own median.
    """
    median, count = group_medians(matches.residual, matches.patch, patches)
    inner = matches.residual - median[matches.patch]
    used = count >= FEWEST_IN_PATCH
    within = MAD_TO_SIGMA * weighted_median(np.abs(inner), 1.0 / np.maximum(count[matches.patch], 1))
    within = max(within, 0.3 * sigma)
    between = MAD_TO_SIGMA * weighted_median(np.abs(median[used]), np.sqrt(count[used])) if used.any() else largest
    between = float(np.clip(between, 0.3 * sigma, largest))
    spread = np.sqrt(between**2 + 1.57 * within**2 / np.maximum(count, 1))
    face = np.where(used, tukey(median / spread), 0.0)
    per_return = face / (within**2 + np.maximum(count, 1) * between**2)
    weight = per_return[matches.patch] * tukey(inner / within)
    return weight, face, between, within


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
