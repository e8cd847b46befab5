"""The last look at where elements stand: at those that slid, or may have slid, along their own faces.

An element that moved along its largest faces fits its planned place as well as the other one, and the few returns of what is
left of one that is gone fit some place by chance.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..model.elements import BuildingModel
from ..progress import Progress
from .decide import Context, Place
from .left_place import PlannedPlaces
from .overlap import ABSENT_OVERLAP, overlap
from .own_evidence import passed_through
from .rival import is_found, rival
from .scenery import Scenery
from .verify import Findings


def settled(scenery: Scenery, found: Findings, context: Context, progress: Progress) -> Findings:
    """The same, with the other place of an element that left its planned one for it, and no place that fits by chance."""
    progress.update(0.0, "Looking again at elements that may have slid")
    best = _without_chance(scenery.model, found, context)
    planned = PlannedPlaces.of(
        found.seen, scenery.origins(found.seen), found.samples, scenery.scene, scenery.surfaces, context.window,
        context.registration_sigma, len(found.plans),
    )
    for e, plan in enumerate(found.plans):
        progress.update(e / len(found.plans), "Looking again at elements that may have slid")
        if best[e] is plan and e in found.tried:
            place = rival(plan, found.tried[e], planned, e, context.window, context)
            if place is not None and _left(scenery.model, planned, e, place, context):
                best[e] = place
    return replace(found, best=best)


def _without_chance(model: BuildingModel, found: Findings, context: Context) -> list[Place]:
    """The places, without slides that fit no more than by chance: a few returns of what is left of an element that is gone."""
    best = list(found.best)
    for e, plan in enumerate(found.plans):
        slid = best[e] is not plan and best[e].at == plan.at
        if slid and not is_found(best[e], plan, plan.at, plan.beyond, overlap(model, e, best[e].shift), context):
            best[e] = plan
    return best


def _left(model: BuildingModel, planned: PlannedPlaces, e: int, place: Place, context: Context) -> bool:
    rows = slice(int(planned.first[e]), int(planned.first[e + 1]))
    seen = planned.seen.rows(rows)
    through = passed_through(
        seen, planned.samples, planned.origins[rows], planned.surfaces, context.window, context.registration_sigma
    )
    shift = place.fit.vector
    stays = overlap(model, e, shift) > ABSENT_OVERLAP
    return planned.leaving(e, shift, len(np.unique(seen.ray_key(through))), stays, context.thresholds) in ("LEFT", "HIDES")
