"""From samples and stations to verdicts: plan first, then the places where an element could stand instead."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..model.elements import BuildingModel
from ..model.sample_surface import is_exposed
from ..model.samples import SurfaceSamples
from ..model.shared_faces import drop_shared
from ..progress import Progress
from .collect import Queries
from .decide import STILL_AT_PLAN, Context, Place, assess_place, choose, propose
from .probe import probe
from .scenery import AsBuilt, Scenery, with_glass
from .search import search, unsettled
from .sightings import AT, BEYOND, Sightings
from .slide import candidate_slides, probe_slides

NEAR_M = 1.0
"""A return within this distance of the model's box comes near it."""
COVER_M = 0.05
"""What lies this close around an element may be hidden by it."""
REFINE_M = 0.002
"""A fit that ends farther than this from where it began is begun again from there."""
MOST_REFINEMENTS = 4
STILL_THERE = 0.9
"""The surface found from the better start must be no smaller than this share of what was found before."""


def comes_near(model: BuildingModel, seen: Sightings) -> bool:
    """Whether any return lies near the model or behind a part of it: rays of a scan elsewhere all end far before it."""
    low, high = model.bounds
    near = ((seen.point >= low - NEAR_M) & (seen.point <= high + NEAR_M)).all(axis=1)
    return bool(near.any() or (seen.deviation < 0).any())


def looks_through_glass(scenery: Scenery, seen: Sightings, window: float) -> bool:
    """Whether this campaign's rays pass planned glass more often than they return from it.

    Some scanners and incidence angles give returns on panes; then a pane that is not there is as absent as a wall.
    """
    pane = seen.on_face & scenery.model.transparent[scenery.samples.triangle[seen.sample]]
    state = seen.state(window)[pane]
    return bool(np.sum(state == BEYOND) > np.sum(state == AT))


@dataclass(frozen=True)
class Findings:
    """For each element its planned place and the place that fits best, and the sightings behind both."""

    plans: list[Place]
    best: list[Place]
    samples: SurfaceSamples
    """With the positions that were uncovered by what is missing."""
    seen: Sightings
    tried: dict[int, list[Place]]
    """Places that the deviations of an element's faces proposed."""


def places(scenery: Scenery, seen: Sightings, context: Context, progress: Progress) -> Findings:
    """Find where each element stands, in two rounds.

    The second round knows which elements were found moved or absent: what a moved slab explains is no longer taken for
    its neighbours, and what an absent covering hid is looked at.
    """
    seen = scenery.explain(seen, seen.on_face, scenery.samples.element[seen.sample], None)
    progress.check()
    plans, best, tried = _round(scenery, seen, context, None, {}, progress.part(0.0, 0.4))
    lost = _lost(scenery, seen, plans, best, context)
    found = search(scenery, lost, context, progress.part(0.4, 0.6))
    here = progress.part(0.6, 0.6)
    best = _chosen(plans, best, probe(scenery, list(found.items()), None, context, here, searched=True), context)
    as_built = AsBuilt.of(scenery.model, plans, best, context)
    if as_built is None:
        return Findings(plans, _refined(scenery, plans, best, None, context, here), scenery.samples, seen, tried)
    scenery, uncovered = _uncover(scenery, as_built, context, here)
    seen = Sightings.join([seen, uncovered])
    seen = seen.rows(np.lexsort((seen.station, seen.sample)))
    seen = scenery.explain(seen, seen.on_face, scenery.samples.element[seen.sample], as_built)
    progress.check()
    plans, best, tried = _round(scenery, seen, context, as_built, found, progress.part(0.6, 1.0))
    best = _refined(scenery, plans, best, as_built, context, progress.part(1.0, 1.0))
    return Findings(plans, best, scenery.samples, seen, tried)


def _uncover(
    scenery: Scenery, as_built: AsBuilt, context: Context, progress: Progress
) -> tuple[Scenery, Sightings]:
    """Positions that only a moved or absent element hid count from now on; returns what was seen at them."""
    s = scenery.samples
    scene = as_built.scene
    near = np.zeros(len(s), dtype=np.bool_)
    first = s.first_of(len(as_built.elsewhere))
    for k in np.flatnonzero(as_built.elsewhere):
        own = slice(int(first[k]), int(first[k + 1]))
        if own.start < own.stop:
            low, high = s.position[own].min(axis=0) - COVER_M, s.position[own].max(axis=0) + COVER_M
            near |= ((s.position >= low) & (s.position <= high)).all(axis=1)
    row = np.flatnonzero(near & ~s.exposed)
    row = row[is_exposed(scenery.model, scene, s.position[row], s.normal[row], s.element[row])]
    exposed = s.exposed.copy()
    exposed[row] = True
    of = np.isin(s.element, np.unique(s.element[row]))
    exposed[of] = s.exposed[of] | drop_shared(
        scenery.model, scene, s.position[of], s.normal[of], s.element[of], exposed[of]
    )
    row = row[exposed[row]]
    scenery = replace(scenery, samples=replace(s, exposed=exposed))
    queries = Queries(row, s.position[row], s.normal[row], s.element[row], s.triangle[row], np.zeros((len(row), 3)))
    seen = scenery.look(queries, progress)
    return scenery, with_glass(scenery, seen, s.triangle[seen.sample], context.see_through)


def _round(
    scenery: Scenery, seen: Sightings, context: Context, as_built: AsBuilt | None,
    found: dict[int, NDArray[np.float64]], progress: Progress,
) -> tuple[list[Place], list[Place], dict[int, list[Place]]]:
    samples = scenery.samples
    count = len(scenery.model.elements)
    edge = np.searchsorted(seen.sample, samples.first_of(count))
    exposed = np.bincount(samples.element, weights=samples.area * samples.exposed, minlength=count)
    plans, slides = [], []
    asked: list[tuple[int, NDArray[np.float64]]] = []
    for e in range(count):
        progress.check()
        part = seen.rows(slice(edge[e], edge[e + 1]))
        local = part.sample.astype(np.int64)
        plans.append(assess_place(np.zeros(3), part, samples.area[local], float(exposed[e]), context))
        asked += [(e, shift) for shift in propose(part, local, samples, context)]
        slides += candidate_slides(scenery, e, part, context)
    tried = probe(scenery, asked, as_built, context, progress)
    best = _chosen(plans, plans, tried, context)
    lost = [(e, shift) for e, shift in found.items() if best[e] is plans[e]]
    best = _chosen(plans, best, probe(scenery, lost, as_built, context, progress.part(1.0, 1.0), searched=True), context)
    slid = probe_slides(scenery, slides, plans, as_built, context, progress)
    for e, places_ in slid.items():
        if best[e] is plans[e]:
            best[e] = max(places_, key=lambda place: place.rays)
    return plans, best, tried


def _chosen(
    plans: list[Place], best: list[Place], others: dict[int, list[Place]], context: Context
) -> list[Place]:
    """The ``best`` places, with each element of ``others`` at the place that explains most of it."""
    return [choose(plan, others[e], context) if e in others else best[e] for e, plan in enumerate(plans)]


def _lost(
    scenery: Scenery, seen: Sightings, plans: list[Place], best: list[Place], context: Context
) -> list[int]:
    """Elements that are neither at their place nor found elsewhere, though something strange was seen around them."""
    edge = np.searchsorted(seen.sample, scenery.samples.first_of(len(plans)))
    return [
        e for e, plan in enumerate(plans)
        if best[e] is plan and unsettled(plan, seen.rows(slice(edge[e], edge[e + 1])), context)
    ]


def _refined(
    scenery: Scenery, plans: list[Place], best: list[Place], as_built: AsBuilt | None, context: Context, progress: Progress
) -> list[Place]:
    """Look again from where the fit says that a moved element stands: round surfaces are flat only over a small step."""
    best = list(best)
    for _ in range(MOST_REFINEMENTS):
        again = [
            (e, place.fit.vector) for e, place in enumerate(best)
            if place is not plans[e] and np.linalg.norm(place.fit.vector - place.shift) > REFINE_M
        ]
        if not again:
            break
        nearer = probe(scenery, again, as_built, context, progress)
        for e, found in nearer.items():
            if found[0].at >= STILL_THERE * best[e].at and len(found[0].fit.determined) >= len(best[e].fit.determined):
                back = float(np.linalg.norm(found[0].fit.vector)) <= STILL_AT_PLAN * context.window
                best[e] = plans[e] if back else found[0]
    return best
