"""Planes with covariance: the stated uncertainty is the scatter of many fits."""

from __future__ import annotations

import numpy as np
import pytest

from bim_verify.core.planes.conformity import flatness
from bim_verify.core.planes.derived import angle_between, distance_between, intersect_three
from bim_verify.core.planes.fit import Plane, fit_plane
from bim_verify.core.planes.noise import PointNoise
from bim_verify.core.planes.unevenness import with_unevenness

NOISE = PointNoise(0.004, 0.0001, 1e-4)
STATION = np.array([2.0, 1.5, 1.6])
RUNS = 120


def fitted(rng: np.random.Generator, axis: int, at: float) -> Plane:
    """A face of a room of 4 x 3 x 2.5 m seen from inside, with 3 mm of noise along the rays."""
    points = rng.random((80, 3)) * [4.0, 3.0, 2.5]
    points[:, axis] = at
    ray = points - STATION
    reach = np.linalg.norm(ray, axis=1, keepdims=True)
    points = points + ray / reach * rng.normal(0.0, NOISE_SIGMA, (len(points), 1))
    return fit_plane(points, np.broadcast_to(STATION, points.shape), PointNoise(NOISE_SIGMA, 0.0, 1e-9)).facing(STATION)


NOISE_SIGMA = 0.003


def test_stated_sigmas_are_the_scatter_of_many_fits() -> None:
    rng = np.random.default_rng(4)
    found: dict[str, list[float]] = {"width": [], "angle": [], "corner": []}
    stated: dict[str, list[float]] = {"width": [], "angle": [], "corner": []}
    for _ in range(RUNS):
        west, east, south, floor = (fitted(rng, a, v) for a, v in ((0, 0.0), (0, 4.0), (1, 0.0), (2, 0.0)))
        width, angle, corner = distance_between(west, east), angle_between(west, south), intersect_three(west, south, floor)
        for name, value, sigma in (
            ("width", width.value, width.sigma), ("angle", angle.value, angle.sigma),
            ("corner", float(corner.position[0]), float(np.sqrt(corner.covariance[0, 0]))),
        ):
            found[name].append(value)
            stated[name].append(sigma)
    for name in found:
        ratio = np.std(found[name]) / np.sqrt(np.mean(np.square(stated[name])))
        assert 0.8 < ratio < 1.25, name  # 120 runs: the ratio's own sigma is 6.5 %
    assert abs(np.mean(found["width"]) - 4.0) < 4 * np.std(found["width"]) / np.sqrt(RUNS) + 1e-4


def test_exact_points_give_the_exact_plane() -> None:
    rng = np.random.default_rng(0)
    points = rng.random((50, 3)) * [4.0, 3.0, 0.0] + [0.0, 0.0, 1.0]
    plane = fit_plane(points, np.broadcast_to(STATION, points.shape), NOISE).facing(STATION)
    assert np.abs(plane.normal - [0.0, 0.0, 1.0]).max() < 1e-12
    assert abs(float(plane.distance(np.array([1.0, 1.0, 1.25]))[0]) - 0.25) < 1e-12


def wall(rng: np.random.Generator, width: float, height: float, count: int) -> np.ndarray:
    return np.column_stack([rng.uniform(0, width, count), np.zeros(count), rng.uniform(0, height, count)])


@pytest.mark.parametrize(("width", "height"), [(10.0, 0.12), (20.0, 0.3), (5.0, 2.5)])
def test_long_narrow_faces_have_an_unevenness_too(width: float, height: float) -> None:
    """All cells of a skirting lie in one row."""
    rng = np.random.default_rng(1)
    points = wall(rng, width, height, 3000)
    points[:, 1] += rng.normal(0.0, 0.002, 3000) + 0.003 * np.sin(7.0 * points[:, 0])
    plane = fit_plane(points, np.array([width / 2, -3.0, 1.0]), PointNoise(0.002, 0.0, 0.0))
    found, uneven = with_unevenness(plane, points)
    assert uneven is not None and 0.001 < uneven.sigma < 0.01
    assert np.all(np.diag(found.covariance)[:2] > np.diag(plane.covariance)[:2])


def test_intervals_hold_on_uneven_surfaces() -> None:
    rng = np.random.default_rng(2)
    points, noise = wall(rng, 4.0, 2.6, 1200), PointNoise(0.002, 0.0, 0.0)
    cell = np.round(points[:, [0, 2]] / 0.12).astype(int)
    used, index = np.unique(cell, axis=0, return_inverse=True)
    apart = 0.12 * np.linalg.norm(used[:, None] - used[None], axis=2)
    root = np.linalg.cholesky(np.exp(-apart / 0.5) + 1e-9 * np.eye(len(used)))
    normalized = []
    for _ in range(25):
        seen = points.copy()
        seen[:, 1] += rng.normal(0.0, 0.002, len(seen)) + 0.002 * (root @ rng.standard_normal(len(used)))[index.ravel()]
        plane, _ = with_unevenness(fit_plane(seen, np.array([2.0, -3.0, 1.3]), noise), seen)
        for place in ([0.0, 0.0, 0.0], [2.0, 0.0, 1.3], [4.0, 0.0, 2.6]):
            normalized.append(float(plane.distance(np.array(place))[0] / plane.sigma_at(np.array(place))[0]))
    assert 0.6 < np.sqrt(np.mean(np.square(normalized))) < 1.25


def test_noise_is_not_taken_for_unevenness() -> None:
    rng = np.random.default_rng(3)
    small = []
    for _ in range(30):
        points = wall(rng, 4.5, 2.5, 7000)
        points[:, 1] += rng.normal(0.0, 0.002, len(points))
        plane = fit_plane(points[::5], np.array([2.0, -3.0, 1.2]), PointNoise(0.002, 0.0, 0.0))
        small += [t.p_value < 0.05 for t in flatness(plane, points)]
    assert np.mean(small) < 0.1
