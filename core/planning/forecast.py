"""What a plan will give, worked out before anyone scans: coverage, belief, error and level per element."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..evidence.thresholds import Thresholds
from ..quality.faces import main_faces, number_faces
from ..quality.levels import supported_loa
from ..quality.prediction import component_class, table_for
from ..sensing.loa import level_sigma
from ..sensing.presets import ZONE_SIGMAS
from ..simulation.scanner import Scanner
from .cover import Array
from .existing import Existing
from .goals import Goals
from .options import PlanOptions
from .results import REACHED, ElementForecast
from .second_look import area_by_element
from .site import Site
from .targets import Targets
from .visibility import Requirement, measured_well


def station_belief(options: PlanOptions) -> float:
    """Belief that one station is expected to give to a surface that stands where it is planned.

    Its returns alone leave nothing unknown; what remains is the reliability of the station: the chance that its
    registration error stays inside the occupied zone, and the cap on any single station.
    """
    zone = ZONE_SIGMAS * level_sigma(options.loa)
    inside = 1.0 if options.registration_sigma <= 0 else math.erf(zone / (math.sqrt(2.0) * options.registration_sigma))
    return Thresholds.conflict_cap * inside


@dataclass(frozen=True)
class _Expected:
    """What all stations together give for the targets (P,)."""

    times: NDArray[np.int64]
    """Stations that measure it as required, those of an existing campaign as one."""
    spacing: Array
    """Between the returns of all stations that do; infinite without."""
    sigma: Array
    """Of the best view, along the normal; infinite without."""
    reached_by: NDArray[np.int64]
    """(E,) the planned station (1, 2, ...) with which the element reaches its target, 0 before any; -1 never."""


def _expect(
    site: Site, targets: Targets, positions: Array, scanner: Scanner, options: PlanOptions, target: Array,
    existing: Existing | None,
) -> _Expected:
    need, count = Requirement.of(options, scanner), len(site.chosen)
    area = np.maximum(np.bincount(targets.element, weights=targets.area, minlength=count), 1e-12)
    times = np.zeros(len(targets), np.int64)
    density, sigma = np.zeros(len(targets)), np.full(len(targets), np.inf)
    if existing is not None:
        times[existing.good] = 1
        density[existing.good] = 1.0 / np.maximum(existing.spacing[existing.good], 1e-6) ** 2
        sigma[existing.good] = existing.sigma
    reached = np.full(count, -1)
    for number in range(len(positions) + 1):
        if number:
            position = positions[number - 1]
            good, spacing, noise = measured_well(site.scene, position, targets, scanner, need)
            times += good
            ray = targets.position - position
            cosine = -np.einsum("ij,ij->i", ray, targets.normal) / np.maximum(np.linalg.norm(ray, axis=1), 1e-9)
            density[good] += 1.0 / (spacing[good] ** 2 * np.maximum(cosine[good], 1e-3))
            sigma[good] = np.minimum(sigma[good], noise[good])
        covered = area_by_element(targets.area, targets.element, times > 0, count) / area
        reached[(reached < 0) & (covered >= target - REACHED)] = number
    with np.errstate(divide="ignore"):
        return _Expected(times, 1.0 / np.sqrt(density), sigma, reached)


def forecast(
    site: Site, targets: Targets, positions: Array, scanner: Scanner, options: PlanOptions, goals: Goals,
    existing: Existing | None = None,
) -> list[ElementForecast]:
    """Expectations per element for stations at ``positions`` (S, 3), in order, over ``targets`` (P,) of all elements.

    ``existing``: what a campaign that the plan adds to gives for these targets.
    """
    model, samples = site.model, site.samples
    before = np.zeros(len(targets), np.bool_) if existing is None else existing.good
    found = _expect(site, targets, positions, scanner, options, goals.target, existing)
    belief = 1.0 - (1.0 - station_belief(options)) ** found.times
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
        measured = np.isfinite(found.sigma[own])
        coverage = float(area[found.times[own] > 0].sum()) / total
        apart = float(np.median(found.spacing[own][measured])) if measured.any() else None
        spread = float(np.sqrt(np.mean(found.sigma[own][measured] ** 2))) if measured.any() else None
        error = None
        rectangle = face[row]
        if rectangle is not None and apart is not None and spread is not None:
            expected = table_for(rectangle, cache=options.cache).expected(
                component_class(element.ifc_class), apart, spread
            )
            error = math.hypot(expected, options.registration_sigma) if math.isfinite(expected) else None
        out.append(ElementForecast(
            global_id=element.global_id, ifc_class=element.ifc_class, name=element.name, chosen=bool(site.chosen[row]),
            reachable=float(goals.reachable[row]), target=float(goals.target[row]), coverage=coverage,
            before=float(area[before[own]].sum()) / total, reached_by=int(found.reached_by[row]),
            belief=float((area * belief[own]).sum()) / total, spacing=apart, sigma=spread, predicted_error=error,
            loa=supported_loa(spread, error, coverage, Thresholds.partial_coverage),
        ))
    return out
