"""What a plan will give, worked out before anyone scans: coverage, belief, error and level per element."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..evidence.thresholds import Thresholds
from ..model.elements import BuildingModel
from ..model.samples import SurfaceSamples
from ..quality.faces import main_faces, number_faces
from ..quality.levels import supported_loa
from ..quality.prediction import component_class, table_for
from ..sensing.loa import level_sigma
from ..sensing.presets import ZONE_SIGMAS
from ..simulation.scanner import Scanner
from ..simulation.scene import Scene
from .options import PlanOptions
from .results import ElementForecast
from .targets import Targets
from .visibility import Requirement, measured_well

Array = NDArray[np.float64]


def station_belief(options: PlanOptions) -> float:
    """Belief that one station is expected to give to a surface that stands where it is planned.

    Its returns alone leave nothing unknown; what remains is the reliability of the station: the chance that its
    registration error stays inside the occupied zone, and the cap on any single station.
    """
    zone = ZONE_SIGMAS * level_sigma(options.loa)
    inside = 1.0 if options.registration_sigma <= 0 else math.erf(zone / (math.sqrt(2.0) * options.registration_sigma))
    return Thresholds.conflict_cap * inside


def forecast(
    model: BuildingModel, samples: SurfaceSamples, scene: Scene, targets: Targets, positions: Array, scanner: Scanner,
    options: PlanOptions, chosen: NDArray[np.bool_], reachable: Array, target: Array,
    seen_already: NDArray[np.bool_] | None = None,
) -> list[ElementForecast]:
    """Expectations per element for stations at ``positions`` (S, 3), over ``targets`` of all elements.

    reachable and target (E,) shares; ``seen_already`` (P,) targets that an existing campaign measures as required.
    """
    need = Requirement.of(options, scanner)
    times = np.zeros(len(targets)) if seen_already is None else seen_already.astype(np.float64)
    density, sigma = np.zeros(len(targets)), np.full(len(targets), np.inf)
    for position in positions:
        good, spacing, noise = measured_well(scene, position, targets, scanner, need)
        times += good
        ray = targets.position - position
        cosine = -np.einsum("ij,ij->i", ray, targets.normal) / np.maximum(np.linalg.norm(ray, axis=1), 1e-9)
        density[good] += 1.0 / (spacing[good] ** 2 * np.maximum(cosine[good], 1e-3))
        sigma[good] = np.minimum(sigma[good], noise[good])
    belief = 1.0 - (1.0 - station_belief(options)) ** times
    face = main_faces(
        model, number_faces(model),
        np.bincount(samples.triangle, weights=samples.area * samples.exposed, minlength=len(model.triangles)).astype(float),
    )
    start = np.searchsorted(targets.element, np.arange(len(model.elements) + 1))
    out = []
    for row, element in enumerate(model.elements):
        own = slice(int(start[row]), int(start[row + 1]))
        area = targets.area[own]
        total = max(float(area.sum()), 1e-12)
        covered = (times[own] > 0) & np.isfinite(sigma[own])
        coverage = float(area[times[own] > 0].sum()) / total if len(area) else 0.0
        apart = float(np.median(1.0 / np.sqrt(density[own][covered]))) if covered.any() else None
        spread = float(np.sqrt(np.mean(sigma[own][covered] ** 2))) if covered.any() else None
        error = None
        rectangle = face[row]
        if rectangle is not None and apart is not None and spread is not None:
            expected = table_for(rectangle, cache=options.cache).expected(
                component_class(element.ifc_class), apart, spread
            )
            error = math.hypot(expected, options.registration_sigma) if math.isfinite(expected) else None
        out.append(ElementForecast(
            global_id=element.global_id, ifc_class=element.ifc_class, name=element.name, chosen=bool(chosen[row]),
            reachable=float(reachable[row]), target=float(target[row]), coverage=coverage,
            belief=float((area * belief[own]).sum()) / total if len(area) else 0.0,
            spacing=apart, sigma=spread, predicted_error=error,
            loa=supported_loa(spread, error, coverage, Thresholds.partial_coverage),
        ))
    return out
