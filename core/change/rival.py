"""A place that explains an element as well as its planned one, where only faces along the shift speak for the plan.

A slab that was lifted keeps its sides in their planes: what returns from them fits both places, and says nothing of which.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..evidence.decide import Place
from ..evidence.thresholds import Thresholds
from .left_place import PlannedPlaces
from .own_evidence import shows_gone


def rival(
    plan: Place, tried: Sequence[Place], planned: PlannedPlaces, row: int, tolerance: float, t: Thresholds
) -> Place | None:
    """Of the places that were ``tried`` for element ``row``, the one that explains most of it, if it explains no less than the
    plan, and few beams return from its planned faces across the shift, against those that the place stops.
    """
    found = None
    for place in tried:
        shift = place.fit.vector
        if not len(place.fit.determined) or np.linalg.norm(shift) <= tolerance or place.share < t.present_share:
            continue
        if place.at < (plan if found is None else found).at:
            continue
        across = planned.left(row, shift, 0)
        if shows_gone(across.at, across.stopped + across.stopped_anyway, t.present_share):
            found = place
    return found
