"""Levels that a scan supports, and what to do where it supports less than asked for."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..results import LEVELS
from ..sensing.loa import UPPER_BOUND_M
from .results import Measured

GSA_ERROR_M = {1: 0.051, 2: 0.013, 3: 0.006, 4: 0.003}
"""Tolerance of the as-built model per level of detail (U.S. General Services Administration, BIM guide 03)."""
GSA_ARTEFACT_M = {1: 0.152, 2: 0.025, 3: 0.013, 4: 0.013}
"""Smallest thing that must show: the returns may be no farther apart."""
ACTIONS = {
    "AO": "avoid the occlusion from a new position",
    "RA": "reduce the incidence angle from a new position",
    "RD": "reduce the distance from a new position",
    "IN": "increase the angular resolution at a new position",
    "IR": "increase the angular resolution at the same position",
}
LEAST_SHARE = 0.05
"""A cause that takes less of the surface asks for no action of its own."""
STEEP = math.radians(60.0)
"""Beyond it the incidence angle dominates spacing and noise (Soudarissanane et al. 2009)."""
FINEST_GAIN = 4.0
"""Scanners offer steps up to about this many times finer than a usual one; a larger lack asks for a nearer position."""


def gsa_level(error: float | None, spacing: float | None, coverage: float, least_coverage: float) -> int:
    """Highest GSA level whose tolerance holds the error and whose artefact holds the spacing; 0 for none."""
    if error is None or spacing is None or coverage < least_coverage:
        return 0
    return max((k for k in GSA_ERROR_M if error <= GSA_ERROR_M[k] and spacing <= GSA_ARTEFACT_M[k]), default=0)


def supported_loa(sigma: float | None, error: float | None, coverage: float, least_coverage: float) -> int | None:
    """Highest level whose bound holds two sigma of a measured position and the expected error of the model."""
    if sigma is None or error is None or coverage < least_coverage:
        return None
    bound = max(2.0 * sigma, error)
    return max((level for level in LEVELS if bound <= UPPER_BOUND_M[level]), default=None)


@dataclass(frozen=True)
class Need:
    """What an element lacks for a level."""

    coverage: bool
    spacing: float
    """Factor by which the returns are too far apart for the expected error; 1 or less: none."""
    noise: bool


def corrective_actions(measured: Measured, need: Need) -> tuple[str, ...]:
    """Which of the five corrective actions answer what is lacking, most needed first."""
    wanted: dict[str, float] = {}
    missing = measured.missing
    if need.coverage:
        for cause, action in (
            ("occluded", "AO"), ("too grazing", "RA"), ("out of range", "RD"), ("outside the field of view", "AO"),
        ):
            if missing.get(cause, 0.0) >= LEAST_SHARE:
                wanted[action] = wanted.get(action, 0.0) + missing[cause]
    steep = measured.incidence_median is not None and measured.incidence_median > STEEP
    if measured.coverage > 0 and need.spacing > 1.0:
        if steep:
            wanted.setdefault("RA", 0.01)
        elif need.spacing <= FINEST_GAIN:
            wanted.setdefault("IR", 0.01)
        else:
            wanted.setdefault("RD", 0.01)
            wanted.setdefault("IN", 0.005)
    if measured.coverage > 0 and need.noise:
        wanted.setdefault("RA" if steep else "RD", 0.008)
    return tuple(sorted(wanted, key=lambda action: -wanted[action]))
