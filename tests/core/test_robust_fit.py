"""The shift of an element where some of what was seen of it contradicts the rest."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from bim_verify.core.evidence.robust_fit import fit_agreeing

X, Y, Z = np.eye(3)
SIGMA_M = 0.0005
UNEVEN2 = 0.002**2


def observed(residual: dict[str, list[float]]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    axes = {"x": X, "y": Y, "z": Z}
    normal = np.array([axes[axis] for axis, values in residual.items() for _ in values])
    values = np.array([value for values in residual.values() for value in values])
    return normal, values, np.full(len(values), SIGMA_M**2)


def test_one_wild_observation_drags_no_direction_that_few_determine() -> None:
    normal, residual, variance = observed({"x": [0.14, -0.0004, 0.0002], "y": [0.0001] * 4, "z": [-0.0001] * 4})
    basis, shift, robust, _ = fit_agreeing(normal, residual, variance, UNEVEN2, np.eye(3))
    assert (basis.T @ shift) == pytest.approx([-0.0001, 0.0001, -0.0001], abs=1e-4)
    assert len(basis) == 3
    assert robust[0] == 0.0
    assert np.all(robust[1:] > 0.9)


def test_a_direction_whose_halves_contradict_each_other_is_given_up() -> None:
    normal, residual, variance = observed({"x": [0.1, 0.1, -0.1, -0.1], "y": [0.003] * 9, "z": [0.0] * 9})
    basis, shift, _, _ = fit_agreeing(normal, residual, variance, UNEVEN2, np.eye(3))
    assert len(basis) == 2
    assert np.abs(basis @ X).max() < 1e-9
    assert (basis.T @ shift) == pytest.approx([0.0, 0.003, 0.0], abs=1e-6)


def test_contradiction_in_the_only_direction_leaves_none() -> None:
    normal, residual, variance = observed({"x": [0.1, -0.1], "y": [0.0] * 3})
    basis, shift, _, _ = fit_agreeing(normal, residual, variance, UNEVEN2, X[None])
    assert len(basis) == len(shift) == 0


def test_what_agrees_is_plain_least_squares() -> None:
    random = np.random.default_rng(3)
    truth = np.array([0.004, -0.002, 0.001])
    normal = random.normal(size=(300, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    residual = normal @ truth + random.normal(scale=SIGMA_M, size=300)
    basis, shift, _, _ = fit_agreeing(normal, residual, np.full(300, SIGMA_M**2), 0.0, np.eye(3))
    assert (basis.T @ shift) == pytest.approx(truth, abs=4 * SIGMA_M / np.sqrt(100))
