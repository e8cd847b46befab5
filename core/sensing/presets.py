"""Parameters of the belief masses: derived from the sensor, or named presets of the literature."""

from __future__ import annotations

import math
from dataclasses import dataclass

LOGISTIC = math.pi / math.sqrt(3.0)
"""Standard deviation of the standard logistic distribution."""
ZONE_SIGMAS = 2.0
"""Half-length of the occupied zone in standard deviations: the level's 95 % bound."""


@dataclass(frozen=True)
class MassParameters:
    """c (longitudinal extent), lambda [1/m] (sharpness of the transition), kappa [1/m2] (transverse extent)."""

    c: float
    lam: float
    kappa: float


PRESETS: dict[str, MassParameters] = {
    "tls": MassParameters(3.0, 600.0, 20000.0),
    "tls-grazing": MassParameters(7.0, 600.0, 20000.0),
    "tie-points": MassParameters(4.0, 800.0, 15000.0),
    "tie-points-fine": MassParameters(5.0, 1500.0, 75000.0),
    "dense-points": MassParameters(4.0, 1200.0, 6000.0),
    "dense-points-fine": MassParameters(5.0, 2500.0, 70000.0),
}


def derived_masses(sigma: float, model_sigma: float, spacing: float) -> MassParameters:
    """Of points with this standard deviation, ``spacing`` apart on a surface met head on, plan of ``model_sigma``; metres."""
    lam = derive_lambda(math.hypot(sigma, model_sigma))
    return MassParameters(ZONE_SIGMAS * LOGISTIC, lam, derive_kappa(spacing))


def derive_lambda(sigma: float) -> float:
    """lambda [1/m] whose logistic transition has standard deviation ``sigma`` [m]: pi / (sqrt(3) sigma)."""
    return LOGISTIC / sigma


def derive_c(half_length: float, lam: float) -> float:
    """c for an occupied zone of this half-length [m]: c = lambda * half_length."""
    return lam * half_length


def derive_kappa(spacing: float) -> float:
    """kappa [1/m2] whose full width at half maximum is twice the point spacing [m]: ln 2 / spacing^2."""
    return math.log(2.0) / spacing**2
