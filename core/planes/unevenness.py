"""What neighbouring returns share: unevenness of the surface and correlated error, estimated from the residuals.

Residuals are averaged in cells of the plane. The cells' means are taken as a smooth error with an exponential correlation
and an independent remainder; both are estimated by restricted maximum likelihood, which counts the three parameters that
the fit has taken out of the residuals. The plane's covariance then holds the smooth part as well, and does not fall with
the number of returns where their errors are shared.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from .fit import Plane

Array = NDArray[np.float64]

MOST_CELLS = 144
LEAST_CELLS = 9
SMALLEST_CELL_M = 0.04
RATIOS = np.concatenate([[0.0], np.geomspace(0.03, 3000.0, 12)])
"""Smooth variance over the independent variance of an average cell."""


@dataclass(frozen=True)
class Unevenness:
    """A smooth error of a surface: standard deviation [m], correlation length [m] (exponential), and the cells' count."""

    sigma: float
    length: float
    white_sigma: float
    """Independent part of one return along the normal [m], from the scatter within cells."""
    cells: int


@dataclass(frozen=True)
class _Cells:
    place: Array
    mean: Array
    count: Array
    index: NDArray[np.int64]
    within: float
    """Variance of the residuals within the cells."""


def estimate_unevenness(plane: Plane, points: Array) -> Unevenness | None:
    """The smooth error of the surface that (N, 3) points show about their plane; None where too little is seen."""
    cells = _cells(plane, points)
    if cells is None:
        return None
    noise = cells.within / cells.count
    distance = np.linalg.norm(cells.place[:, None] - cells.place[None], axis=2)
    design = np.column_stack([np.ones(len(cells.mean)), cells.place - cells.place.mean(axis=0)])
    extent = float(distance.max())
    unit = float(noise.mean())

    def better(best: tuple[float, float, float], lengths: Array, ratios: Array) -> tuple[float, float, float]:
        for length in lengths:
            correlation = np.exp(-distance / length)
            for ratio in ratios:
                value = _restricted(cells.mean, design, ratio * unit * correlation + np.diag(noise))
                if value < best[0] - 1e-9:
                    best = (value, float(ratio * unit), float(length))
        return best

    best = better((np.inf, 0.0, extent / 4), extent * np.array([0.03, 0.06, 0.12, 0.25, 0.5]), RATIOS)
    if best[1] > 0:
        best = better(best, best[2] * np.array([0.71, 1.0, 1.41]), best[1] / unit * np.array([0.6, 0.8, 1.0, 1.25, 1.7]))
    return Unevenness(float(np.sqrt(best[1])), best[2], float(np.sqrt(cells.within)), len(cells.mean))


def with_unevenness(plane: Plane, points: Array) -> tuple[Plane, Unevenness | None]:
    """The plane with the smooth error of its surface in its covariance, and the independent part scaled to what the
    residuals show; and that smooth error."""
    found = estimate_unevenness(plane, points)
    if found is None:
        return plane.replaced(covariance=plane.covariance * max(plane.variance_factor, 1.0)), None
    cells = _cells(plane, points)
    assert cells is not None
    q = np.asarray(points, dtype=np.float64) - plane.centroid
    at = q @ plane.axes.T
    spread = (at**2).sum(axis=0)
    # turns by least squares of the heights: -(e . q) / sum (e . q)^2; the shift is their mean
    gradient = np.column_stack([-at / spread, np.full(len(q), 1.0 / len(q))])
    share = np.stack([np.bincount(cells.index, gradient[:, k], len(cells.mean)) for k in range(3)], axis=1)
    distance = np.linalg.norm(cells.place[:, None] - cells.place[None], axis=2)
    smooth = share.T @ (found.sigma**2 * np.exp(-distance / found.length)) @ share
    predicted = plane.residual_sigma**2 / max(plane.variance_factor, 1e-12)
    white = plane.covariance * (found.white_sigma**2 / max(predicted, 1e-18))
    return plane.replaced(covariance=white + smooth), found


def _cells(plane: Plane, points: Array) -> _Cells | None:
    q = np.asarray(points, dtype=np.float64) - plane.centroid
    at, off = q @ plane.axes.T, q @ plane.normal
    low, span = at.min(axis=0), np.maximum(np.ptp(at, axis=0), 1e-6)
    size = max(float(np.sqrt(span.prod() / MOST_CELLS)), float(span.max()) / 60, SMALLEST_CELL_M)
    grid = np.minimum((span / size).astype(np.int64) + 1, 100)
    number = np.minimum(((at - low) / size).astype(np.int64), grid - 1)
    used, index = np.unique(number[:, 0] * grid[1] + number[:, 1], return_inverse=True)
    index = index.ravel().astype(np.int64)
    count = np.bincount(index).astype(np.float64)
    if len(used) < LEAST_CELLS or len(points) - len(used) < 20:
        return None
    mean = np.bincount(index, off) / count
    place = np.stack([np.bincount(index, at[:, k]) / count for k in range(2)], axis=1)
    within = float(((off - mean[index]) ** 2).sum() / (len(points) - len(used)))
    return _Cells(place, mean, count, index, max(within, 1e-14))


def _restricted(values: Array, design: Array, covariance: Array) -> float:
    """Twice the negative restricted log-likelihood."""
    factor = cho_factor(covariance, lower=True, check_finite=False)
    solved = cho_solve(factor, np.column_stack([design, values]), check_finite=False)
    normal = design.T @ solved[:, :-1]
    right = design.T @ solved[:, -1]
    rest = float(values @ solved[:, -1] - right @ np.linalg.solve(normal, right))
    return 2.0 * float(np.log(np.diag(factor[0])).sum()) + float(np.linalg.slogdet(normal)[1]) + rest
