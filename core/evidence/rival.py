"""A place that explains an element as well as its planned one, where only faces along the shift speak for the plan.

A slab that was lifted keeps its sides in their planes: what returns from them fits both places, and says nothing of which.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .decide import Context, Place, enough_seen
from .left_place import PlannedPlaces
from .own_evidence import shows_gone, shows_standing
from .sightings import SEARCH_M
from .slender import MOST_AXES


def fits_beyond_chance(share: float, rays: int, context: Context) -> bool:
    """Whether an element fits a place, with this share of so many rays, more than one of many places does by chance."""
    t = context.thresholds
    tried = 2 * MOST_AXES * SEARCH_M / (1.5 * context.window)
    at = round(share * rays)
    return share >= t.present_share and shows_standing(at, rays - at, t.absent_share, tried)


def is_found(place: Place, plan: Place, at: float, beyond: float, overlaps: float, context: Context) -> bool:
    """Whether an element was found at a place other than its planned one, more than one of many places fits by chance.

    An element that slid along its faces left a strip, and what tells of it is the rest of what tells of its plan: ``at`` and
    ``beyond`` [m2] of that are its own. ``overlaps`` is the share of it that lies on its planned place.
    """
    if place.at != plan.at:
        return fits_beyond_chance(place.at / max(place.at + place.beyond, 1e-12), place.rays, context)
    beyond = max(place.beyond, beyond - (1.0 - overlaps) * plan.exposed)
    return fits_beyond_chance(at / max(at + beyond, 1e-12), place.rays, context)


def rival(
    plan: Place, tried: Sequence[Place], planned: PlannedPlaces, row: int, tolerance: float, context: Context
) -> Place | None:
    """Of the places that were ``tried`` for an element ``row`` that seems to stand, the one that explains most of it, if it
    explains no less than the plan, and few beams return from its planned faces across the shift, against those that the place
    stops.
    """
    found, t = None, context.thresholds
    if plan.share < t.present_share:
        return None
    for place in tried:
        shift = place.fit.vector
        if not len(place.fit.determined) or np.linalg.norm(shift) <= tolerance:
            continue
        if place.at < (found or plan).at or not fits_beyond_chance(place.share, place.rays, context):
            continue
        if not enough_seen(place, (place.at + place.beyond) / max(place.exposed, 1e-12), t):
            continue
        across = planned.left(row, shift, 0)
        if shows_gone(across.at, across.stopped + across.stopped_anyway, t.present_share):
            found = place
    return found
