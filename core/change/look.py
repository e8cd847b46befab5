"""What one epoch says of each planned element: it stands, it is gone, it moved, part of it stands, or nobody saw it.

Voxels of 10 mm are coarse against what a scan knows, so this is decided on the returns themselves, with the sightings that
``verify`` uses: a hidden surface is no evidence, returns that another element explains are not taken for this one, and
noise at a voxel's border plays no part. Voxels then say where and how much.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import permutations
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..evidence.as_found import AsFound, explained_anew, placed
from ..evidence.collect import StationIndexes
from ..evidence.decide import GLAZED, Context, Place, enough_seen, standing_shares
from ..evidence.error_model import estimate_errors
from ..evidence.gather import SensorModel
from ..evidence.left_place import PlannedPlaces
from ..evidence.overlap import ABSENT_OVERLAP, overlap
from ..evidence.own_evidence import OwnEvidence, at_opposed, find_touching, own_evidence, shows_gone
from ..evidence.passed_beside import passed_beside
from ..evidence.rival import is_found, rival
from ..evidence.scenery import Scenery, with_glass
from ..evidence.shared_surface import find_shared
from ..evidence.thresholds import Thresholds
from ..evidence.turned_surface import find_turned
from ..evidence.verify import comes_near, looks_through_glass, places
from ..model.elements import BuildingModel
from ..model.on_element import ElementSurfaces
from ..model.parts import Parts
from ..model.raycast import RayScene
from ..model.samples import SurfaceSamples
from ..progress import Progress
from ..sensing.loa import level_sigma, worst_voxel_shift
from .common_shift import CommonShift, Fits, common_shift
from .found_place import nearer_places, without_neighbours
from .twins import bodies, decided_together, may_be_either, twins_of
from .unclear import split_beams, without_unclear
from .verdict import verdict

Seen = Literal["STANDS", "GONE", "MOVED", "PART", "UNSEEN"]
LOA = 30
"""Planned surfaces are taken to be this accurate (sigma 7.5 mm), the usual requirement for as-built models."""


@dataclass(frozen=True)
class ElementSight:
    """What an epoch says of one element. Areas in m2, lengths in metres."""

    seen: Seen
    at: float
    """Area found at its planned place (or at the place it moved to)."""
    beyond: float
    """Area of its planned surface that rays passed through."""
    exposed: float
    """Area that other elements leave open."""
    shift: tuple[float, float, float] | None
    """Where it stands against the plan, in the directions the scan determines."""
    reason: str
    silent: float = 0.0
    """Area, mostly near edges, of which beams close by tell nothing though nothing hides it: it is as the rest."""
    present: float = 1.0
    """Share of what was seen of its planned surface that is at its place, and its alone."""
    in_doubt: bool = False
    """Whether it was in view, but nothing told whether it stands."""
    placed: float = 0.0
    """Metres that the accuracy of the model and of the registration may put it off its place (95 %)."""

    @property
    def distance(self) -> float:
        return 0.0 if self.shift is None else math.sqrt(sum(v * v for v in self.shift))


def change_tolerance(edge: float, sigma: float, registration: float) -> float:
    """Metres within which the grid cannot tell a place from another: half a voxel's diagonal and the measurement (95 %)."""
    return worst_voxel_shift(edge) + 2.0 * math.hypot(sigma, registration)


def sensor_model(sigma: float) -> SensorModel:
    """How returns are weighed."""
    return SensorModel(sigma, level_sigma(LOA))


@dataclass(frozen=True)
class EpochSight:
    """One epoch's look at all elements."""

    elements: tuple[ElementSight, ...]
    """One per ``model.elements``."""
    registration_sigma: float
    see_through: bool
    tolerance: float
    place_open: bool
    """Whether where it was seen from may be off, as a whole, by more than the window of a planned surface."""
    fits: Fits
    offset: CommonShift | None
    """What all elements are off by together."""


def look_at_elements(
    model: BuildingModel, samples: SurfaceSamples, scene: RayScene, stations: StationIndexes, *, sigma: float,
    edge: float, registration_sigma: float | None, progress: Progress, parts: Parts = frozenset(), place: float = 0.0,
    aligned_sigma: float = 0.0,
) -> EpochSight:
    """Decide for each element what this epoch shows. Raises BimVerifyError when no return comes near the model.

    ``parts`` names elements that are parts of others; ``place`` [m], of a block of photos that nothing fixes, is the least
    registration sigma where none is given, and so is what all elements are off by together. To it comes ``aligned_sigma`` [m],
    that of an alignment.
    """
    thresholds = Thresholds()
    surfaces = ElementSurfaces(model)
    window = max(worst_voxel_shift(edge), thresholds.window_floor) + 3 * sigma
    scenery = Scenery(
        model, samples, stations, scene, surfaces, sensor_model(sigma),
        explain_within=thresholds.explain_within + 2 * sigma,
    )
    seen = scenery.look(scenery.plan_queries(), progress.part(0.0, 0.6))
    if not comes_near(model, seen):
        names = ", ".join(s.name for s in stations.stations[:3])
        raise BimVerifyError(
            f"No return of the stations {names} comes near the model: scan and model are in different frames; "
            "register the scan."
        )
    errors = estimate_errors(seen, samples, sigma, window, len(stations.stations), registration_sigma)
    context = Context(
        loa=LOA, sigma=sigma, errors=errors, window=window,
        registration_sigma=max(errors.registration.sigma, place if registration_sigma is None else 0.0),
        see_through=looks_through_glass(scenery, seen, window), thresholds=thresholds,
        station_names=tuple(s.name for s in stations.stations),
    )
    seen = with_glass(scenery, seen, samples.triangle[seen.sample], context.see_through)
    found = places(scenery, seen, context, progress.part(0.6, 0.95))
    fits = Fits.of(model, found.plans, found.best, thresholds)
    offset = common_shift(fits)
    if registration_sigma is None:
        place = max(place, offset.axis_sigma if offset and offset.significant else 0.0)
        place_open = 2.0 * place > window
        registration_sigma = max(errors.registration.sigma, place)
    else:
        place_open = place > 0.0 and 2.0 * registration_sigma > window
    registration_sigma = math.hypot(registration_sigma, aligned_sigma)
    context = replace(context, registration_sigma=registration_sigma)
    tolerance = change_tolerance(edge, sigma, registration_sigma)
    as_found = AsFound.of(found, samples, context)
    built = as_found.scene(scenery, found, window)
    found, doubtful = explained_anew(scenery, found, as_found, built, context)
    found = without_unclear(scenery, replace(found, best=nearer_places(scenery, found, context)), tolerance, context)
    exposed = np.bincount(
        found.samples.element, weights=found.samples.area * found.samples.exposed, minlength=len(model.elements)
    )
    shared = find_shared(model, found.samples, surfaces, parts)
    body = bodies(shared, exposed.astype(np.float64))
    twins, shared = twins_of(body), shared.between(body)
    one_body = parts | frozenset(pair for group in twins for pair in permutations(group, 2))
    origins = scenery.origins(found.seen)
    at, opposed = at_opposed(found.seen, found.samples, window, len(model.elements))
    touching = find_touching(found.seen, at, opposed, model, found.samples, origins, surfaces, as_found, sigma, one_body)
    at &= opposed  # else there is nothing to explain
    split = split_beams(found.seen, at, found.samples, origins, scene, sigma, registration_sigma, one_body)
    turned = find_turned(found.seen, found.samples, surfaces, stations, sensor_model(sigma), window, at)
    planned = PlannedPlaces.of(
        found.seen, origins, found.samples, scene, surfaces, window, registration_sigma, len(model.elements)
    )
    best_places = [
        best if found.best[row] is not plan
        else rival(plan, found.tried.get(row, ()), planned, row, tolerance, context) or plan
        for row, (plan, best) in enumerate(zip(
            found.plans, without_neighbours(scenery, found.samples, found.plans, found.best, context, parts), strict=True
        ))
    ]
    known_gone, beside = np.zeros(len(model.elements), np.bool_), None
    for _ in range(2):  # what is gone shares its surface with nobody
        others, either = touching.split(known_gone)
        told = found.seen.explained_too(others)
        asked = (
            found.samples, origins, surfaces, shared.in_doubt(len(found.samples), known_gone),
            np.concatenate([either, turned]), np.unique(np.concatenate([split.split(known_gone)[1], doubtful])), window,
            registration_sigma, len(model.elements),
        )
        own = own_evidence(told, *asked)
        if beside is None:
            passed = np.array([shows_gone(0, int(through), thresholds.present_share) for through in own.beams_through])
            beside = passed_beside(
                scenery, told, found.samples, as_found, built, window, one_body, passed, progress.part(0.95, 1.0)
            )
        clear = own_evidence(told.beside(beside), *asked) if len(beside) else own
        elements = decided_together(model, twins, [
            _sight(model, row, plan, best, float(exposed[row]), tolerance, context, own, clear,
                   shared.main_partner(row, known_gone), planned)
            for row, (plan, best) in enumerate(zip(found.plans, best_places, strict=True))
        ])
        known_gone = np.array([e.seen in ("GONE", "MOVED") for e in elements])
    return EpochSight(elements, registration_sigma, context.see_through, tolerance, place_open, fits, offset)


def _sight(
    model: BuildingModel, row: int, plan: Place, best: Place, exposed: float, tolerance: float, context: Context,
    own: OwnEvidence, clear: OwnEvidence, partner: int, planned: PlannedPlaces,
) -> ElementSight:
    t = context.thresholds
    share = (plan.at + plan.beyond) / max(exposed, 1e-12)
    shift = best.fit.vector if len(best.fit.determined) else None
    vector = None if shift is None else (float(shift[0]), float(shift[1]), float(shift[2]))
    length = 0.0 if shift is None else float(np.linalg.norm(shift))

    def sight(seen: Seen, reason: str, place: Place = plan, where: bool = True) -> ElementSight:
        silent = float(own.silent[row]) if place is plan else 0.0
        return ElementSight(
            seen, place.at, plan.beyond, exposed, vector if where else None, reason, silent, own.share(row),
            seen == "UNSEEN" and exposed > 0 and enough_seen(plan, share, t), placed(context),
        )

    at_plan = length <= tolerance and overlap(model, row, best.fit.vector) > ABSENT_OVERLAP  # voxels do not tell it apart
    told = float(own.at[row]), float(own.beyond[row])
    if best is not plan and not at_plan and is_found(best, plan, *told, overlap(model, row, best.shift), context):
        stays = overlap(model, row, best.fit.vector) > ABSENT_OVERLAP
        slid = best.at == plan.at  # the strip that it freed was seen
        leaving = "LEFT" if slid else planned.leaving(row, best.fit.vector, int(own.beams_through[row]), stays, t)
        if leaving == "LEFT":
            return sight("MOVED", f"It stands {1000 * length:.0f} mm from its planned place.", best)
        if leaving == "HIDES":
            return sight("MOVED", f"It stands {1000 * length:.0f} mm before its planned place, which it hides.", best)
        if leaving == "OPEN":
            return sight("UNSEEN", _hiding(length), where=False)
        vector, length = None, 0.0
    if exposed <= 0:
        return sight("UNSEEN", "Other elements touch or enclose its whole surface.", where=False)
    if not enough_seen(plan, share, t):
        few = f"Only {share:.1%} of its surface was in view of a station, of {plan.rays} rays; that is no evidence."
        return sight("UNSEEN", few, where=False)
    shares = standing_shares(model.elements[row].ifc_class, model.transparent[_triangles(model, row)], t)
    at, through, mine = int(own.beams_at[row]), int(own.beams_through[row]), own.share(row)
    says = verdict(own, row, share, shares, t, glazed(model, row), clear)
    if says == "LITTLE":
        little = f"Rays pass through {1 - mine:.0%} of what was in view, but that is only {share:.1%} of its surface."
        return sight("UNSEEN", little, where=False)
    if says == "GONE":
        return sight("GONE", f"Rays pass through {1 - mine:.0%} of the {share:.0%} of its surface in view.", where=False)
    if says in ("STANDS", "PART") and mine >= shares[1] and length > tolerance:
        off_place = overlap(model, row, best.fit.vector) <= ABSENT_OVERLAP
        if off_place and not planned.left(row, best.fit.vector, through).passed:
            return sight("UNSEEN", _hiding(length), where=False)
        return sight("MOVED", f"It stands {1000 * length:.0f} mm from its planned place.")
    if says == "PART":
        return sight("PART", f"{mine:.0%} of its surface in view is at its place; rays pass through the rest.")
    if says == "STANDS":
        return sight("STANDS", f"{mine:.0%} of the {share:.0%} of its surface in view is at its place.")
    if says == "BESIDE":
        aside = (
            f"{through} beams pass its place, {through - int(clear.beams_through[row])} of them where something stands right "
            "beside it: that may be it, a little off."
        )
        return sight("UNSEEN", aside, where=False)
    if says == "EITHER" and partner >= 0:
        return sight("UNSEEN", may_be_either(model, partner), where=False)
    beams = f"{at} beams return from it and {through} clearly pass through it"
    if says == "EITHER":
        return sight("UNSEEN", f"{beams}: too much of the rest may have come from what touches it.", where=False)
    return sight("UNSEEN", f"{beams}: too few to tell whether it stands.", where=False)


def _hiding(length: float) -> str:
    return (
        f"A surface {1000 * length:.0f} mm from its planned place fits it, but no beams show that it left that place: "
        "it may stand there, hidden."
    )


def glazed(model: BuildingModel, row: int) -> bool:
    """Whether rays may pass an element that stands: it has panes, or is of a class that has."""
    return model.elements[row].ifc_class.startswith(GLAZED) or bool(model.transparent[_triangles(model, row)].any())


def _triangles(model: BuildingModel, row: int) -> NDArray[np.int64]:
    start = model.triangle_start
    return np.arange(start[row], start[row + 1])
