"""What the returns on one flat face are like: apart from each other on the whole and across each of its sides, and noise."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.samples import SurfaceSamples
from .faces import Face
from .measure import LEAST_FREEDOM, quantiles
from .survey import Survey

Array = NDArray[np.float64]
ON_FACE_M = 0.01
STRIP_M = 0.1
"""Width of the strip along a side whose returns say where the side is drawn."""
STRIP_SHARE = 0.25
"""Of a slender face the strip is no more than this share."""
LEAST_IN_STRIP = 4
STEEPEST = 0.1
"""Cosine of incidence below which no spacing is made of."""


@dataclass(frozen=True)
class FaceReturns:
    """Lengths in metres. Sides in the order right, left, top, bottom."""

    spacing: float
    noise: float
    stations: float
    """Median number of stations that see a place."""
    across: Array
    """(4,) distance between returns across each side, from the inside towards it."""
    along: Array
    """(4,) the same along it."""
    seen: NDArray[np.bool_]
    """(4,) returns lie all along the strip beside the side."""


def face_returns(
    face: Face, rows: NDArray[np.int64], samples: SurfaceSamples, found: Survey, spacing: Array, positions: Array
) -> FaceReturns | None:
    """Measure on the exposed samples ``rows`` of the face's element; None where no return lies on the face.

    ``spacing`` (N,) of all samples, ``positions`` (S, 3) of the stations, local frame. A scanner's returns lie apart by
    r d / cos(incidence) in the direction in which it looks along the surface and by r d across it; ``spacing`` is the
    geometric mean of the two.
    """
    place = (samples.position[rows] - face.corner) @ face.axes.T
    on = (np.abs(place[:, 2]) < ON_FACE_M) & (samples.normal[rows] @ face.axes[2] > 0.9)
    rows, place = rows[on], place[on]
    seen = found.seen[rows]
    at = rows[seen]
    (middle,) = quantiles(spacing[at], samples.area[at], (0.5,))
    (stations,) = quantiles(found.stations[at].astype(np.float64), samples.area[at], (0.5,))
    noise = _noise(found, at)
    if middle is None or stations is None or noise is None:
        return None
    u, v = place[:, 0], place[:, 1]
    band_u, band_v = (min(STRIP_M, STRIP_SHARE * side) for side in (face.width, face.height))
    strips = (u > face.width - band_u, u < band_u, v > face.height - band_v, v < band_v)
    across, along, whole = np.full(4, middle), np.full(4, middle), np.zeros(4, np.bool_)
    for k, strip in enumerate(strips):
        near = rows[strip & seen]
        whole[k] = strip.sum() >= LEAST_IN_STRIP and seen[strip].mean() >= 0.98
        if len(near) < LEAST_IN_STRIP:
            continue
        apart = spacing[near]
        stretch = _stretch(face, near, samples, found, positions, 0 if k < 2 else 1)
        across[k], along[k] = float(np.median(apart * stretch)), float(np.median(apart / stretch))
    return FaceReturns(middle, noise, stations, across, along, whole)


def _noise(found: Survey, at: NDArray[np.int64]) -> float | None:
    for square, freedom in ((found.square, found.freedom), (found.square_near, found.freedom_near)):
        total = float(freedom[at].sum())
        if total >= LEAST_FREEDOM:
            return math.sqrt(float(square[at].sum()) / total)
    return None


def _stretch(
    face: Face, at: NDArray[np.int64], samples: SurfaceSamples, found: Survey, positions: Array, axis: int
) -> Array:
    """(K,) spacing along an axis of the face, 0 its width and 1 its height, over the geometric mean of both."""
    view = (samples.position[at] - positions[found.best.station[at]]) @ face.axes.T
    level = np.maximum(np.hypot(view[:, 0], view[:, 1]), 1e-9)
    share = (view[:, axis] / level) ** 2
    cosine = np.maximum(found.best.cosine[at], STEEPEST)
    return np.asarray(np.sqrt(share / cosine + (1.0 - share) * cosine))
