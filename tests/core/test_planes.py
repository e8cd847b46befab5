"""Planes with covariance: the stated uncertainty is the scatter of many fits."""

from __future__ import annotations

import numpy as np

from bim_verify.core.planes.derived import angle_between, distance_between, intersect_three
from bim_verify.core.planes.fit import Plane, fit_plane
from bim_verify.core.planes.noise import PointNoise

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
