"""Which places measure which targets well enough."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..progress import Progress
from ..sensing.loa import UPPER_BOUND_M
from ..simulation.scanner import Scanner
from ..simulation.scene import Scene
from .options import PlanOptions
from .targets import Targets

Array = NDArray[np.float64]
SIGHT_TOLERANCE_M = 0.003
CERTAIN_RETURN = 0.9
"""A surface counts as measured when at least this share of the beams comes back from it."""
USUAL_REFLECTANCE = 0.3
"""Of the surfaces of a building, careful: nothing is known of them before the scan."""
EDGE_OF_VIEW_RAD = math.radians(0.5)


@dataclass(frozen=True)
class Requirement:
    """What a measurement of a target must be."""

    bound: float
    """Two standard deviations along the normal may be no larger [m]."""
    spacing: float
    max_incidence: float
    range_max: float
    registration_sigma: float

    @staticmethod
    def of(options: PlanOptions, scanner: Scanner) -> Requirement:
        """From the level asked for and the scanner."""
        return Requirement(
            UPPER_BOUND_M[options.loa], options.wanted_spacing, options.max_incidence,
            min(options.range_max or math.inf, scanner.range_max), options.registration_sigma,
        )


def visibility_only(options: PlanOptions) -> Requirement:
    """Line of sight and nothing else: what plans without quality look at."""
    return Requirement(math.inf, math.inf, math.radians(89.9), math.inf, options.registration_sigma)


def registrable(scanner: Scanner) -> Requirement:
    """What a view must be for surfaces in it to register a scan by."""
    return Requirement(math.inf, math.inf, math.radians(75.0), scanner.range_max, 0.0)


def measured_well(
    scene: Scene, position: Array, targets: Targets, scanner: Scanner, need: Requirement
) -> tuple[NDArray[np.bool_], Array, Array]:
    """(P,) targets that a station at ``position`` (3,) measures as required; their spacing and sigma along the normal [m].

    Spacing is that across the slope of the surface, range * step / cos(incidence).
    """
    ray = targets.position - position
    distance = np.linalg.norm(ray, axis=1)
    ray /= np.maximum(distance, 1e-9)[:, None]
    cosine = -np.einsum("ij,ij->i", ray, targets.normal)
    with np.errstate(divide="ignore", invalid="ignore"):
        spacing = distance * scanner.angular_step / np.maximum(cosine, 1e-6)
    power = scanner.power(distance, np.maximum(cosine, 1e-6), np.full(len(distance), USUAL_REFLECTANCE))
    sigma = np.hypot(scanner.sigma(power) * np.maximum(cosine, 0.0), need.registration_sigma)
    good = (cosine > math.cos(need.max_incidence)) & (distance <= need.range_max) & (distance >= scanner.range_min)
    good &= (spacing <= need.spacing) & (2.0 * sigma <= need.bound)
    if math.isfinite(need.range_max):
        # across a slender face there must be room for a beam as a whole, wherever the grid of beams lies
        clear = targets.width * np.sqrt(np.maximum(1.0 - np.einsum("ij,ij->i", ray, targets.across) ** 2, 0.0))
        good &= clear >= distance * scanner.angular_step + 2.0 * scanner.beam_radius(distance)
        good &= 1.0 / (1.0 + (scanner.weakest_power / np.maximum(power, 1e-12)) ** 4) >= CERTAIN_RETURN
        elevation = np.arcsin(np.clip(ray[:, 2], -1.0, 1.0))
        good &= elevation >= scanner.elevation_min + EDGE_OF_VIEW_RAD
        if scanner.elevation_max < math.pi / 2 - 1e-6:
            good &= elevation <= scanner.elevation_max - EDGE_OF_VIEW_RAD
    at = np.flatnonzero(good)
    good[at] = scene.cast(position, ray[at]).distance > distance[at] - SIGHT_TOLERANCE_M
    return good, spacing, sigma


def view_matrix(
    scene: Scene, positions: Array, targets: Targets, scanner: Scanner, need: Requirement, progress: Progress
) -> NDArray[np.bool_]:
    """(C, P) whether each place measures each target as required."""
    out = np.zeros((len(positions), len(targets)), dtype=np.bool_)
    for k, position in enumerate(positions):
        progress.update(k / max(len(positions), 1), f"Looking from place {k + 1} of {len(positions)}")
        out[k] = measured_well(scene, position, targets, scanner, need)[0]
    return out
