"""Masses, deviation and sigma per query position, from what the stations saw."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

from ..options import FusionRule
from ..results import SampleEvidence
from .fusion import RULES, from_log_commonality
from .sightings import Sightings


def station_reliability(half_zone: float, shared_sigma: float, cap: float) -> float:
    """Probability that a station's shared error (registration, calibration) stays inside the occupied zone, at most cap."""
    inside = 1.0 if shared_sigma <= 0 else float(erf(half_zone / (math.sqrt(2.0) * shared_sigma)))
    return cap * inside


def fuse_samples(
    count: int, sightings: Sightings, rule: FusionRule, half_zone: float, shared_sigma: float, cap: float,
    sigma: float, window: float,
) -> SampleEvidence:
    """Fuse all sightings (any order) of ``count`` query positions.

    ``station`` fuses the returns of a station by Dempster's rule, discounts the outcome by the station's shared error and
    fuses the stations by Dempster's rule. The named rules fuse all returns of all stations at once.
    """
    own = sightings.rows(sightings.on_face & ~(sightings.glass & (sightings.deviation < -window)))
    logs = own.log_masses
    if rule == "station":
        masses, _ = from_log_commonality(logs[:, 0], logs[:, 1], logs[:, 2])
        kept = station_reliability(half_zone, shared_sigma, cap)
        occ, emp = kept * masses[:, 0], kept * masses[:, 1]
        logs = np.column_stack([np.log1p(-emp), np.log1p(-occ), np.log(1.0 - occ - emp)])
    total = np.column_stack([np.bincount(own.sample, logs[:, k], minlength=count).astype(np.float64) for k in range(3)])
    fused, conflict = from_log_commonality(total[:, 0], total[:, 1], total[:, 2])
    if rule in RULES and RULES[rule] is not RULES["dempster"]:
        fused = fused * (1.0 - conflict[:, None])
        fused[:, 2] += conflict
    deviation, spread = _local_deviation(count, own, sigma, window)
    return SampleEvidence(
        m_occ=fused[:, 0].astype(np.float32), m_emp=fused[:, 1].astype(np.float32),
        m_unk=fused[:, 2].astype(np.float32), conflict=conflict.astype(np.float32),
        deviation=deviation.astype(np.float32), sigma=spread.astype(np.float32),
    )


def _local_deviation(
    count: int, own: Sightings, sigma: float, window: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Weighted mean of the stations' deviations (N,) and its standard deviation (N,), metres; NaN without any."""
    near = own.rows((np.abs(own.deviation) <= window) & ~own.explained)
    variance = (sigma * np.maximum(near.cosine.astype(np.float64), 0.2)) ** 2 / np.maximum(near.count, 1)
    weight = 1.0 / variance
    total = np.bincount(near.sample, weight, minlength=count)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.bincount(near.sample, weight * near.deviation, minlength=count) / total
        spread = np.where(total > 0, 1.0 / np.sqrt(total), np.nan)
    return mean, spread
