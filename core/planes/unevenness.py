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

from .fit import Plane

Array = NDArray[np.float64]

MOST_CELLS = 144
LEAST_CELLS = 9
SMALLEST_CELL_M = 0.04
RATIOS = np.concatenate([[0.0], np.geomspace(0.03, 3000.0, 56)])
"""Smooth standard deviation over that of the noise of an average cell's mean; all as likely as each other beforehand."""
LENGTHS = np.geomspace(0.02, 10.0, 12)
"""Correlation lengths, shares of the surface's extent."""
SHORTEST = 0.02
"""Share of the extent: how soon lengths grow unlikely downwards."""
BEFOREHAND = np.exp(-SHORTEST / LENGTHS) / LENGTHS
"""Of the lengths: the penalised complexity prior of a field in the plane (Fuglstad, Simpson, Lindgren and Rue 2019). How
often intervals hold hangs on it, because one surface does not tell how long its unevenness is."""

_nodes, _weights = np.polynomial.legendre.leggauss(3)
OFFSET = np.concatenate([_nodes - 1.0, _nodes + 1.0]) / 2.0
"""How far two places in two cells are apart beyond the cells themselves, as shares of a cell, for integration ..."""
OFFSET_WEIGHT = 0.5 * np.tile(_weights, 2) * (1.0 - np.abs(OFFSET))
"""... with their weights: the difference of two evenly distributed numbers."""


@dataclass(frozen=True)
class Unevenness:
    """A smooth error of a surface, as far as its plane leaves it in the residuals."""

    sigma: float
    """Its standard deviation [m]."""
    length: float
    """The likeliest correlation length (exponential) [m]."""
    white_sigma: float
    """Independent part of one return along the normal [m], from the scatter within cells."""
    cells: int
    sigma_spread: float = 0.0
    """Standard deviation of ``sigma`` as far as the residuals leave it open [m]."""
    interval_95: tuple[float, float] = (0.0, 0.0)
    """Within which ``sigma`` is likely to be [m]; not symmetric, never below zero."""


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

    @property
    def unit(self) -> float:
        """Standard deviation of an average cell's mean from the noise alone [m]."""
        return float(np.sqrt(self.within / self.count.mean()))

    def correlation(self, length: float) -> Array:
        """(K, K) of the cells' means of an error whose correlation falls exponentially with ``length`` [m]."""
        steps = [np.arange(n) for n in self.number.max(axis=0) + 1]
        x, y = ((step[:, None] + OFFSET) * size for step, size in zip(steps, self.size, strict=True))
        apart = np.hypot(x[:, None, :, None], y[None, :, None, :])
        table = np.einsum("abpq,p,q->ab", np.exp(-apart / length), OFFSET_WEIGHT, OFFSET_WEIGHT)
        off = np.abs(self.number[:, None] - self.number[None])
        return np.asarray(table[off[..., 0], off[..., 1]])


@dataclass(frozen=True)
class _Likely:
    """Of each correlation length: what the residuals say."""

    lengths: Array
    """(L,) metres."""
    ratios: Array
    """(L, V) how likely each smooth variance is, all together 1."""
    rest: Array
    """(L,) share of a smooth variance that a fitted plane leaves in the residuals."""


def _likely(cells: _Cells) -> _Likely:
    """Restricted likelihood times what is likely beforehand, over ``RATIOS`` and ``LENGTHS``."""
    place = cells.number * cells.size
    extent = float(np.linalg.norm(np.ptp(place, axis=0)))
    wide = np.ptp(place, axis=0) > 0  # one row of cells cannot tell a turn about itself
    design = np.column_stack([np.ones(len(place)), (place - place.mean(axis=0))[:, wide]])
    weight = np.sqrt(cells.count / cells.count.mean())
    basis = np.linalg.qr(design * weight[:, None], mode="complete")[0][:, design.shape[1] :]
    plain = np.linalg.qr(design)[0]
    values = basis.T @ (cells.mean * weight) / cells.unit
    logs, rest = [], []
    for length in extent * LENGTHS:
        correlation = cells.correlation(float(length))
        own, axes = np.linalg.eigh(basis.T @ (weight[:, None] * correlation * weight) @ basis)
        spread = 1.0 + RATIOS[:, None] ** 2 * np.maximum(own, 0.0)
        logs.append(-0.5 * (np.log(spread) + (axes.T @ values) ** 2 / spread).sum(axis=1))
        rest.append(np.trace(correlation - plain @ (plain.T @ correlation)) / len(place))
    weights = np.exp(np.array(logs) - np.max(logs)) * BEFOREHAND[:, None]
    return _Likely(extent * LENGTHS, weights / weights.sum(), np.array(rest))


def with_unevenness(plane: Plane, points: Array) -> tuple[Plane, Unevenness | None]:
    """The plane with the smooth error of its surface in its covariance, and the independent part scaled to what the
    residuals show; and that smooth error, None where too little is seen of it.

    The residuals leave open how large and how long the smooth error is: the covariance is the mean over what is likely.
    """
    cells = _cells(plane, points)
    if cells is None:
        return plane.replaced(covariance=plane.covariance * max(plane.variance_factor, 1.0)), None
    likely = _likely(cells)
    q = np.asarray(points, dtype=np.float64) - plane.centroid
    at = q @ plane.axes.T
    # turns by least squares of the heights: -(e . q) / sum (e . q)^2; the shift is their mean
    gradient = np.column_stack([-at / (at**2).sum(axis=0), np.full(len(q), 1.0 / len(q))])
    share = np.stack([np.bincount(cells.index, gradient[:, k], len(cells.mean)) for k in range(3)], axis=1)
    smooth = np.zeros((3, 3))
    for length, variance in zip(likely.lengths, likely.ratios @ RATIOS**2 * cells.unit**2, strict=True):
        smooth += variance * share.T @ cells.correlation(float(length)) @ share
    predicted = plane.residual_sigma**2 / max(plane.variance_factor, 1e-12)
    white = plane.covariance * (cells.within / max(predicted, 1e-18))
    left = RATIOS * cells.unit * np.sqrt(np.maximum(likely.rest, 0.0))[:, None]
    sigma = float((likely.ratios * left).sum())
    spread = float(np.sqrt((likely.ratios * (left - sigma) ** 2).sum()))
    length = float(likely.lengths[np.argmax(likely.ratios.sum(axis=1))])
    found = Unevenness(sigma, length, float(np.sqrt(cells.within)), len(cells.mean), spread, _quantiles(left, likely.ratios))
    return plane.replaced(covariance=white + smooth), found


def _quantiles(values: Array, weights: Array) -> tuple[float, float]:
    """Of weighted values that 2.5 % lie below and above."""
    order = np.argsort(values, axis=None)
    below = np.cumsum(weights.ravel()[order])
    low, high = np.interp((0.025, 0.975), below / below[-1], values.ravel()[order])
    return float(low), float(high)


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
