"""The rigid shift of a built element against its plan, with an honest covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from .sightings import Sightings

Array = NDArray[np.float64]

BLOCK_M = 0.25
"""Size of the blocks over which unevenness is taken as one common error (correlation length of plaster and formwork)."""
CLUSTERS_M = (0.5, 1.0)
"""Larger pieces of surface that may share an error too, tried against the blocks; the largest covariance counts."""
LEAST_CLUSTERS = 8
LEAST_SHARE = 0.05
"""A direction is determined when at least this share of the evidence lies on faces across it."""
LEAST_ACROSS = 3.0
"""... and at least this many blocks' worth of it, so that their agreement shows how far they can be trusted."""
TUKEY = 4.685
ITERATIONS = 40


@dataclass(frozen=True)
class Shift:
    """Shift in the directions that the scan determines; zero in the others. Metres."""

    vector: Array
    """(3,)"""
    covariance: Array
    """(3, 3) of measurement and unevenness; zero in directions that are not determined."""
    registration: Array
    """(3, 3) per unit variance of a station's position: multiply by sigma_registration^2."""
    determined: Array
    """(K, 3) orthonormal rows, K = 0 ... 3."""
    residual_sigma: float
    """Spread of the block means about the shift: unevenness and local deviation."""

    def plus(self, start: Array) -> Shift:
        """The same found from ``start`` (3,): the shift as a whole, still only in the determined directions."""
        along = self.determined.T @ (self.determined @ start) if len(self.determined) else start
        return Shift(self.vector + along, self.covariance, self.registration, self.determined, self.residual_sigma)


NOTHING = Shift(np.zeros(3), np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((0, 3)), 0.0)


@dataclass(frozen=True)
class Blocks:
    """Means of the returns that fall into one block of one face, seen from one station."""

    residual: Array
    """(B,) metres."""
    normal: Array
    """(B, 3)"""
    point: Array
    """(B, 3) metres, local frame."""
    station: NDArray[np.int64]
    variance: Array
    """(B,) of the mean, from the returns' own scatter, m2."""
    count: Array
    """(B,) returns."""


def fit_shift(sightings: Sightings, sigma: float) -> Shift:
    """Robust least squares of n.t = residual over block means, from sightings of the element's own surface.

    Each return counts once, with its exact distance from the face that its ray meets. Returns in the same block of the
    same face, seen from the same station, share one unknown error (unevenness), so the covariance counts blocks and not
    returns; its scale comes from the scatter of the returns and of the blocks, not from what the sensor should do.
    """
    if len(sightings) == 0:
        return NOTHING
    blocks = block_means(sightings, sigma)
    n, d, size = blocks.normal, blocks.residual, np.minimum(blocks.count, 25.0)
    share = (n * (size / size.sum())[:, None]).T @ n
    eigenvalue, axes = np.linalg.eigh(share)
    across = ((n @ axes) ** 2).sum(axis=0)
    basis = axes[:, (eigenvalue >= LEAST_SHARE) & (across >= LEAST_ACROSS)].T
    if not len(basis):
        return NOTHING
    a = n @ basis.T

    shift = np.zeros(len(basis))
    robust = np.ones(len(d))
    uneven2 = 0.0
    for _ in range(ITERATIONS):
        weight = robust / (blocks.variance + uneven2)
        updated = _solve(a, weight, d)
        residual = d - a @ updated
        uneven2 = _between(residual, blocks.variance)
        u = residual / (TUKEY * np.sqrt(blocks.variance + uneven2))
        robust = np.where(np.abs(u) < 1, (1 - u**2) ** 2, 0.0)
        step, shift = float(np.abs(updated - shift).max()), updated
        if step < 1e-7:
            break
    weight = robust / (blocks.variance + uneven2)
    gain = np.linalg.solve(_normal_matrix(a, weight), (a * weight[:, None]).T)
    residual = d - a @ shift
    freedom = max(float(robust.sum()) - len(basis), 1.0)
    # a block may be worse than most: its variance is what was expected or what is seen, whichever is larger
    variance = np.maximum(blocks.variance + uneven2, robust * residual**2)
    widening = (float(student.ppf(0.975, freedom)) / 1.96) ** 2
    covariance = widening * (gain * variance) @ gain.T
    for size_m in CLUSTERS_M:
        wider = _clustered(gain * (robust > 0) * residual, blocks, size_m)
        if wider is not None and np.trace(wider) > np.trace(covariance):
            covariance = wider
    registration = np.zeros((len(basis), len(basis)))
    for station in np.unique(blocks.station):
        of = blocks.station == station
        lever = gain[:, of] @ n[of]
        registration += lever @ lever.T
    return Shift(
        basis.T @ shift, basis.T @ covariance @ basis, basis.T @ registration @ basis, basis, float(np.sqrt(uneven2))
    )


def _clustered(influence: Array, blocks: Blocks, size_m: float) -> Array | None:
    """(K, K) covariance when all blocks of a face within ``size_m``, whatever the station, share their error.

    ``influence`` (K, B) is what each block's residual adds to the shift. None with too few clusters to tell.
    """
    key = np.column_stack([np.floor(blocks.point / size_m).astype(np.int64), np.round(blocks.normal * 3).astype(np.int64)])
    _, cluster = np.unique(key, axis=0, return_inverse=True)
    count = int(cluster.max()) + 1
    if count < LEAST_CLUSTERS:
        return None
    total = np.stack([np.bincount(cluster.ravel(), row, minlength=count) for row in influence])
    freedom = count - len(influence)
    widening = count / freedom * (float(student.ppf(0.975, freedom)) / 1.96) ** 2
    return widening * np.asarray(total @ total.T, dtype=np.float64)


def block_means(sightings: Sightings, sigma: float) -> Blocks:
    """Blocks of ``BLOCK_M`` per face direction and station; a return seen from several queries counts once."""
    point = sightings.point.astype(np.float64)
    normal = sightings.face_normal.astype(np.float64)
    station = sightings.station.astype(np.int64)
    once = np.unique(np.column_stack([sightings.point.view(np.int32), station]), axis=0, return_index=True)[1]
    point, normal, station, residual = point[once], normal[once], station[once], sightings.residual[once]
    key = np.column_stack([np.floor(point / BLOCK_M).astype(np.int64), np.round(normal * 3).astype(np.int64), station])
    _, block, count = np.unique(key, axis=0, return_inverse=True, return_counts=True)
    block = block.ravel()
    mean = np.bincount(block, residual) / count
    direction = np.column_stack([np.bincount(block, normal[:, k]).astype(np.float64) for k in range(3)])
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    apart = residual - mean[block]
    freedom = max(len(residual) - len(count), 0)
    pooled2 = (sigma**2 * 4 + float((apart**2).sum())) / (4 + freedom)
    of_station = np.zeros(len(count), dtype=np.int64)
    of_station[block] = station
    place = np.column_stack([np.bincount(block, point[:, k]) / count for k in range(3)])
    return Blocks(mean, direction, place, of_station, pooled2 / count, count.astype(np.float64))


def _normal_matrix(a: Array, weight: Array) -> Array:
    matrix: Array = (a * weight[:, None]).T @ a
    return matrix + 1e-9 * np.trace(matrix) * np.eye(a.shape[1])


def _solve(a: Array, weight: Array, d: Array) -> Array:
    solution: Array = np.linalg.solve(_normal_matrix(a, weight), (a * weight[:, None]).T @ d)
    return solution


def _between(residual: Array, variance: Array) -> float:
    """Variance between blocks beyond what the returns' scatter explains, by the median of the squares."""
    spread = 2.198 * float(np.median(residual**2))
    return max(spread - float(np.median(variance)), 0.0)
