"""What neighbouring returns share: unevenness of the surface and correlated error, estimated from the residuals.

Residuals are averaged in cells of the plane. The cells' means are taken as a smooth error with an exponential correlation,
averaged over the cells, and an independent remainder; both are estimated by restricted maximum likelihood, which counts the
three parameters that the fit has taken out of the residuals. The plane's covariance then holds the smooth part as well, and
does not fall with the number of returns where their errors are shared.
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
LENGTHS = np.array([0.03, 0.06, 0.12, 0.25, 0.5])
"""Correlation lengths, shares of the surface's extent."""
NEAR = np.geomspace(0.35, 2.83, 7)
"""Around the best of them, factors."""

_nodes, _weights = np.polynomial.legendre.leggauss(3)
OFFSET = np.concatenate([_nodes - 1.0, _nodes + 1.0]) / 2.0
"""How far two places in two cells are apart beyond the cells themselves, as shares of a cell, for integration ..."""
OFFSET_WEIGHT = 0.5 * np.tile(_weights, 2) * (1.0 - np.abs(OFFSET))
"""... with their weights: the difference of two evenly distributed numbers."""


@dataclass(frozen=True)
class Unevenness:
    """A smooth error of a surface: standard deviation [m], correlation length [m] (exponential), and the cells' count."""

    sigma: float
    length: float
    white_sigma: float
    """Independent part of one return along the normal [m], from the scatter within cells."""
    cells: int
    sigma_spread: float = 0.0
    """Standard deviation of ``sigma`` as far as the residuals leave it open [m]."""


@dataclass(frozen=True)
class _Cells:
    number: NDArray[np.int64]
    """(K, 2) which cell of the grid."""
    size: Array
    """(2,) metres."""
    mean: Array
    count: Array
    index: NDArray[np.int64]
    within: float
    """Variance of the residuals within the cells."""

    def correlation(self, length: float) -> Array:
        """(K, K) of the cells' means of an error whose correlation falls exponentially with ``length`` [m]."""
        steps = [np.arange(n) for n in self.number.max(axis=0) + 1]
        x, y = ((step[:, None] + OFFSET) * size for step, size in zip(steps, self.size, strict=True))
        apart = np.hypot(x[:, None, :, None], y[None, :, None, :])
        table = np.einsum("abpq,p,q->ab", np.exp(-apart / length), OFFSET_WEIGHT, OFFSET_WEIGHT)
        off = np.abs(self.number[:, None] - self.number[None])
        return np.asarray(table[off[..., 0], off[..., 1]])


def _explored(cells: _Cells, variances: Array, lengths: Array) -> Array:
    """(L, V) twice the negative restricted log-likelihood of smooth variances [m2] and correlation lengths [m]."""
    noise = np.diag(cells.within / cells.count)
    place = cells.number * cells.size
    wide = np.ptp(place, axis=0) > 0  # one row of cells cannot tell a turn about itself
    design = np.column_stack([np.ones(len(place)), (place - place.mean(axis=0))[:, wide]])
    out = np.empty((len(lengths), len(variances)))
    for row, length in enumerate(lengths):
        correlation = cells.correlation(float(length))
        out[row] = [_restricted(cells.mean, design, v * correlation + noise) for v in variances]
    return out


def _likely(cells: _Cells) -> tuple[Array, Array, Array]:
    """(V,) smooth variances [m2], (L,) correlation lengths [m], and how likely each pair is (L, V), all together 1."""
    unit = float((cells.within / cells.count).mean())
    extent = float(np.linalg.norm(np.ptp(cells.number, axis=0) * cells.size))
    variances, lengths = RATIOS * unit, extent * LENGTHS
    value = _explored(cells, variances, lengths)
    length, variance = np.unravel_index(np.argmin(value), value.shape)
    if variances[variance] > 0:
        variances, lengths = variances[variance] * NEAR, lengths[length] * NEAR
        value = _explored(cells, variances, lengths)
    weight = np.exp(-0.5 * (value - value.min()))
    return variances, lengths, weight / weight.sum()


def with_unevenness(plane: Plane, points: Array) -> tuple[Plane, Unevenness | None]:
    """The plane with the smooth error of its surface in its covariance, and the independent part scaled to what the
    residuals show; and that smooth error, None where too little is seen of it.

    The residuals leave open how large and how long the smooth error is: the covariance is the mean over what is likely.
    """
    cells = _cells(plane, points)
    if cells is None:
        return plane.replaced(covariance=plane.covariance * max(plane.variance_factor, 1.0)), None
    variances, lengths, likely = _likely(cells)
    q = np.asarray(points, dtype=np.float64) - plane.centroid
    at = q @ plane.axes.T
    spread = (at**2).sum(axis=0)
    # turns by least squares of the heights: -(e . q) / sum (e . q)^2; the shift is their mean
    gradient = np.column_stack([-at / spread, np.full(len(q), 1.0 / len(q))])
    share = np.stack([np.bincount(cells.index, gradient[:, k], len(cells.mean)) for k in range(3)], axis=1)
    smooth = np.zeros((3, 3))
    for length, variance in zip(lengths, likely @ variances, strict=True):
        smooth += variance * share.T @ cells.correlation(float(length)) @ share
    predicted = plane.residual_sigma**2 / max(plane.variance_factor, 1e-12)
    white = plane.covariance * (cells.within / max(predicted, 1e-18))
    row, column = np.unravel_index(np.argmax(likely), likely.shape)
    sigmas, weight = np.sqrt(variances), likely.sum(axis=0)
    spread = float(np.sqrt(np.maximum(weight @ sigmas**2 - (weight @ sigmas) ** 2, 0.0)))
    found = Unevenness(float(sigmas[column]), float(lengths[row]), float(np.sqrt(cells.within)), len(cells.mean), spread)
    return plane.replaced(covariance=white + smooth), found


def _cells(plane: Plane, points: Array) -> _Cells | None:
    q = np.asarray(points, dtype=np.float64) - plane.centroid
    at, off = q @ plane.axes.T, q @ plane.normal
    low, span = at.min(axis=0), np.maximum(np.ptp(at, axis=0), 1e-6)
    size = max(float(np.sqrt(span.prod() / MOST_CELLS)), float(span.max()) / 60, SMALLEST_CELL_M)
    grid = np.minimum((span / size).astype(np.int64) + 1, 100)
    number = np.minimum(((at - low) / size).astype(np.int64), grid - 1)
    used, first, index = np.unique(number[:, 0] * grid[1] + number[:, 1], return_index=True, return_inverse=True)
    index = index.ravel().astype(np.int64)
    count = np.bincount(index).astype(np.float64)
    if len(used) < LEAST_CELLS or len(points) - len(used) < 20:
        return None
    mean = np.bincount(index, off) / count
    within = float(((off - mean[index]) ** 2).sum() / (len(points) - len(used)))
    return _Cells(number[first], np.full(2, size), mean, count, index, max(within, 1e-14))


def _restricted(values: Array, design: Array, covariance: Array) -> float:
    """Twice the negative restricted log-likelihood."""
    factor = cho_factor(covariance, lower=True, check_finite=False)
    solved = cho_solve(factor, np.column_stack([design, values]), check_finite=False)
    normal = design.T @ solved[:, :-1]
    right = design.T @ solved[:, -1]
    rest = float(values @ solved[:, -1] - right @ np.linalg.solve(normal, right))
    return 2.0 * float(np.log(np.diag(factor[0])).sum()) + float(np.linalg.slogdet(normal)[1]) + rest
