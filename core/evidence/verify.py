"""From samples and stations to verdicts: plan first, then the places where an element could stand instead."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..model.elements import BuildingModel
from ..model.on_element import ElementSurfaces
from ..model.raycast import RayScene
from ..model.sample_surface import is_exposed
from ..model.samples import SurfaceSamples
from ..progress import Progress
from .collect import Queries, StationIndexes, look
from .decide import Context, Place, assess_place, choose, enough_seen, propose
from .gather import SensorModel
from .outline import RING_M, goes_on, ring
from .sightings import AT, BEYOND, Sightings, explain
from .slide import candidate_slides, probe_slides

NEAR_M = 1.0
"""A return within this distance of the model's box comes near it."""
COVER_M = 0.05
"""What lies this close around an element may be hidden by it."""
CLEARLY_MOVED_M2 = 1e6
"""Added to the strength of what was found clearly elsewhere: more than any surface has."""
REFINE_M = 0.002
"""A fit that ends farther than this from where it began is begun again from there."""
MOST_REFINEMENTS = 4
STILL_THERE = 0.9
"""The surface found from the better start must be no smaller than this share of what was found before."""
MOST_PROBES = 1500
"""Query positions of an element that test a shifted place: shares to a few percent."""


@dataclass(frozen=True)
class Scenery:
    """What every step needs: the model, its samples, the stations, and how returns are explained."""

    model: BuildingModel
    samples: SurfaceSamples
    stations: StationIndexes
    scene: RayScene
    surfaces: ElementSurfaces
    sensor: SensorModel
    explain_within: float

    @property
    def station_positions(self) -> NDArray[np.float64]:
        return np.array(self.stations.position).reshape(-1, 3)

    @property
    def ring_margin(self) -> float:
        """How far outside an element's outline to look whether a surface goes on, metres: beyond two spacings at 5 m."""
        return max(RING_M, 2.0 * float(np.median(self.stations.spacing)) * 5.0)

    def plan_queries(self) -> Queries:
        """All exposed samples at their planned places."""
        row = np.flatnonzero(self.samples.exposed)
        s = self.samples
        return Queries(row, s.position[row], s.normal[row], s.element[row], s.triangle[row], np.zeros((len(row), 3)))

    def look(self, queries: Queries, progress: Progress) -> Sightings:
        """Sightings with what the plan explains."""
        return look(self.stations, queries, self.surfaces, self.sensor, progress)

    def explain(
        self, seen: Sightings, asked: NDArray[np.bool_], element: NDArray[np.int32], as_built: AsBuilt | None
    ) -> Sightings:
        """The same sightings, with the returns that other surfaces explain; ``asked`` (M,) are the rows that matter.

        These are all planned surfaces and, where some elements were found elsewhere, what those others look like as built;
        an element's own moved surface explains nothing, since it is what is looked for. ``element`` (M,) of the queries.
        """
        known = self.station_positions, self.sensor.sigma, self.explain_within
        found = explain(seen, known[0], self.scene, *known[1:], asked)
        if as_built is not None:
            found |= explain(seen, known[0], as_built.scene, *known[1:], asked & ~found, element, as_built.strength)
        return Sightings(**{**vars(seen), "explained": seen.explained | found})


@dataclass(frozen=True)
class AsBuilt:
    """The model with its elements where the first round found them."""

    scene: RayScene
    elsewhere: NDArray[np.bool_]
    """(E,) absent, or clearly moved."""
    strength: NDArray[np.float64]
    """(E,) how much speaks for an element's place: m2 of surface found there. Of two elements that could both account for a
    return, the one with more of it does; what was found clearly elsewhere goes before all that stands near its plan."""

    @staticmethod
    def of(model: BuildingModel, plans: list[Place], best: list[Place], context: Context) -> AsBuilt | None:
        """None when everything stands as planned."""
        t = context.thresholds
        shift = np.zeros((len(plans), 3))
        strength = np.zeros(len(plans))
        elsewhere = np.zeros(len(plans), dtype=np.bool_)
        for k, place in enumerate(best):
            strength[k] = place.at
            if place is not plans[k]:
                shift[k], strength[k], elsewhere[k] = place.fit.vector, CLEARLY_MOVED_M2 + place.at, True
            elif place.share <= t.absent_share and enough_seen(place, 1.0, t):
                shift[k], elsewhere[k] = np.nan, True
            elif place.share >= t.present_share and np.linalg.norm(place.fit.vector) > context.sigma:
                shift[k] = place.fit.vector
        return AsBuilt(RayScene(model, shift), elsewhere, strength) if np.any(shift != 0) else None


def with_glass(scenery: Scenery, seen: Sightings, triangle: NDArray[np.int32], see_through: bool) -> Sightings:
    """The same sightings, knowing which queries (their ``triangle`` (M,)) lie on glass the scanner looked through."""
    return Sightings(**{**vars(seen), "glass": scenery.model.transparent[triangle] & see_through})


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


def places(scenery: Scenery, seen: Sightings, context: Context, progress: Progress) -> Findings:
    """Find where each element stands, in two rounds.

    The second round knows which elements were found moved or absent: what a moved slab explains is no longer taken for
    its neighbours, and what an absent covering hid is looked at.
    """
    seen = scenery.explain(seen, seen.on_face, scenery.samples.element[seen.sample], None)
    plans, best = _round(scenery, seen, context, None, progress.part(0.0, 0.5))
    as_built = AsBuilt.of(scenery.model, plans, best, context)
    if as_built is None:
        return Findings(plans, _refined(scenery, plans, best, None, context), scenery.samples, seen)
    scenery, uncovered = _uncover(scenery, as_built, context)
    seen = Sightings.join([seen, uncovered])
    seen = seen.rows(np.lexsort((seen.station, seen.sample)))
    seen = scenery.explain(seen, seen.on_face, scenery.samples.element[seen.sample], as_built)
    plans, best = _round(scenery, seen, context, as_built, progress.part(0.5, 1.0))
    return Findings(plans, _refined(scenery, plans, best, as_built, context), scenery.samples, seen)


def _uncover(
    scenery: Scenery, as_built: AsBuilt, context: Context
) -> tuple[Scenery, Sightings]:
    """Positions that only a moved or absent element hid count from now on; returns what was seen at them."""
    s = scenery.samples
    near = np.zeros(len(s), dtype=np.bool_)
    for k in np.flatnonzero(as_built.elsewhere):
        own = slice(*np.searchsorted(s.element, [k, k + 1]))
        if own.start < own.stop:
            low, high = s.position[own].min(axis=0) - COVER_M, s.position[own].max(axis=0) + COVER_M
            near |= ((s.position >= low) & (s.position <= high)).all(axis=1)
    row = np.flatnonzero(near & ~s.exposed)
    row = row[is_exposed(scenery.model, as_built.scene, s.position[row], s.normal[row], s.element[row])]
    exposed = s.exposed.copy()
    exposed[row] = True
    scenery = replace(scenery, samples=replace(s, exposed=exposed))
    queries = Queries(row, s.position[row], s.normal[row], s.element[row], s.triangle[row], np.zeros((len(row), 3)))
    seen = scenery.look(queries, Progress())
    return scenery, with_glass(scenery, seen, s.triangle[seen.sample], context.see_through)


def _round(
    scenery: Scenery, seen: Sightings, context: Context, as_built: AsBuilt | None, progress: Progress
) -> tuple[list[Place], list[Place]]:
    samples = scenery.samples
    count = len(scenery.model.elements)
    first = np.searchsorted(samples.element, np.arange(count + 1))
    edge = np.searchsorted(seen.sample, first)
    plans, asked, slides = [], [], []
    for e in range(count):
        part = seen.rows(slice(edge[e], edge[e + 1]))
        local = part.sample.astype(np.int64)
        plans.append(assess_place(np.zeros(3), part, samples.area[local], context))
        asked += [(e, shift) for shift in propose(part, local, samples, context)]
        slides += candidate_slides(scenery, e, part, context)
    others = _probe(scenery, asked, first, as_built, context, progress) if asked else {}
    slid = probe_slides(scenery, slides, plans, as_built, context, progress)
    exposed = np.bincount(samples.element, weights=samples.area * samples.exposed, minlength=count)
    best = [choose(plans[e], others.get(e, []), float(exposed[e]), context) for e in range(count)]
    for e, places_ in slid.items():
        if best[e] is plans[e]:
            best[e] = max(places_, key=lambda place: place.rays)
    return plans, best


def _refined(
    scenery: Scenery, plans: list[Place], best: list[Place], as_built: AsBuilt | None, context: Context
) -> list[Place]:
    """Look again from where the fit says that a moved element stands: round surfaces are flat only over a small step."""
    best = list(best)
    first = np.searchsorted(scenery.samples.element, np.arange(len(plans) + 1))
    for _ in range(MOST_REFINEMENTS):
        again = [
            (e, place.fit.vector) for e, place in enumerate(best)
            if place is not plans[e] and np.linalg.norm(place.fit.vector - place.shift) > REFINE_M
        ]
        if not again:
            break
        nearer = _probe(scenery, again, first, as_built, context, Progress())
        for e, found in nearer.items():
            if found[0].at >= STILL_THERE * best[e].at and len(found[0].fit.determined) >= len(best[e].fit.determined):
                best[e] = found[0]
    return best


def _probe(
    scenery: Scenery, asked: list[tuple[int, NDArray[np.float64]]], first: NDArray[np.int64],
    as_built: AsBuilt | None, context: Context, progress: Progress,
) -> dict[int, list[Place]]:
    """Assess the shifted places asked for."""
    samples = scenery.samples
    own, around = [], []
    margin = scenery.ring_margin
    seen_of = np.zeros(len(asked))
    for k, (e, shift) in enumerate(asked):
        rows = first[e] + np.flatnonzero(samples.exposed[first[e] : first[e + 1]])
        seen_of[k] = len(rows)
        rows = rows[:: max(len(rows) // MOST_PROBES, 1)]
        own.append(rows)
        around.append(ring(samples.position[rows] + shift, samples.normal[rows], shift, margin))
    sample = np.concatenate(own)
    shifts = np.array([s for _, s in asked])
    size = np.array([len(r) for r in own])
    ring_size = np.array([len(p) for p, _ in around])
    ring_start = len(sample) + np.concatenate([[0], np.cumsum(ring_size)])
    start = np.concatenate([[0], np.cumsum(size)])
    ask_of = np.concatenate([np.repeat(np.arange(len(asked)), size), np.repeat(np.arange(len(asked)), ring_size)])
    queries = Queries(
        number=np.arange(len(ask_of)),
        position=np.concatenate([samples.position[sample] + shifts[ask_of[: len(sample)]], *(p for p, _ in around)]),
        normal=np.concatenate([samples.normal[sample], *(n for _, n in around)]),
        element=np.array([e for e, _ in asked], dtype=np.int32)[ask_of],
        triangle=np.concatenate([samples.triangle[sample], samples.triangle[sample[start[ask_of[len(sample) :]]]]]),
        shift=shifts[ask_of],
    )
    seen = scenery.look(queries, progress)
    asks = seen.on_face | (seen.sample >= len(sample))
    seen = scenery.explain(seen, asks, queries.element[seen.sample], as_built)
    seen = with_glass(scenery, seen, queries.triangle[seen.sample], context.see_through)
    found: dict[int, list[Place]] = {}
    for k, (e, shift) in enumerate(asked):
        a, b = np.searchsorted(seen.sample, [start[k], start[k + 1]])
        part = seen.rows(slice(a, b))
        local = sample[part.sample]
        place = assess_place(shift, part, samples.area[local] * (seen_of[k] / size[k]), context)
        a, b = np.searchsorted(seen.sample, [ring_start[k], ring_start[k + 1]])
        if not goes_on(seen.rows(slice(a, b)), context.sigma, context.thresholds.outline_share):
            found.setdefault(e, []).append(place)
    return found
