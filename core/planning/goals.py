"""What is asked of every element: the share that can be measured, the target, and what a plan aims for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..evidence.thresholds import Thresholds
from .cover import Array
from .second_look import SecondLook, Views, area_by_element
from .targets import SECOND_THINNER, Targets

SAFETY = 0.03
"""Share of the reachable surface planned beyond the target, where it can be had: points stand for surface."""
LEAST_REACHABLE = Thresholds.partial_coverage / 0.9
"""With less of an element in reach it cannot get a level, wherever scanners stand: no verdict on it as a whole. A tenth of
what is in reach may be missed."""


@dataclass(frozen=True)
class Goals:
    """Per element (E,); shares of its exposed surface."""

    reachable: Array
    """Measured as required from some place; of too little of it, as it is, for the record."""
    target: Array
    """Must be covered; 0 where nothing is asked."""
    views: Views
    """The problem on the first set of points."""
    look: SecondLook
    """The second set of points."""


def set_goals(
    coverage: float, count: int, first: Targets, sees: NDArray[np.bool_], second: Targets, sees_second: NDArray[np.bool_],
) -> Goals:
    """Goals for ``count`` elements from what the places see of two sets of points; ``coverage`` asked of what is in reach."""
    area = np.bincount(first.element, weights=first.area, minlength=count).astype(np.float64)
    can = [
        area_by_element(points.area, points.element, seen.any(axis=0), count)
        for points, seen in ((first, sees), (second, sees_second))
    ]
    reachable = (SECOND_THINNER * can[0] + can[1]) / (1.0 + SECOND_THINNER) / np.maximum(area, 1e-12)
    target = np.maximum(coverage * reachable, Thresholds.partial_coverage)
    target = np.where(reachable >= LEAST_REACHABLE, target, 0.0)
    aim = np.where(target > 0, target + SAFETY * reachable, 0.0) * area
    return Goals(
        reachable, target, Views(sees, first.area, first.element, np.minimum(aim, can[0]) * (1.0 - 1e-9)),
        SecondLook(sees_second, second.area, second.element, target * area, aim),
    )
