"""The errors that the returns of a campaign share, estimated once from all elements."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..model.samples import SurfaceSamples
from .blocks import Blocks, block_means
from .registration import Registration, estimate_registration
from .sightings import AT, Sightings
from .unevenness import Unevenness, estimate_unevenness

LEAST_COSINE = 0.35
"""Flatter returns tell of the direction's error and of edges more than of the surface."""


@dataclass(frozen=True)
class ErrorModel:
    """What estimates of displacement count as errors."""

    sigma: float
    """Of a return along its ray, metres, as stated for the sensor."""
    registration: Registration
    unevenness: Unevenness
    body: NDArray[np.int64]
    """(S + 1,) of each station the first that shares its registration: itself, or the first camera of its block; last, that
    of dense points."""


def estimate_errors(
    seen: Sightings, samples: SurfaceSamples, sigma: float, window: float, stations: int,
    registration_sigma: float | None = None, body: NDArray[np.int64] | None = None,
) -> ErrorModel:
    """Estimate from what was seen within ``window`` [m] of the planned surfaces; a given ``registration_sigma`` [m] is
    taken as known. ``body`` (S + 1,) see ``ErrorModel``; without it every station is one of its own."""
    body = np.arange(stations + 1) if body is None else body
    use = seen.on_face & (seen.state(window) == AT) & (seen.cosine > LEAST_COSINE)
    own = seen.rows(use)
    element = samples.element[own.sample]
    edge = np.flatnonzero(np.diff(element, prepend=-1, append=-1)) if len(own) else np.zeros(0, np.int64)
    blocks: list[Blocks] = [block_means(own.rows(slice(a, b)), sigma, body) for a, b in pairwise(edge.tolist())]
    registration = (
        Registration(registration_sigma, np.inf) if registration_sigma is not None
        else estimate_registration(blocks, stations)
    )
    return ErrorModel(sigma, registration, estimate_unevenness(blocks), body)
