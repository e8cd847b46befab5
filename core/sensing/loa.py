"""USIBD levels of accuracy and the arithmetic of tolerances and confidences."""

from __future__ import annotations

import math
from typing import Literal

UPPER_BOUND_M: dict[int, float] = {10: 0.15, 20: 0.05, 30: 0.015, 40: 0.005, 50: 0.001}
"""Upper bound of each level at 95 % (two sigma), metres."""
LEVELS = (10, 20, 30, 40, 50)


def level_sigma(level: int) -> float:
    """Standard deviation of a level, metres: half its upper bound."""
    return UPPER_BOUND_M[level] / 2.0


def label(level: int | None) -> str:
    """``LOA30``, or ``NONE``."""
    return f"LOA{level}" if level else "NONE"


def level_of(text: str) -> int:
    """30 of ``LOA30``; 0 of ``NONE`` and of anything else."""
    return int(text[3:]) if text.startswith("LOA") and text[3:].isdigit() else 0


def relative_tolerance(first: float, second: float, rule: Literal["quadratic", "linear"] = "quadratic") -> float:
    """Tolerance between two objects of tolerances T1 and T2, same unit: sqrt(T1^2 + T2^2) or T1 + T2."""
    return math.hypot(first, second) if rule == "quadratic" else first + second


def worst_voxel_shift(edge: float) -> float:
    """Largest distance of a point from the centre of its voxel, same unit as ``edge``: sqrt(3)/2 edge."""
    return math.sqrt(3.0) / 2.0 * edge


def convert_confidence(confidence: float, sigma_from: float, sigma_to: float) -> float:
    """Confidence that holds for one standard deviation, carried to another.

    z = Phi^-1((1 + conf)/2); conf' = 2 Phi(z sigma_to / sigma_from) - 1.
    """
    from scipy.special import ndtri  # here: levels are read at every start, this is not

    z = float(ndtri((1.0 + confidence) / 2.0))
    return probability_within(z * sigma_to, sigma_from)


def probability_within(bound: float, sigma: float) -> float:
    """P(|x| <= bound) of a centred normal variable: 2 Phi(bound / sigma) - 1."""
    return math.erf(bound / (math.sqrt(2.0) * sigma))


def convert_belief(belief: float, sigma_measured: float, sigma_level: float) -> float:
    """Belief carried to a level: P(Z) bel / 0.95 with Z = sigma_level / sigma_measured (the table's conversion)."""
    return probability_within(sigma_level, sigma_measured) * belief / 0.95


def supported_level(edge: float, relative: bool = False) -> int | None:
    """The highest level that voxels of ``edge`` metres can support; None below LOA10.

    Absolute: its upper bound holds the worst shift of a point (eq. 4.1). ``relative``, for distances between two objects each
    of which just meets that level: the level whose bound holds their quadratic tolerance (eq. 4.4; the linear one, eq. 4.5,
    gives the same).
    """
    worst = worst_voxel_shift(edge)
    level = max((level for level in LEVELS if worst <= UPPER_BOUND_M[level]), default=None)
    if level is None or not relative:
        return level
    tolerance = relative_tolerance(UPPER_BOUND_M[level], UPPER_BOUND_M[level])
    return max((level for level in LEVELS if tolerance <= UPPER_BOUND_M[level]), default=None)
