"""Noise of surfaces and of edges, and how well stations agree where they overlap."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import gammaln

from ..model.raycast import RayScene
from ..model.samples import SurfaceSamples
from .survey import Survey

Array = NDArray[np.float64]
FEWEST_EDGE_RETURNS = 60
LEAST_SHAPE, MOST_SHAPE = 0.2, 8.0
GRAZE = 0.1
WINSOR = 9.0
"""A variance between stations counts for no more than this many times the usual one."""
MEDIAN_OF_CHI2 = 0.455
"""Of one degree of freedom."""


@dataclass(frozen=True)
class GeneralGaussian:
    """Generalised Gaussian distribution p(x) ~ exp(-(|x| / alpha)^beta): beta 2 is Gauss, 1 is Laplace."""

    sigma: float
    """Standard deviation, metres."""
    beta: float
    count: int


def fit_general_gaussian(residual: Array) -> GeneralGaussian | None:
    """Fit by the ratio of moments: E|x| / sqrt(E x^2) = Gamma(2/b) / sqrt(Gamma(1/b) Gamma(3/b)) (Mallat 1989).

    None with fewer than 60 residuals.
    """
    if len(residual) < FEWEST_EDGE_RETURNS:
        return None
    sigma = float(np.sqrt(np.mean(residual**2)))
    if sigma <= 0:
        return GeneralGaussian(0.0, 2.0, len(residual))
    ratio = float(np.mean(np.abs(residual))) / sigma

    def excess(beta: float) -> float:
        return float(math.exp(gammaln(2 / beta) - 0.5 * (gammaln(1 / beta) + gammaln(3 / beta)))) - ratio

    if excess(LEAST_SHAPE) >= 0:
        beta = LEAST_SHAPE
    elif excess(MOST_SHAPE) <= 0:
        beta = MOST_SHAPE
    else:
        beta = float(brentq(excess, LEAST_SHAPE, MOST_SHAPE, xtol=1e-3))
    return GeneralGaussian(sigma, beta, len(residual))


@dataclass(frozen=True)
class EdgeStudy:
    """Returns near edges (K,): their residual from the planned surface they lie on, and those on none."""

    element: NDArray[np.int32]
    """Element of the sample they were found at."""
    residual: Array
    """Metres along the normal, less the face's own offset; NaN for a return in mid-air."""


def study_edges(
    found: Survey, samples: SurfaceSamples, scene: RayScene, positions: Array, face: NDArray[np.int64], window: float
) -> EdgeStudy:
    """Residuals of the returns near edges. ``face`` (N,) numbers the flat faces of the elements per sample.

    A return near an edge lies on the front surface, on what is behind it, or on nothing (a mixed pixel); the surface that
    its ray meets closest to it decides. The median offset of a face is the building's, not noise.
    """
    if not found.edge_point:
        return EdgeStudy(np.zeros(0, np.int32), np.zeros(0))
    point = np.concatenate(found.edge_point)
    sample = np.concatenate(found.edge_sample)
    station = np.concatenate(found.edge_station)
    ray = point - positions[station]
    ray /= np.maximum(np.linalg.norm(ray, axis=1, keepdims=True), 1e-9)
    back = window / GRAZE
    hits = scene.all_hits(point - back * ray, ray, 2 * back, most=6)
    residual = np.full(len(point), np.nan)
    for distance, triangle in zip(hits.distance, hits.triangle, strict=True):
        slope = np.einsum("ij,ij->i", ray, scene.normal[triangle])
        with np.errstate(invalid="ignore"):
            away = (back - distance) * slope
        met = (triangle >= 0) & (np.abs(away) <= window)
        better = met & ~(np.abs(residual) <= np.abs(away))
        residual[better] = away[better]
    order = np.argsort(face[sample], kind="stable")
    edge = np.flatnonzero(np.diff(face[sample][order], prepend=-1, append=-1))
    for begin, end in pairwise(edge):
        own = order[begin:end]
        known = own[np.isfinite(residual[own])]
        if len(known):
            residual[known] -= np.median(residual[known])
    return EdgeStudy(samples.element[sample], residual)


@dataclass(frozen=True)
class OverlapResiduals:
    """How far the stations' surfaces lie apart where they see the same one; metres."""

    square: Array
    """Per sample (N,): variance between stations beyond noise, times its degrees of freedom."""
    freedom: Array
    """Per sample (N,): stations less one; 0 where fewer than two can be compared."""
    station_bias: Array
    """Per station (S,): usual size (from the median) of its offset from the other stations; NaN without overlap."""

    def between(self, rows: slice | NDArray[np.int64]) -> float:
        """Standard deviation of one station against the others over these samples; NaN without overlap."""
        freedom = self.freedom[rows]
        known = freedom > 0
        if not known.any():
            return math.nan
        variance = self.square[rows][known] / freedom[known]
        # where layers lie behind each other, two stations may have fitted different ones
        limit = WINSOR * max(float(np.median(np.maximum(variance, 0.0))) / MEDIAN_OF_CHI2, 1e-12)
        return math.sqrt(max(float(np.average(np.minimum(variance, limit), weights=freedom[known])), 0.0))


def compare_stations(found: Survey, count: int) -> OverlapResiduals:
    """Compare the local planes of all stations at the samples that several see."""
    number, total, total2, noise = (np.zeros(count) for _ in range(4))
    joined = []
    for o in found.overlap:
        row = np.concatenate(o.row) if o.row else np.zeros(0, np.int64)
        offset = np.concatenate(o.offset) if o.offset else np.zeros(0)
        variance = np.concatenate(o.variance) if o.variance else np.zeros(0)
        joined.append((row, offset))
        number[row] += 1
        total[row] += offset
        total2[row] += offset**2
        noise[row] += variance
    several = number >= 2
    n = np.maximum(number, 1)
    square = np.where(several, total2 - total**2 / n - noise * (n - 1) / n, 0.0)
    bias = np.full(len(joined), np.nan)
    for s, (row, offset) in enumerate(joined):
        use = several[row]
        r = row[use]
        if len(r):
            others = (total[r] - offset[use]) / (number[r] - 1)
            bias[s] = 1.4826 * float(np.median(np.abs(offset[use] - others)))
    return OverlapResiduals(square, np.where(several, number - 1, 0.0), bias)
