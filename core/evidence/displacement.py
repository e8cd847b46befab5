"""The rigid shift of a built element against its plan, with an honest covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from .sightings import Sightings

BLOCK_M = 0.25
"""Size of the blocks over which unevenness is taken as one common error (correlation length of plaster and formwork)."""
LEAST_SHARE = 0.03
"""A direction is determined when at least this share of the evidence lies on faces across it."""
LEAST_BLOCKS = 2.0
TUKEY = 4.685
ITERATIONS = 30


@dataclass(frozen=True)
class Shift:
    """Shift in the directions that the scan determines; zero in the others. Metres."""

    vector: NDArray[np.float64]
    """(3,)"""
    covariance: NDArray[np.float64]
    """(3, 3) measurement and unevenness only; zero in directions that are not determined."""
    registration: NDArray[np.float64]
    """(3, 3) per unit variance of a station's position: multiply by sigma_registration^2."""
    determined: NDArray[np.float64]
    """(K, 3) orthonormal rows, K = 0 ... 3."""
    residual_sigma: float
    """Spread of the block means about the shift: unevenness and local deviation."""


def fit_shift(
    sightings: Sightings, normal: NDArray[np.float64], query: NDArray[np.float64], sigma: float, smallest_scale: float
) -> Shift:
    """Robust least squares of n.t = d over block means.

    ``sightings`` (M) on the element's surface, with the outward normals (M, 3) and positions (M, 3) of their queries.
    Returns that fall into the same block of the same face, seen from the same station, share one unknown error, so the
    covariance counts blocks and not returns; its scale comes from the residuals, no smaller than the sensor allows.
    """
    nothing = Shift(np.zeros(3), np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((0, 3)), 0.0)
    if len(sightings) == 0:
        return nothing
    d, n, station, variance, size = _blocks(sightings, normal, query, sigma)
    weight = size / size.max()
    eigenvalue, axes = np.linalg.eigh((n * weight[:, None]).T @ n / weight.sum())
    across = (np.abs(n @ axes) ** 2 * weight[:, None]).sum(axis=0)
    known = (eigenvalue >= LEAST_SHARE) & (across * len(d) / weight.sum() >= min(LEAST_BLOCKS, len(d)) * LEAST_SHARE)
    basis = axes[:, known].T
    if not len(basis):
        return nothing
    a = n @ basis.T

    shift = np.zeros(len(basis))
    unevenness2 = 0.0
    robust = np.ones(len(d))
    for _ in range(ITERATIONS):
        w = robust / (variance + unevenness2) * np.minimum(weight * 4.0, 1.0)
        normal_matrix = (a * w[:, None]).T @ a
        updated = np.linalg.solve(normal_matrix + 1e-9 * np.trace(normal_matrix) * np.eye(len(basis)), (a * w[:, None]).T @ d)
        residual = d - a @ updated
        scale2 = max((1.4826 * _weighted_median(np.abs(residual), weight)) ** 2, smallest_scale**2)
        unevenness2 = max(scale2 - float(np.median(variance)), 0.0)
        u = residual / (TUKEY * np.sqrt(variance + unevenness2 + smallest_scale**2))
        robust = np.where(np.abs(u) < 1, (1 - u**2) ** 2, 0.0)
        if robust.sum() < 1e-9:
            robust = np.ones(len(d))
        done = np.abs(updated - shift).max() < 1e-7
        shift = updated
        if done:
            break
    w = robust / (variance + unevenness2) * np.minimum(weight * 4.0, 1.0)
    normal_matrix = (a * w[:, None]).T @ a + 1e-12 * np.eye(len(basis))
    gain = np.linalg.solve(normal_matrix, (a * w[:, None]).T)
    residual = d - a @ shift
    freedom = max(robust.sum() - len(basis), 1.0)
    spread2 = np.maximum(variance + unevenness2, residual**2 * (robust > 0))
    widening = (student.ppf(0.975, freedom) / 1.96) ** 2 if freedom < 60 else 1.0
    covariance = widening * (gain * spread2) @ gain.T
    registration = np.zeros((3, 3))
    for s in np.unique(station):
        of = station == s
        lever = basis.T @ (gain[:, of] @ n[of])
        registration += lever @ lever.T
    return Shift(
        basis.T @ shift, basis.T @ covariance @ basis, registration, basis, float(np.sqrt(scale2))
    )


def _blocks(
    sightings: Sightings, normal: NDArray[np.float64], query: NDArray[np.float64], sigma: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Per block: mean deviation, mean normal, station, variance of the mean, number of sightings."""
    cell = np.floor(query / BLOCK_M).astype(np.int64)
    face = np.round(normal * 3).astype(np.int64)
    key = np.column_stack([cell, face, sightings.station.astype(np.int64)])
    _, block, size = np.unique(key, axis=0, return_inverse=True, return_counts=True)
    block = block.ravel()
    mean = np.bincount(block, sightings.deviation) / size
    direction = np.column_stack([np.bincount(block, normal[:, k]) for k in range(3)]) / size[:, None]
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    noise = sigma**2 * np.maximum(sightings.cosine.astype(np.float64), 0.2) ** 2 / np.maximum(sightings.count, 1)
    # neighbouring queries share returns: the block's own returns bound its information, not its queries
    variance = np.bincount(block, noise) / size
    station = np.zeros(len(size), dtype=np.int64)
    station[block] = sightings.station
    return mean, direction, station, variance, size.astype(np.float64)


def _weighted_median(values: NDArray[np.float64], weight: NDArray[np.float64]) -> float:
    order = np.argsort(values)
    cumulative = np.cumsum(weight[order])
    return float(values[order][np.searchsorted(cumulative, 0.5 * cumulative[-1])])
