"""Poses from lines: what is found, and whether it knows how well."""

from __future__ import annotations

import numpy as np
import pytest

from bim_verify.core.errors import BimVerifyError
from bim_verify.core.imagery.camera import Interior, from_omega_phi_kappa, to_omega_phi_kappa
from bim_verify.core.imagery.line_pose import estimate_calibrated, estimate_projective, pose_difference
from bim_verify.core.imagery.uncertain_lines import hessian, join

from .imagery_data import CAMERA, observed_lines

RUNS = 60


@pytest.mark.parametrize("estimate", [estimate_calibrated, estimate_projective])
def test_without_errors_the_pose_is_exact(estimate) -> None:  # type: ignore[no-untyped-def]
    matches, coarse = observed_lines(0, 1e-7, 1e-4)
    found = estimate(matches, coarse)
    assert np.abs(pose_difference(found.camera, CAMERA)).max() < 1e-5


@pytest.mark.parametrize(("estimate", "limit"), [(estimate_calibrated, 0.012), (estimate_projective, 0.05)])
def test_stated_covariance_is_the_scatter_of_many_runs(estimate, limit) -> None:  # type: ignore[no-untyped-def]
    errors, squares, factors = [], [], []
    for seed in range(RUNS):
        matches, coarse = observed_lines(seed, 0.0025, 1.0)
        found = estimate(matches, coarse)
        error = pose_difference(found.camera, CAMERA)
        errors.append(error)
        squares.append(error @ np.linalg.solve(found.covariance, error))
        factors.append(found.variance_factor)
    assert np.std(errors, axis=0)[3:].max() < limit
    assert 4.5 < np.mean(squares) < 7.8  # chi-square with six degrees: 6, its mean of 60 runs within 4 sigma
    assert 0.9 < np.mean(factors) < 1.1


def test_a_wrong_match_stands_out_in_its_test() -> None:
    matches, coarse = observed_lines(3, 0.0025, 0.5)
    across = np.cross(matches.end[7] - matches.start[7], CAMERA.rotation[2])
    matches.start[7] += 0.06 * across / np.linalg.norm(across)
    found = estimate_calibrated(matches, coarse)
    assert int(np.argmax(found.test)) == 7


def test_too_few_lines_are_refused_in_a_sentence() -> None:
    matches, coarse = observed_lines(0, 0.0025, 0.5)
    with pytest.raises(BimVerifyError, match="2 matched lines do not fix a pose"):
        estimate_calibrated(matches.rows(np.arange(2)), coarse)


def test_lines_of_one_direction_are_refused_or_uncertain() -> None:
    matches, coarse = observed_lines(0, 0.0025, 0.5)
    vertical = np.abs((matches.end - matches.start)[:, 2]) > 0.5
    try:
        found = estimate_calibrated(matches.rows(vertical), coarse)
    except BimVerifyError:
        return
    full = estimate_calibrated(matches, coarse)
    assert np.trace(found.covariance[3:, 3:]) > 20 * np.trace(full.covariance[3:, 3:])


def test_angles_and_distortion_go_both_ways() -> None:
    angles = tuple(np.radians([-67.318, 1.8, 29.498]))
    assert np.allclose(to_omega_phi_kappa(from_omega_phi_kappa(*angles)), angles)
    lens = Interior(1600, 1200, 1300.0, 1310.0, 800.0, 600.0, (-0.08, 0.02, 0.001, -0.0005, 0.0))
    ideal = np.random.default_rng(0).uniform([100, 100], [1500, 1100], (50, 2))
    assert np.abs(lens.undistort(lens.distort(ideal)) - ideal).max() < 1e-6


def test_hessian_form_of_a_joined_line() -> None:
    small = np.full((1, 2, 2), 0.0) + np.eye(2) * 0.25
    line, cov = join(np.array([[10.0, 5.0]]), np.array([[110.0, 5.0]]), small, small)
    value, spread = hessian(line, cov)
    assert abs(abs(np.sin(value[0, 0])) - 1.0) < 1e-12 and abs(value[0, 1]) == pytest.approx(5.0)
    assert np.sqrt(spread[0, 0, 0]) == pytest.approx(0.5 * np.sqrt(2) / 100, rel=1e-6)
