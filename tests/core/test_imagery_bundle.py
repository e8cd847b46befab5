"""Bundle adjustment: the truth within its own uncertainty, groups, gross errors, and a datum that is missing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bim_verify.core.errors import BimVerifyError
from bim_verify.core.imagery.bundle import adjust_bundle
from bim_verify.core.imagery.bundle_problem import Control

from .imagery_data import bundle

RUNS = 12


def test_covariance_of_points_is_the_scatter_of_many_runs() -> None:
    squares, stated, factors = [], [], []
    for seed in range(RUNS):
        problem, truth = bundle(seed)
        found = adjust_bundle(problem)
        squares.append((found.points - truth) ** 2)
        stated.append(found.point_covariance[:, [0, 1, 2], [0, 1, 2]])
        factors.append(found.variance_factor)
    assert np.sqrt(np.mean(squares) / np.mean(stated)) == pytest.approx(1.0, abs=0.25)
    assert np.mean(factors) == pytest.approx(1.0, abs=0.05)


def test_redundancy_is_shared_among_the_groups() -> None:
    problem, _ = bundle(0)
    found = adjust_bundle(problem)
    assert sum(group.redundancy for group in found.groups) == pytest.approx(found.redundancy, rel=1e-6)
    assert found.interiors[0].fx == pytest.approx(2400.0, abs=6 * found.interior_sigma[0, 0] * 2400.0)


def test_gross_errors_lose_their_weight() -> None:
    problem, truth = bundle(1)
    problem.observed.pixel[::37] += 60.0
    found = adjust_bundle(problem, robust=True)
    assert np.median(found.weight[::37]) < 0.1
    assert np.abs(found.points - truth).max() < 0.02


def test_the_order_of_observations_does_not_matter() -> None:
    problem, _ = bundle(2)
    order = np.random.default_rng(0).permutation(len(problem.observed))
    o = problem.observed
    shuffled = replace(o, camera=o.camera[order], point=o.point[order], pixel=o.pixel[order], sigma=o.sigma[order])
    first, second = adjust_bundle(problem), adjust_bundle(replace(problem, observed=shuffled))
    assert np.abs(first.points - second.points).max() < 1e-8


def test_without_control_the_datum_is_refused_in_a_sentence() -> None:
    problem, _ = bundle(0)
    with pytest.raises(BimVerifyError, match="datum"):
        adjust_bundle(replace(problem, control=Control.none(), free=()))
