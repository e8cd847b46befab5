"""Bundle adjustment: the truth within its own uncertainty, groups, gross errors, and a datum that is missing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bim_verify.core.errors import BimVerifyError
from bim_verify.core.imagery.bundle import adjust_bundle
from bim_verify.core.imagery.bundle_problem import Control
from bim_verify.core.imagery.datum import check_datum
from bim_verify.core.jobs.bundle import bundle as job

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


def test_control_that_leaves_the_block_free_to_turn_is_refused() -> None:
    for seed in range(4):
        problem, truth = bundle(seed)
        few = Control(np.arange(2), truth[:2], np.full((2, 3), 0.002))
        with pytest.raises(BimVerifyError, match="datum of the bundle is not fixed: 2 control points"):
            adjust_bundle(replace(problem, control=few))
    points = problem.points.copy()
    points[:4] = points[0] + np.linspace(0, 1, 4)[:, None] * (points[1] - points[0])
    points[3, 2] += 0.001
    line = Control(np.arange(4), points[:4], np.full((4, 3), 0.002))
    with pytest.raises(BimVerifyError, match="do not lie on one line"):
        check_datum(replace(problem, points=points, control=line), np.zeros((48, 48)))


def test_a_camera_that_shows_two_points_is_named() -> None:
    problem, _ = bundle(0)
    o = problem.observed
    keep = (o.camera != 3) | (o.point < 2)
    few = replace(o, camera=o.camera[keep], point=o.point[keep], pixel=o.pixel[keep], sigma=o.sigma[keep])
    with pytest.raises(BimVerifyError, match="c3 shows 2 of the points"):
        adjust_bundle(replace(problem, observed=few))


def test_points_that_nothing_fixes_are_left_out_and_counted() -> None:
    problem, truth = bundle(1)
    o = problem.observed
    keep = ~np.isin(o.point, (2, 10, 11)) | ((o.camera == 0) & (o.point != 11))  # 2 is a control point
    thin = replace(o, camera=o.camera[keep], point=o.point[keep], pixel=o.pixel[keep], sigma=o.sigma[keep])
    with pytest.raises(BimVerifyError, match="Fewer than two images show point 10"):
        adjust_bundle(replace(problem, observed=thin))
    found = job(replace(problem, observed=thin))
    assert found.left_out.tolist() == [10, 11] and len(found.result.points) == len(truth) - 2
    assert np.abs(found.result.points - np.delete(truth, [10, 11], axis=0)).max() < 0.02
    assert (found.problem.control.point == problem.control.point).all()


def test_a_control_point_is_given_once() -> None:
    problem, _ = bundle(0)
    c = problem.control
    twice = Control(np.append(c.point, 0), np.vstack([c.coordinates, c.coordinates[:1]]), np.vstack([c.sigma, c.sigma[:1]]))
    with pytest.raises(BimVerifyError, match="name point 0 twice"):
        adjust_bundle(replace(problem, control=twice))


def test_sigmas_grow_with_residuals_that_are_worse_than_stated() -> None:
    problem, _ = bundle(2)
    o = problem.observed
    worse = adjust_bundle(replace(problem, observed=replace(o, sigma=o.sigma / 3.0)))
    as_stated = adjust_bundle(problem)
    assert worse.variance_factor == pytest.approx(9.0, rel=0.1)
    ties, control = worse.groups
    assert ties.stretch == pytest.approx(3.0, rel=0.1) and control.stretch == 1.0
    assert [g.stretch for g in as_stated.groups] == [1.0, 1.0] and 1.0 <= as_stated.covariance_scale < 1.1
    ratio = np.sqrt(np.einsum("pii->p", worse.point_covariance) / np.einsum("pii->p", as_stated.point_covariance))
    assert np.median(ratio) == pytest.approx(1.0, abs=0.15)


def test_fixed_lenses_take_no_part_and_free_ones_of_their_own_each_do() -> None:
    problem, truth = bundle(0)
    lens = replace(problem.interiors[0], fx=2400.0, fy=2400.0, distortion=(-0.05, 0.01, 0.0005, -0.0003, 0.0))
    own = replace(problem, interiors=(lens,) * 8, inside_of=np.arange(8), free=())
    fixed = adjust_bundle(own)
    assert not fixed.interior_sigma.any() and fixed.redundancy == 2 * len(own.observed) + 18 - 48 - 3 * len(truth)
    each = adjust_bundle(replace(own, free=("f", "k1")))
    assert each.redundancy == fixed.redundancy - 16
    assert ((each.interior_sigma > 0) == (np.isin(np.arange(8), (0, 3)))).all()


def test_a_block_that_takes_too_much_memory_is_refused_before_it_is_tried() -> None:
    problem, _ = bundle(0)
    with pytest.raises(BimVerifyError, match="--memory-gb"):
        adjust_bundle(problem, memory_gb=1e-5)
    little = adjust_bundle(problem, memory_gb=4e-4)  # fewer sums at a time, the same result
    assert np.abs(little.points - adjust_bundle(problem).points).max() < 1e-9


def test_numbers_of_poses_that_are_not_finite_are_refused() -> None:
    problem, _ = bundle(0)
    bad = replace(problem.cameras[0], position=np.array([np.nan, 0.0, 0.0]))
    with pytest.raises(BimVerifyError, match="not finite"):
        adjust_bundle(replace(problem, cameras=(bad, *problem.cameras[1:])))
