"""What every step of a verification needs, and the model as the scans show it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.elements import BuildingModel
from ..model.on_element import ElementSurfaces
from ..model.raycast import RayScene
from ..model.samples import SurfaceSamples
from ..progress import Progress
from .collect import Queries, StationIndexes, look
from .decide import Context, Place, enough_seen
from .gather import SensorModel
from .outline import RING_M
from .sightings import RAYLESS, Sightings, Yielding, explain

CLEARLY_MOVED_M2 = 1e6
"""Added to the strength of what was found clearly elsewhere: more than any surface has."""


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

    def origins(self, seen: Sightings) -> NDArray[np.float64]:
        """(M, 3) where the rays begin: the stations; for dense points, whose rays nobody knows, before the face they lie on."""
        position = np.array([*self.stations.position, np.zeros(3)])
        found = position[seen.station]
        rayless = seen.station == RAYLESS
        found[rayless] = seen.point[rayless].astype(np.float64) + seen.face_normal[rayless]
        return found

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
        self, seen: Sightings, asked: NDArray[np.bool_], element: NDArray[np.int32], as_built: AsBuilt | None,
        shifted: NDArray[np.bool_] | None = None, searched: bool = False,
    ) -> Sightings:
        """The same sightings, with the returns that other surfaces explain; ``asked`` (M,) are the rows that matter.

        These are all planned surfaces and, where some elements were found elsewhere, what those others look like as built;
        an element's own moved surface explains nothing, since it is what is looked for. ``element`` (M,) of the queries.
        Queries that ask for a ``shifted`` place (M,) yield to an element that stands as planned what fits that one as well.
        Of places that were ``searched`` one after the other some fit by chance: they yield what such an element would
        explain if it stood a little off, and what fits a stronger element that was found elsewhere.
        """
        origins, sigma, within = self.origins(seen), self.sensor.sigma, self.explain_within
        to_plan = to_built = None
        if shifted is not None:
            standing = np.ones(len(self.model.elements), np.bool_) if as_built is None else ~as_built.elsewhere
            to_plan = Yielding(shifted, standing, within if searched else sigma)
        if searched and as_built is not None:
            to_built = Yielding(np.ones(len(seen), np.bool_), as_built.elsewhere, sigma)
        found = explain(seen, origins, self.scene, sigma, within, asked, element, yielding=to_plan)
        if as_built is not None:
            found |= explain(
                seen, origins, as_built.scene, sigma, within, asked & ~found, element, strength=as_built.strength,
                yielding=to_built,
            )
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
    """The same sightings, knowing which queries (their ``triangle`` (M,)) lie on glass the scanner looked through.

    What lies behind a surface and has no ray proves as little.
    """
    passes = (scenery.model.transparent[triangle] & see_through) | (seen.station == RAYLESS)
    return Sightings(**{**vars(seen), "glass": passes})
