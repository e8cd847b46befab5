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


def test_a_point_that_starts_behind_its_camera_is_refused_in_a_sentence() -> None:
    problem, _ = bundle(0)
    point, camera = int(problem.observed.point[0]), problem.cameras[int(problem.observed.camera[0])]
    points = problem.points.copy()
    points[point] = 2 * camera.position - points[point]
    with pytest.raises(BimVerifyError, match="start behind a camera"):
        adjust_bundle(replace(problem, points=points))


def test_points_left_with_one_good_ray_do_not_take_the_others_along() -> None:
    problem, truth = bundle(3)
    seen = problem.observed
    rank = np.zeros(len(seen), int)
    for point in np.unique(seen.point):
        rows = np.flatnonzero(seen.point == point)
        rank[rows] = np.arange(len(rows))
    keep = (rank < 2) | (seen.point < 60)
    pixel = seen.pixel.copy()
    gross = (seen.point >= 70) & (rank == 0)
    pixel[gross] += 80.0
    thin = replace(seen, camera=seen.camera[keep], point=seen.point[keep], pixel=pixel[keep], sigma=seen.sigma[keep])
    found = adjust_bundle(replace(problem, observed=thin), robust=True)
    sigma = np.sqrt(np.einsum("pii->p", found.point_covariance) / 3)
    off = np.linalg.norm(found.points - truth, axis=1)
    lost = np.unique(thin.point[found.weight < 0.01])
    assert len(lost) >= 5 and (lost >= 60).all()
    assert (sigma[lost] > 0.1).all() and (sigma[lost] < 100.0).all()
    good = np.setdiff1d(np.arange(70), lost)
    assert (off[good] < 5 * np.sqrt(3) * sigma[good]).all() and np.median(sigma[good]) < 0.01
