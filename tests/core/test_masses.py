"""Belief masses of single returns: printed values, limits, and what the parameters mean."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bim_verify.core.evidence.masses import logistic, ray_masses, ray_masses_array, surface_masses
from bim_verify.core.sensing.presets import PRESETS, derive_c, derive_kappa, derive_lambda

TLS = PRESETS["tls"]


@pytest.mark.parametrize(
    ("c", "dx", "expected"), [(3.0, 0.0, "0.9051"), (7.0, 0.0, "0.9982"), (3.0, 0.005, "0.4975"), (3.0, -0.005, "0.4975")]
)
def test_occupied_mass_on_the_ray(c: float, dx: float, expected: str) -> None:
    occ, _ = ray_masses(dx, 0.0, c, 600.0, 20000.0)
    assert f"{occ:.4f}" == expected


def test_presets_are_those_of_the_source() -> None:
    assert (TLS.c, TLS.lam, TLS.kappa) == (3.0, 600.0, 20000.0)
    assert PRESETS["tls-grazing"].c == 7.0
    tie = PRESETS["tie-points"], PRESETS["tie-points-fine"]
    assert [(p.c, p.lam, p.kappa) for p in tie] == [(4.0, 800.0, 15000.0), (5.0, 1500.0, 75000.0)]
    dense = PRESETS["dense-points"], PRESETS["dense-points-fine"]
    assert [(p.c, p.lam, p.kappa) for p in dense] == [(4.0, 1200.0, 6000.0), (5.0, 2500.0, 70000.0)]


@pytest.mark.parametrize("name", sorted(PRESETS))
def test_masses_add_up_to_one_and_lie_between_zero_and_one(name: str) -> None:
    p = PRESETS[name]
    dx, dy = (a.ravel() for a in np.meshgrid(np.linspace(-30, 30, 1201), np.linspace(0, 0.2, 41)))
    masses = ray_masses_array(dx, dy, p.c, p.lam, p.kappa)
    np.testing.assert_allclose(masses.sum(axis=1), 1.0, atol=1e-15)
    assert masses.min() >= 0.0 and masses.max() <= 1.0


def test_masses_follow_the_formula() -> None:
    random = np.random.default_rng(4)
    dx, dy = random.uniform(-0.04, 0.04, 500), random.uniform(0, 0.02, 500)
    for p in PRESETS.values():
        g = np.exp(-p.kappa * dy**2)
        upper, lower = 1 / (1 + np.exp(-p.lam * dx - p.c)), 1 / (1 + np.exp(-p.lam * dx + p.c))
        expected = np.column_stack([(upper - lower) * g, (1 - upper) * g])
        masses = ray_masses_array(dx, dy, p.c, p.lam, p.kappa)
        np.testing.assert_allclose(masses[:, :2], expected, rtol=1e-9, atol=1e-15)
        np.testing.assert_allclose(masses[:, 2], 1 - expected.sum(axis=1), atol=1e-14)


def test_in_front_is_empty_behind_is_unknown() -> None:
    front = ray_masses_array(np.array([-1.0]), np.zeros(1), TLS.c, TLS.lam, TLS.kappa)[0]
    behind = ray_masses_array(np.array([1.0]), np.zeros(1), TLS.c, TLS.lam, TLS.kappa)[0]
    np.testing.assert_allclose(front, [0.0, 1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(behind, [0.0, 0.0, 1.0], atol=1e-12)


def test_far_from_the_ray_nothing_is_known() -> None:
    masses = ray_masses_array(np.array([-1.0, 0.0, 1.0]), np.full(3, 1.0), TLS.c, TLS.lam, TLS.kappa)
    np.testing.assert_allclose(masses, [[0.0, 0.0, 1.0]] * 3, atol=1e-12)


def test_the_logistic_does_not_overflow() -> None:
    assert logistic(-1e6) == 0.0 and logistic(1e6) == 1.0 and logistic(0.0) == 0.5
    assert logistic(-40.0) == pytest.approx(math.exp(-40.0), rel=1e-12)


def test_the_occupied_zone_is_half_as_sure_at_its_ends() -> None:
    half = 0.02
    c = derive_c(half, 600.0)
    for end in (-half, half):
        assert ray_masses(end, 0.0, c, 600.0, 20000.0)[0] == pytest.approx(0.5, abs=1e-5)


def test_full_width_at_half_maximum_is_twice_the_spacing() -> None:
    spacing = 0.006
    kappa = derive_kappa(spacing)
    assert kappa == pytest.approx(math.log(2) / spacing**2)
    peak = ray_masses(0.0, 0.0, 3.0, 600.0, kappa)[0]
    assert ray_masses(0.0, spacing**2, 3.0, 600.0, kappa)[0] == pytest.approx(peak / 2, rel=1e-12)


def test_lambda_gives_the_transition_the_sensors_sigma() -> None:
    sigma = 0.003
    lam = derive_lambda(sigma)
    x = np.linspace(-0.1, 0.1, 200_001)
    cumulative = 1 / (1 + np.exp(-lam * x))
    density = np.gradient(cumulative, x)
    assert math.sqrt((density * x**2).sum() * (x[1] - x[0])) == pytest.approx(sigma, rel=1e-6)


def test_dense_points_know_no_empty_space() -> None:
    p = PRESETS["dense-points"]
    normal = np.array([0.0, 0.6, 0.8])
    random = np.random.default_rng(1)
    offset = random.normal(0, 0.01, (200, 3))
    masses = surface_masses(offset, normal, p.c, p.lam, p.kappa)
    dx = offset @ normal
    dy = np.linalg.norm(offset - dx[:, None] * normal, axis=1)
    np.testing.assert_allclose(masses[:, 0], ray_masses_array(dx, dy, p.c, p.lam, p.kappa)[:, 0], atol=1e-14)
    np.testing.assert_array_equal(masses[:, 1], 0.0)
    np.testing.assert_allclose(masses.sum(axis=1), 1.0, atol=1e-15)
    mirrored = surface_masses(-offset, normal, p.c, p.lam, p.kappa)
    np.testing.assert_allclose(mirrored, masses, atol=1e-14)
