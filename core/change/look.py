"""What one epoch says of each planned element: it stands, it is gone, it moved, part of it stands, or nobody saw it.

Voxels of 10 mm are coarse against what a scan knows, so this is decided on the returns themselves, with the sightings that
``verify`` uses: a hidden surface is no evidence, returns that another element explains are not taken for this one, and
noise at a voxel's border plays no part. Voxels then say where and how much.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..evidence.collect import StationIndexes
from ..evidence.decide import Context, Place, enough_seen, standing_shares
from ..evidence.error_model import estimate_errors
from ..evidence.gather import SensorModel
from ..evidence.scenery import Scenery, with_glass
from ..evidence.thresholds import Thresholds
from ..evidence.verify import comes_near, looks_through_glass, places
from ..model.elements import BuildingModel
from ..model.on_element import ElementSurfaces
from ..model.raycast import RayScene
from ..model.samples import SurfaceSamples
from ..progress import Progress
from ..sensing.loa import level_sigma, worst_voxel_shift
from .overlap import ABSENT_OVERLAP, overlap
from .parts import Parts
from .twins import find_twins

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


def look_at_elements(
    model: BuildingModel, samples: SurfaceSamples, scene: RayScene, stations: StationIndexes, *, sigma: float,
    edge: float, registration_sigma: float | None, progress: Progress, parts: Parts = frozenset(),
) -> EpochSight:
    """Decide for each element what this epoch shows. Raises BimVerifyError when no return comes near the model.

    ``parts`` names elements that are parts of others.
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
    registration_sigma = errors.registration.sigma
    context = Context(
        loa=LOA, sigma=sigma, registration_sigma=registration_sigma, errors=errors, window=window,
        see_through=looks_through_glass(scenery, seen, window), thresholds=thresholds,
        station_names=tuple(s.name for s in stations.stations),
    )
    seen = with_glass(scenery, seen, samples.triangle[seen.sample], context.see_through)
    found = places(scenery, seen, context, progress.part(0.6, 1.0))
    exposed = np.bincount(
        found.samples.element, weights=found.samples.area * found.samples.exposed, minlength=len(model.elements)
    )
    tolerance = change_tolerance(edge, sigma, registration_sigma)
    twins = find_twins(model, samples, surfaces, parts)
    sights = [
        _sight(model, row, plan, best, float(exposed[row]), tolerance, context)
        for row, (plan, best) in enumerate(zip(found.plans, found.best, strict=True))
    ]
    elements = tuple(
        sight if twin < 0 or sights[twin].seen in ("GONE", "MOVED") else _either(model, int(twin), sight)
        for sight, twin in zip(sights, twins, strict=True)
    )
    return EpochSight(elements, registration_sigma, context.see_through, tolerance)


def _sight(
    model: BuildingModel, row: int, plan: Place, best: Place, exposed: float, tolerance: float, context: Context
) -> ElementSight:
    t = context.thresholds
    share = (plan.at + plan.beyond) / max(exposed, 1e-12)
    shift = best.fit.vector if len(best.fit.determined) else None
    vector = None if shift is None else (float(shift[0]), float(shift[1]), float(shift[2]))
    length = 0.0 if shift is None else float(np.linalg.norm(shift))

    def sight(seen: Seen, reason: str, place: Place = plan, where: bool = True) -> ElementSight:
        return ElementSight(seen, place.at, plan.beyond, exposed, vector if where else None, reason)

    if best is not plan:
        if length <= tolerance and overlap(model, row, best.fit.vector) > ABSENT_OVERLAP:
            near = f"It stands {1000 * length:.0f} mm from its planned place, which voxels do not tell apart."
            return sight("STANDS", near, best)
        return sight("MOVED", f"It stands {1000 * length:.0f} mm from its planned place.", best)
    if exposed <= 0:
        return sight("UNSEEN", "Other elements touch or enclose its whole surface.", where=False)
    if not enough_seen(plan, share, t):
        few = f"Only {share:.1%} of its surface was in view of a station, of {plan.rays} rays; that is no evidence."
        return sight("UNSEEN", few, where=False)
    absent, present = standing_shares(model.elements[row].ifc_class, model.transparent[_triangles(model, row)], t)
    if plan.share <= absent and share < t.absent_seen_share:
        little = f"Rays pass through {1 - plan.share:.0%} of what was in view, but that is only {share:.1%} of its surface."
        return sight("UNSEEN", little, where=False)
    if plan.share <= absent:
        return sight("GONE", f"Rays pass through {1 - plan.share:.0%} of the {share:.0%} of its surface in view.", where=False)
    if plan.share < present:
        return sight("PART", f"{plan.share:.0%} of its surface in view is at its place; rays pass through the rest.")
    if length > tolerance:
        return sight("MOVED", f"It stands {1000 * length:.0f} mm from its planned place.")
    return sight("STANDS", f"{plan.share:.0%} of the {share:.0%} of its surface in view is at its place.")


def _either(model: BuildingModel, twin: int, sight: ElementSight) -> ElementSight:
    """What stands where two elements share a surface may be either of them; where nothing stands, both are gone."""
    if sight.seen not in ("STANDS", "PART"):
        return sight
    other = model.elements[twin]
    name = f"{other.ifc_class} {other.name}".strip()
    return replace(
        sight, seen="UNSEEN", shift=None,
        reason=f"All of its open surface is also that of {name} ({other.global_id}): what was found there may be either.",
    )


def _triangles(model: BuildingModel, row: int) -> NDArray[np.int64]:
    start = model.triangle_start
    return np.arange(start[row], start[row + 1])
