"""How well do the stations agree? Their registration error, estimated from what they saw in common."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..model.samples import SurfaceSamples
from .displacement import block_means
from .sightings import AT, Sightings

FALLBACK_M = 0.002
"""Assumed where no surface was seen from two stations: a usual target- or cloud-based registration."""
LEAST_COSINE = 0.35
LEAST_RETURNS = 12
LEAST_PAIRS = 6
WINSOR = 3.0


def estimate_registration_sigma(seen: Sightings, samples: SurfaceSamples, sigma: float, window: float) -> float:
    """Standard deviation of a station's position along one axis, metres.

    Where several stations see the same face of the same element, their mean residuals differ by their registration errors
    alone: what was built, and the plan, are the same for all. For each such face the spread about the stations' mean is an
    estimate of the variance of a station along the face's normal, with one degree of freedom less than stations; every
    face direction of every element counts the same, so that one large slab does not speak for all directions.
    """
    use = seen.on_face & (seen.state(window) == AT) & (seen.cosine > LEAST_COSINE)
    own = seen.rows(use)
    if not len(own):
        return FALLBACK_M
    square, freedom = [], []
    element = samples.element[own.sample]
    edge = np.flatnonzero(np.diff(element, prepend=-1, append=-1))
    for begin, end in pairwise(edge):
        for s2, f in _faces(own.rows(np.arange(begin, end)), sigma):
            square.append(s2)
            freedom.append(f)
    if sum(freedom) < LEAST_PAIRS:
        return FALLBACK_M
    variance, weight = np.array(square), np.array(freedom, dtype=np.float64)
    limit = WINSOR**2 * max(float(np.median(variance)), 1e-12)
    return float(np.sqrt(max(np.average(np.minimum(variance, limit), weights=weight), 0.0)))


def _faces(own: Sightings, sigma: float) -> list[tuple[float, int]]:
    """(variance beyond noise, degrees of freedom) of each face direction that several stations saw."""
    blocks = block_means(own, sigma)
    found = []
    face = np.unique(np.round(blocks.normal * 3).astype(np.int64), axis=0, return_inverse=True)[1].ravel()
    for k in range(int(face.max()) + 1):
        of = face == k
        means, noise = _per_station(blocks.residual[of], blocks.variance[of], blocks.count[of], blocks.station[of])
        if len(means) >= 2:
            found.append((float(means.var(ddof=1) - noise.mean()), len(means) - 1))
    return found


def _per_station(
    residual: NDArray[np.float64], variance: NDArray[np.float64], count: NDArray[np.float64], station: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    means, noise = [], []
    for s in np.unique(station):
        of = station == s
        if count[of].sum() >= LEAST_RETURNS:
            means.append(float(np.median(residual[of])))
            noise.append(1.57 * float(variance[of].mean()) / of.sum())
    return np.array(means), np.array(noise)
