"""How uneven built surfaces are, and over which distance: the error that neighbouring returns share.

Unevenness is taken as a stationary random field on each face, as in geostatistics: its semivariogram is estimated from
pairs of blocks on the same face seen from the same station, where the element's shift and the station's error cancel, and
pooled over all elements of the campaign. A small element cannot show a bump larger than itself; the large ones do.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.optimize import nnls

from .blocks import BLOCK_M, Blocks

Array = NDArray[np.float64]

LAGS_M = 0.8 * BLOCK_M * math.sqrt(2.0) ** np.arange(12)
"""Edges of the classes of distance."""
MOST_OF_FACE = 150
"""Blocks of a face and station that pairs are made of."""
LEAST_PAIRS = 30
WINSOR = 9.0
"""Squared differences beyond this multiple of the median (three sigma) are cut: edges, fittings, clutter that touches."""
POWERS = (1.0, 2.0)
"""Exponential (rough) and Gaussian (smooth) covariance."""


@dataclass(frozen=True)
class Unevenness:
    """Covariance of the unevenness of block means at distance h [m]: ``patch`` (h = 0) + sill exp(-(h / length)^power)."""

    patch: float = 0.0
    """m2: unevenness that neighbouring blocks do not share."""
    sill: float = 0.0
    """m2"""
    length: float = 1.0
    """Metres."""
    power: float = 1.0

    @property
    def variance(self) -> float:
        """m2 of one block."""
        return self.patch + self.sill

    def shared(self, blocks: Blocks, influence: Array) -> tuple[Array, float]:
        """What unevenness adds to estimates: (K, K) covariance [m2] of ``influence`` (K, B) times the blocks' residuals.

        Blocks of one face share unevenness whatever the station. Also returns the effective number of independent
        pieces of surface behind it.
        """
        return _pair_sums(
            blocks.point, blocks.face, blocks.cell, np.ascontiguousarray(influence), self.patch, self.sill, self.length,
            self.power,
        )


@njit(cache=True, nogil=True)
def _pair_sums(
    point: Array, face: NDArray[np.int64], cell: NDArray[np.int64], gain: Array,
    patch: float, sill: float, length: float, power: float,
) -> tuple[Array, float]:
    k, b = gain.shape
    total = np.zeros((k, k))
    square, weight = 0.0, 0.0
    size = np.zeros(b)
    for i in range(b):
        for m in range(k):
            size[i] += gain[m, i] ** 2
        size[i] = math.sqrt(size[i])
        weight += size[i]
    for i in range(b):
        for j in range(i, b):
            if face[i] != face[j]:
                continue
            h2 = 0.0
            for m in range(3):
                h2 += (point[i, m] - point[j, m]) ** 2
            h = math.sqrt(h2) / length
            shape = math.exp(-h if power == 1.0 else -h * h)
            value = sill * shape
            same = cell[i] == cell[j]
            if same:
                value += patch
            twice = 1.0 if i == j else 2.0
            correlation = 1.0 if same else shape
            square += twice * size[i] * size[j] * correlation**2
            for m in range(k):
                for n in range(k):
                    total[m, n] += 0.5 * twice * value * (gain[m, i] * gain[n, j] + gain[m, j] * gain[n, i])
    return total, weight * weight / max(square, 1e-300)


def estimate_unevenness(elements: Iterable[Blocks]) -> Unevenness:
    """Fit the covariance to the pooled semivariogram of the blocks of many elements; none where it cannot be seen."""
    value, pairs = semivariogram(elements)
    use = np.isfinite(value) & (pairs >= LEAST_PAIRS)
    if not use.any():
        return Unevenness()
    lag = np.sqrt(LAGS_M[:-1] * LAGS_M[1:])[use]
    gamma = value[use]
    weight = np.sqrt(pairs[use])
    best, least = Unevenness(), math.inf
    for power in POWERS:
        for length in np.geomspace(BLOCK_M / 2, max(float(lag[-1]) / 2, BLOCK_M), 16):
            rise = 1.0 - np.exp(-((lag / length) ** power))
            design = np.column_stack([np.ones_like(lag), rise])
            (patch, sill), misfit = nnls(design * weight[:, None], gamma * weight)
            if misfit < least * (1 - 1e-6):
                best, least = Unevenness(float(patch), float(sill), float(length), power), misfit
    return best


def semivariogram(elements: Iterable[Blocks]) -> tuple[Array, Array]:
    """(L,) semivariance beyond noise [m2] in the classes of distance between LAGS_M, and (L,) effective pairs."""
    found, weights = [], []
    for blocks in elements:
        for key in np.unique(blocks.face * 100_000 + blocks.station):
            own = np.flatnonzero(blocks.face * 100_000 + blocks.station == key)
            if len(own) < 2:
                continue
            own = own[:: -(-len(own) // MOST_OF_FACE)]
            value, weight = _of_face(blocks, own)
            found.append(value)
            weights.append(weight)
    if not found:
        return np.full(len(LAGS_M) - 1, np.nan), np.zeros(len(LAGS_M) - 1)
    values, counts = np.array(found), np.array(weights)
    out = np.full(values.shape[1], np.nan)
    for k in range(values.shape[1]):
        has = counts[:, k] > 0
        if has.any():
            v, w = values[has, k], counts[has, k]
            out[k] = np.average(np.minimum(v, WINSOR * _weighted_median(np.abs(v), w)), weights=w)
    return out, counts.sum(axis=0)


def _of_face(blocks: Blocks, own: NDArray[np.int64]) -> tuple[Array, Array]:
    i, j = np.triu_indices(len(own), 1)
    i, j = own[i], own[j]
    d2 = (blocks.residual[i] - blocks.residual[j]) ** 2
    noise = blocks.variance[i] + blocks.variance[j]
    d2 = np.minimum(d2, WINSOR * max(float(np.median(d2)) / 0.455, 1e-14))
    h = np.linalg.norm(blocks.point[i] - blocks.point[j], axis=1)
    lag = np.digitize(h, LAGS_M) - 1
    inside = (lag >= 0) & (lag < len(LAGS_M) - 1)
    count = np.bincount(lag[inside], minlength=len(LAGS_M) - 1).astype(np.float64)
    total = np.bincount(lag[inside], 0.5 * (d2 - noise)[inside], minlength=len(LAGS_M) - 1)
    return total / np.maximum(count, 1.0), np.minimum(count, len(own))


def _weighted_median(values: Array, weight: Array) -> float:
    order = np.argsort(values)
    cumulative = np.cumsum(weight[order])
    return float(values[order][np.searchsorted(cumulative, 0.5 * cumulative[-1])])
