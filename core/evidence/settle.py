"""The last look at where elements stand, with what their neighbours and their own faces leave open.

A return that fits an element's face may be a neighbour's that touches it, or that of a surface turned otherwise which cuts
through it. And an element that moved along its largest faces fits its planned place as well as the other one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..model.elements import BuildingModel
from .decide import Context, Place, assess_place, choose, enough_seen
from .left_place import PlannedPlaces
from .overlap import ABSENT_OVERLAP, overlap
from .own_evidence import TOLD_APART_SIGMAS, at_opposed, find_touching, from_edges, own_evidence
from .rival import is_found, rival
from .scenery import Scenery
from .turned_surface import find_turned
from .verify import Findings


def settled(scenery: Scenery, found: Findings, context: Context) -> Findings:
    """The same, with such returns set aside, and the other place of an element that left its planned one for it."""
    found, doubted = _told_apart(scenery, _without_chance(scenery.model, found, context), context)
    planned = PlannedPlaces.of(
        found.seen, scenery.origins(found.seen), found.samples, scenery.scene, scenery.surfaces, context.window,
        context.registration_sigma, len(found.plans),
    )
    best = list(found.best)
    for e, plan in enumerate(found.plans):
        if (best[e] is plan or e in doubted) and e in found.tried:
            place = rival(plan, found.tried[e], planned, e, context.window, context)
            if place is not None and _left(scenery.model, planned, e, place, context):
                best[e] = place
    return replace(found, best=best)


def _without_chance(model: BuildingModel, found: Findings, context: Context) -> Findings:
    """Without slides that fit no more than by chance: a few returns of what is left of an element that is gone."""
    best = list(found.best)
    for e, plan in enumerate(found.plans):
        slid = best[e] is not plan and best[e].at == plan.at
        if slid and not is_found(best[e], plan, plan.at, plan.beyond, overlap(model, e, best[e].shift), context):
            best[e] = plan
    return replace(found, best=best)


def _left(model: BuildingModel, planned: PlannedPlaces, e: int, place: Place, context: Context) -> bool:
    rows = slice(int(planned.first[e]), int(planned.first[e + 1]))
    nothing, none = np.zeros(len(planned.samples), np.bool_), np.zeros(0, np.int64)
    through = own_evidence(
        planned.seen.rows(rows), planned.samples, planned.origins[rows], planned.surfaces, nothing, none, none,
        context.window, context.registration_sigma, len(planned.first) - 1,
    ).beams_through[e]
    shift = place.fit.vector
    stays = overlap(model, e, shift) > ABSENT_OVERLAP
    return planned.leaving(e, shift, int(through), stays, context.thresholds) in ("LEFT", "HIDES")


def _told_apart(scenery: Scenery, found: Findings, context: Context) -> tuple[Findings, set[int]]:
    """Without returns of neighbours that touch, of surfaces turned otherwise, and of what stands at an edge; and the elements
    that slid, as it seemed by such returns."""
    model, samples, surfaces, window = scenery.model, found.samples, scenery.surfaces, context.window
    sigma, count = scenery.sensor.sigma, len(found.plans)
    touching = find_touching(
        found.seen, model, samples, scenery.origins(found.seen), surfaces, window, sigma, frozenset()
    )
    others, _ = touching.split(_elsewhere(found, context))
    seen = found.seen.explained_too(others)
    at, opposed = at_opposed(seen, samples, window, count)
    turned = find_turned(seen, model, samples, surfaces, scenery.stations, scenery.sensor, window, at & opposed)
    apart = (TOLD_APART_SIGMAS + 1.0) * sigma
    element = samples.element[seen.sample]
    off = np.array([np.linalg.norm(plan.fit.vector) > apart for plan in found.plans])
    edge = from_edges(seen, samples, surfaces, at & off[element], sigma, count)
    seen = seen.beside(np.concatenate([turned, edge]))
    first = np.searchsorted(seen.sample, samples.first_of(count))
    plans, best, doubted = list(found.plans), list(found.best), set()
    for e in np.unique(element[np.concatenate([others, turned, edge])]).tolist():
        part = seen.rows(slice(first[e], first[e + 1]))
        plan = assess_place(plans[e].shift, part, samples.area[part.sample], plans[e].exposed, context)
        if best[e] is plans[e]:
            best[e] = choose(plan, found.tried.get(e, []), context)
        elif best[e].at == plans[e].at:
            doubted.add(e)
        plans[e] = plan
    return replace(found, plans=plans, best=best, seen=seen), doubted


def _elsewhere(found: Findings, context: Context) -> NDArray[np.bool_]:
    """(E,) elements that were found at another place, or nowhere."""
    absent = context.thresholds.absent_share
    return np.array([
        best is not plan or (plan.share <= absent and enough_seen(plan, 1.0, context.thresholds))
        for plan, best in zip(found.plans, found.best, strict=True)
    ])
