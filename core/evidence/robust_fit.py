"""Least squares that a few wild observations do not drag, and the directions in which the others agree."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TUKEY = 4.685
ITERATIONS = 40
LEAST_AGREEING = 1.0
"""A direction in which fewer observations than this are left within reach of the fit is not determined."""


def fit_agreeing(
    normal: Array, residual: Array, variance: Array, expected2: float, basis: Array
) -> tuple[Array, Array, Array, float]:
    """Solve ``normal`` (N, 3) . t = ``residual`` (N,) [m] for t in the directions ``basis`` (K, 3), orthonormal rows.

    ``variance`` (N,) is that of each observation, ``expected2`` what they share beyond it. Returns the directions in which
    observations agree (J, 3), the shift along them (J,), each one's robust weight (N,) 0 ... 1, and the variance between
    them, not below ``expected2``. Tukey's weights from plain least squares; where one wild observation has dragged that so
    far that no other is left within reach, from Huber's estimate, whose sum has one minimum. A direction in which even
    then nothing agrees (two halves that contradict each other, say) is given up.
    """
    while len(basis):
        a = normal @ basis.T
        for start in (_all_alike, _undragged):
            shift, robust, uneven2 = _redescend(a, residual, variance, expected2, start(a, residual, variance + expected2))
            agreeing, axes = np.linalg.eigh((a * robust[:, None]).T @ a)
            if agreeing[0] >= LEAST_AGREEING:
                return basis, shift, robust, uneven2
        basis = axes[:, agreeing >= LEAST_AGREEING].T @ basis
    return basis, np.zeros(0), np.ones(len(residual)), expected2


def normal_matrix(a: Array, weight: Array) -> Array:
    """(K, K) of observations ``a`` (N, K), regular where their weights are all but lost in one direction."""
    matrix: Array = (a * weight[:, None]).T @ a
    return matrix + 1e-9 * np.trace(matrix) * np.eye(a.shape[1])


def _redescend(a: Array, d: Array, variance: Array, expected2: float, robust: Array) -> tuple[Array, Array, float]:
    """Tukey's estimate from the weights ``robust``; it ends early where a direction has lost all that speaks of it."""
    shift, uneven2 = np.zeros(a.shape[1]), expected2
    for _ in range(ITERATIONS):
        updated = _solve(a, robust / (variance + uneven2), d)
        residual = d - a @ updated
        uneven2 = max(_between(residual, variance), expected2)
        u = residual / (TUKEY * np.sqrt(variance + uneven2))
        robust = np.where(np.abs(u) < 1, (1 - u**2) ** 2, 0.0)
        step, shift = float(np.abs(updated - shift).max()), updated
        if step < 1e-7 or np.linalg.eigvalsh((a * robust[:, None]).T @ a)[0] < LEAST_AGREEING:
            break
    return shift, robust, uneven2


def _all_alike(_a: Array, d: Array, _variance: Array) -> Array:
    return np.ones(len(d))


def _undragged(a: Array, d: Array, variance: Array) -> Array:
    """Huber's weights (N,): an observation pulls with at most one standard deviation."""
    weight = np.ones(len(d))
    for _ in range(ITERATIONS):
        residual = d - a @ _solve(a, weight / variance, d)
        weight = 1.0 / np.maximum(np.abs(residual) / np.sqrt(variance), 1.0)
    return weight


def _solve(a: Array, weight: Array, d: Array) -> Array:
    solution: Array = np.linalg.solve(normal_matrix(a, weight), (a * weight[:, None]).T @ d)
    return solution


def _between(residual: Array, variance: Array) -> float:
    """Variance between observations beyond what each one's own explains, by the median of the squares."""
    spread = 2.198 * float(np.median(residual**2))
    return max(spread - float(np.median(variance)), 0.0)
