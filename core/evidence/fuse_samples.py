"""Masses, deviation and sigma per query position, from what the stations saw."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from ..options import FusionRule
from ..results import SampleEvidence
from .blocks import row_numbers
from .fusion import RULES, from_log_commonality
from .sightings import AT, NUMBERS_OF_BODY, RAYLESS, Sightings

SMALLEST_VARIANCE_M2 = 1e-12


def fuse_samples(
    count: int, sightings: Sightings, rule: FusionRule, half_zone: float, shared_sigma: float, cap: float,
    sigma: float, window: float,
) -> SampleEvidence:
    """Fuse all sightings (any order) of ``count`` query positions.

    ``station`` fuses the returns of a station by Dempster's rule, discounts the outcome by where the surface that the
    station saw lies (``_contextual_discount``) and fuses the stations by Dempster's rule. The named rules fuse all returns of
    all stations at once.
    """
    own = sightings.rows(sightings.on_face & ~(sightings.glass & (sightings.deviation < -window)))
    logs = own.log_masses
    if rule == "station":
        masses, _ = from_log_commonality(logs[:, 0], logs[:, 1], logs[:, 2])
        spread = np.sqrt(_deviation_variance(own, sigma) + shared_sigma**2)
        occ, emp = cap * _contextual_discount(masses, own.deviation, spread, half_zone)
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


def _contextual_discount(
    masses: NDArray[np.float64], deviation: NDArray[np.float64], spread: NDArray[np.float64], half_zone: float
) -> NDArray[np.float64]:
    """(2, M) what is kept of a station's occupied and empty masses, after Mercier et al. (2008).

    The mass of occupied is kept with the probability that the surface seen lies within ``half_zone`` of the plan, that of
    empty with the probability that it lies beyond; the rest becomes unknown. masses (M, 3); deviation (M,), its standard
    deviation ``spread`` (M,), which holds the error that a station's returns share, and ``half_zone``: metres along the normal.
    """
    near = ndtr((-half_zone - deviation) / spread)
    return np.stack([masses[:, 0] * (ndtr((half_zone - deviation) / spread) - near), masses[:, 1] * near])


def _deviation_variance(seen: Sightings, sigma: float) -> NDArray[np.float64]:
    """(M,) of the mean of the returns of a sighting along the normal, square metres."""
    variance = (sigma * np.maximum(seen.cosine.astype(np.float64), 0.2)) ** 2 / np.maximum(seen.count, 1)
    if not seen.photo.shape[1]:
        return variance
    own, shared = seen.photo[:, 0], seen.photo[:, 1]
    of_photos = np.maximum(own**2 - shared**2, 0.0) / np.maximum(seen.count, 1) + shared**2
    return np.where(seen.from_photos, np.maximum(of_photos, SMALLEST_VARIANCE_M2), variance)


def _local_deviation(
    count: int, own: Sightings, sigma: float, window: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Weighted mean of the stations' deviations (N,) and its standard deviation (N,), metres; NaN without any."""
    near = own.rows(own.state(window) == AT)
    weight = 1.0 / (_deviation_variance(near, sigma) * _cameras(near))
    total = np.bincount(near.sample, weight, minlength=count)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.bincount(near.sample, weight * near.deviation, minlength=count) / total
        spread = np.where(total > 0, 1.0 / np.sqrt(total), np.nan)
    return mean, spread


def _cameras(near: Sightings) -> NDArray[np.float64] | float:
    """(M,) cameras of one block that look at the same query: a tie point's error does not average out over them."""
    if not near.photo.shape[1] or not len(near):
        return 1.0
    body = np.where(near.station == RAYLESS, -1, near.photo[:, 3] // NUMBERS_OF_BODY)
    body = np.where(near.from_photos, body, -2.0 - near.station)
    _, same = np.unique(row_numbers(np.column_stack([near.sample, body]).astype(np.int64)), return_inverse=True)
    return np.bincount(same)[same].astype(np.float64)
