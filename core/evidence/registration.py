"""How well do the stations agree? Their registration error, estimated from what they saw in common."""

from __future__ import annotations

import numpy as np

from ..model.samples import SurfaceSamples
from .sightings import AT, Sightings

BLOCK_M = 0.5
FALLBACK_M = 0.002
"""Assumed where no surface was seen from two stations: a usual target- or cloud-based registration."""
LEAST_PAIRS = 20


def estimate_registration_sigma(seen: Sightings, samples: SurfaceSamples, sigma: float, window: float) -> float:
    """Standard deviation of a station's position along one axis, metres.

    Where two stations see the same block of the same face, their mean deviations differ by their registration errors
    alone: what was built, and the plan, are the same for both. The spread of these differences, less what the returns'
    own noise explains, is twice the variance of one station.
    """
    use = np.flatnonzero(seen.on_face & (seen.state(window) == AT) & (seen.cosine > 0.35))
    if not len(use):
        return FALLBACK_M
    sample = seen.sample[use]
    cell = np.floor(samples.position[sample] / BLOCK_M).astype(np.int64)
    face = np.round(samples.normal[sample] * 3).astype(np.int64)
    key = np.column_stack([samples.element[sample], cell, face])
    _, block = np.unique(key, axis=0, return_inverse=True)
    block = block.ravel()
    pair_key = block.astype(np.int64) * (int(seen.station.max()) + 1) + seen.station[use]
    pairs, inverse, size = np.unique(pair_key, return_inverse=True, return_counts=True)
    mean = np.bincount(inverse.ravel(), seen.deviation[use]) / size
    noise = np.bincount(inverse.ravel(), sigma**2 / np.maximum(seen.count[use], 1)) / size
    enough = size >= 4
    owner, mean, noise = pairs[enough] // (int(seen.station.max()) + 1), mean[enough], noise[enough]
    same = owner[1:] == owner[:-1]
    if same.sum() < LEAST_PAIRS:
        return FALLBACK_M
    difference = (mean[1:] - mean[:-1])[same]
    expected = (noise[1:] + noise[:-1])[same]
    spread = 1.4826 * float(np.median(np.abs(difference)))
    return float(np.sqrt(max(spread**2 - float(np.median(expected)), 0.0) / 2.0))
