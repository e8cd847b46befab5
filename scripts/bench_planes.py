"""Monte Carlo against the analytic covariances of planes, vertices, edges, slopes, distances and angles.

    python scripts/bench_planes.py [--runs 10000] [--uneven-runs 400] [--wall MM M]

Four parts: independent noise (every standard deviation against its sample), surfaces with an unevenness that is estimated
from each run's residuals (how often the 95 % intervals hold), single walls with other unevenness, and the findings of
Jarzabek-Rychard and Maas 2023.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from bim_verify.core.planes.derived import (
    Z95,
    angle_between,
    distance_between,
    edge_length,
    intersect_three,
    intersect_two,
    plane_slope,
    plumb_deviation,
    rise,
)
from bim_verify.core.planes.fit import Plane, fit_plane
from bim_verify.core.planes.noise import PointNoise
from bim_verify.core.planes.unevenness import with_unevenness

Array = NDArray[np.float64]

ROOM = np.array([5.2, 4.1, 2.8])
STATION = np.array([2.1, 1.7, 1.5])
FACES = {"west": (0, 0.0), "east": (0, 1.0), "south": (1, 0.0), "north": (1, 1.0), "floor": (2, 0.0), "ceiling": (2, 1.0)}
WALLS = ((0.0, 1.0), (0.3, 0.5), (1.0, 0.5), (1.0, 1.5), (2.0, 0.5), (3.0, 2.0))
"""Uneven by (mm) over (m)."""
BLK360 = PointNoise(0.001, 0.0003, np.radians(40 / 3600))
"""Declared of the scanner of the source: 4 mm at 10 m, 7 mm at 20 m, 40 arc seconds."""


def face(name: str, count: int, rng: np.random.Generator, coverage: float = 1.0) -> Array:
    """(count, 3) places on a face of the room, on the share ``coverage`` of its height (or width)."""
    axis, end = FACES[name]
    points = rng.uniform(0.0, 1.0, (count, 3))
    points[:, 2 if axis < 2 else 1] = 1.0 - coverage * points[:, 2 if axis < 2 else 1]
    points[:, axis] = end
    return points * ROOM


def noisy(points: Array, noise: PointNoise, rng: np.random.Generator) -> Array:
    """The points with errors along and across their rays."""
    ray = points - STATION
    distance = np.linalg.norm(ray, axis=1)
    ray /= distance[:, None]
    error = rng.standard_normal(points.shape) * noise.across(distance)[:, None]
    error += ray * (rng.standard_normal(len(ray)) * noise.along(distance) - np.einsum("ij,ij->i", error, ray))[:, None]
    return np.asarray(points + error)


def quantities(planes: dict[str, Plane]) -> dict[str, tuple[float, float]]:
    """Name -> value and standard deviation."""
    out = {}
    for name, plane in planes.items():
        place = STATION * np.array([1.2, 0.8, 1.1])
        out[f"{name} at a place"] = float(plane.distance(place)[0]), float(plane.sigma_at(place)[0])
        for k, axis in enumerate("abcd"):
            sigma = float(np.sqrt(plane.parameter_covariance[k, k]))
            if sigma > 1e-7:
                out[f"{name} {axis}"] = float(plane.parameters[k]), sigma
    for name in ("west", "north"):
        lean = plumb_deviation(planes[name])
        out[f"{name} lean"] = lean.value, lean.sigma
    for names in (("west", "south", "floor"), ("east", "north", "ceiling"), ("west", "north", "floor")):
        vertex = intersect_three(*(planes[n] for n in names))
        for k, axis in enumerate("xyz"):
            out[f"vertex {'/'.join(names)} {axis}"] = float(vertex.position[k]), float(np.sqrt(vertex.covariance[k, k]))
    for a, b in (("west", "floor"), ("north", "ceiling"), ("tilted", "south")):
        edge = intersect_two(planes[a], planes[b])
        # signed, so that a level edge is no folded distribution
        signed = edge.direction if edge.direction[0 if a != "west" else 1] > 0 else -edge.direction
        value = float(np.arctan2(signed[2], np.hypot(signed[0], signed[1])))
        out[f"edge {a}/{b} slope"] = value, edge.slope.sigma
        for k, axis in enumerate("xyz"):
            if edge.covariance[k, k] > 1e-13:
                out[f"edge {a}/{b} direction {axis}"] = float(signed[k]), float(np.sqrt(edge.covariance[k, k]))
    for a, b in (("west", "east"), ("south", "north"), ("floor", "ceiling")):
        d = distance_between(planes[a], planes[b])
        out[f"distance {a}-{b}"] = d.value, d.sigma
    for a, b in (("west", "south"), ("east", "floor")):
        e = angle_between(planes[a], planes[b])
        out[f"angle {a}-{b}"] = e.value, e.sigma
    for a, b, start, end in (("west", "south", "floor", "ceiling"), ("north", "floor", "west", "east")):
        length = edge_length(planes[a], planes[b], planes[start], planes[end])
        out[f"length {a}/{b}"] = length.value, length.sigma
    for axis, found in zip("xy", intersect_two(planes["west"], planes["north"]).lean, strict=True):
        out[f"edge west/north lean {axis}"] = found.value, found.sigma
    for axis, found in zip("xy", rise(planes["tilted"]), strict=True):
        out[f"tilted rise {axis}"] = found.value, found.sigma
    slope = plane_slope(planes["tilted"])
    out["tilted slope"] = slope.value, slope.sigma
    return out


def _clouds(rng: np.random.Generator) -> dict[str, Array]:
    clouds = {name: face(name, 120, rng, 0.4 if name == "south" else 1.0) for name in FACES}
    tilted = face("ceiling", 120, rng)
    tilted[:, 2] -= 0.5 * tilted[:, 0]
    clouds["tilted"] = tilted
    return clouds


def _fit(clouds: dict[str, Array], true: dict[str, Array], fit: Callable[[Array], Plane]) -> dict[str, Plane]:
    planes = {}
    for name, points in clouds.items():
        plane = fit(points)
        reference = np.array([1.0, 1.0, 1.0]) if name != "tilted" else np.array([0.5, 0.0, 1.0])
        planes[name] = plane.facing(plane.centroid + reference)
    return planes


def independent(runs: int) -> None:
    """Sample standard deviations against the analytic ones."""
    rng = np.random.default_rng(0)
    noise = PointNoise(0.004, 0.0001, 1e-4)
    true = _clouds(rng)
    values: dict[str, list[float]] = {}
    sigmas: dict[str, list[float]] = {}
    for _ in range(runs):
        clouds = {name: noisy(points, noise, rng) for name, points in true.items()}
        for name, (value, sigma) in quantities(_fit(clouds, true, lambda p: fit_plane(p, STATION, noise))).items():
            values.setdefault(name, []).append(value)
            sigmas.setdefault(name, []).append(sigma)
    ideal = quantities(_fit(true, true, lambda p: fit_plane(p, STATION, noise)))
    worst, held = 0.0, []
    print(f"{'quantity':42s} {'analytic':>10s} {'sampled':>10s} {'ratio':>7s} {'95 % holds':>10s}")
    for name, sample in values.items():
        if len(sample) < runs:
            continue
        analytic, sampled = float(np.mean(sigmas[name])), float(np.std(sample))
        inside = np.abs(np.array(sample) - ideal[name][0]) <= Z95 * np.array(sigmas[name])
        worst = max(worst, abs(sampled / analytic - 1.0))
        held.append(float(inside.mean()))
        print(f"{name:42s} {analytic:10.3e} {sampled:10.3e} {sampled / analytic:7.3f} {held[-1]:10.3f}")
    print(f"independent noise, {runs} runs, {len(held)} quantities: largest difference of a standard deviation "
          f"{worst:.1%}; 95 % intervals hold {min(held):.1%} to {max(held):.1%}")


def uneven(runs: int, sigma: float = 0.002, length: float = 0.5) -> None:
    """How often 95 % intervals hold when surfaces are uneven and this is estimated from each run's residuals."""
    rng = np.random.default_rng(1)
    noise = PointNoise(0.002, 0.0, 4e-5)
    true = {name: face(name, 1500, rng) for name in FACES}
    true["tilted"] = face("ceiling", 1500, rng)
    true["tilted"][:, 2] -= 0.5 * true["tilted"][:, 0]
    factors = {}
    for name, points in true.items():
        plane = fit_plane(points, STATION, noise)
        at = np.round((points - plane.centroid) @ plane.axes.T / 0.12) * 0.12
        cells, index = np.unique(at, axis=0, return_inverse=True)
        distance = np.linalg.norm(cells[:, None] - cells[None], axis=2)
        root = np.linalg.cholesky(np.exp(-distance / length) + 1e-9 * np.eye(len(cells)))
        factors[name] = (plane.normal, root, index.ravel())
    inside: dict[str, list[bool]] = {}
    naive: list[bool] = []
    estimates = []
    ideal = quantities(_fit(true, true, lambda p: fit_plane(p, STATION, noise)))
    for _ in range(runs):
        clouds = {}
        for name, points in true.items():
            normal, root, index = factors[name]
            bumps = sigma * (root @ rng.standard_normal(len(root)))[index]
            clouds[name] = noisy(points + bumps[:, None] * normal, noise, rng)

        def fit(points: Array) -> Plane:
            plane, found = with_unevenness(fit_plane(points, STATION, noise), points)
            estimates.append(found.sigma if found else 0.0)
            return plane

        for name, (value, s) in quantities(_fit(clouds, true, fit)).items():
            if name in ideal:
                inside.setdefault(name, []).append(abs(value - ideal[name][0]) <= Z95 * s)
        for name, (value, s) in quantities(_fit(clouds, true, lambda p: fit_plane(p, STATION, noise))).items():
            if name in ideal:
                naive.append(abs(value - ideal[name][0]) <= Z95 * s)
    kinds: dict[str, list[bool]] = {}
    for name, hits in inside.items():
        kinds.setdefault(name.split()[0] if name.split()[0] not in true else "plane", []).extend(hits)
    for kind, hits in kinds.items():
        print(f"uneven, {kind:10s} 95 % interval holds {np.mean(hits):.1%}")
    everything = [hit for hits in inside.values() for hit in hits]
    print(f"uneven {sigma * 1000:g} mm over {length:g} m, {runs} runs: 95 % intervals hold {np.mean(everything):.1%} with the "
          f"estimated unevenness (median {np.median(estimates) * 1000:.2f} mm), {np.mean(naive):.1%} without")


def walls(runs: int, cases: Sequence[tuple[float, float]]) -> None:
    """The same for a single wall, at its corners and its middle, uneven by (mm) over (m) of each case."""
    places = np.array([[0.0, y * ROOM[1], z * ROOM[2]] for y, z in ((0, 0), (1, 0), (0.5, 0.5), (1, 1), (0.1, 0.5))])
    noise = PointNoise(0.002, 0.0, 4e-5)
    for sigma, length in cases:
        rng = np.random.default_rng((7, round(10 * sigma), round(10 * length)))
        true = face("west", 1500, rng)
        cells, index = np.unique(np.round(true[:, 1:] / 0.12) * 0.12, axis=0, return_inverse=True)
        root = np.linalg.cholesky(
            np.exp(-np.linalg.norm(cells[:, None] - cells[None], axis=2) / length) + 1e-9 * np.eye(len(cells))
        )
        inside = []
        for _ in range(runs):
            cloud = true.copy()
            cloud[:, 0] += 0.001 * sigma * (root @ rng.standard_normal(len(cells)))[index.ravel()]
            cloud = noisy(cloud, noise, rng)
            plane, _ = with_unevenness(fit_plane(cloud, STATION, noise), cloud)
            inside.append(np.abs(plane.distance(places)) < Z95 * plane.sigma_at(places))
        print(f"wall uneven by {sigma:g} mm over {length:g} m, {runs} runs: 95 % intervals hold {np.mean(inside):.1%}")


def findings() -> None:
    """Slope against number of points and coverage; vertices of a room, flat and uneven."""
    rng = np.random.default_rng(2)
    for count in (1000, 2750, 5000, 9000, 13000):
        plane = fit_plane(noisy(face("west", count, rng), BLK360, rng), STATION, BLK360)
        print(f"wall, {count:6d} points: slope sigma {np.degrees(plumb_deviation(plane).sigma):.4f} deg")
    for coverage in (1.0, 0.6, 0.3, 0.15):
        plane = fit_plane(noisy(face("west", 5000, rng, coverage), BLK360, rng), STATION, BLK360)
        lean = plumb_deviation(plane).sigma
        print(f"wall, 5000 points on the upper {coverage:4.0%}: slope sigma {np.degrees(lean):.4f} deg, position at the foot "
              f"{float(plane.sigma_at(np.array([0.0, 2.0, 0.0]))[0]) * 1000:.2f} mm")
    for bumps in (0.0, 0.003):
        planes = {}
        for name in FACES:
            points = face(name, 6000, rng)
            axis, _ = FACES[name]
            waves = rng.normal(0.0, 1.0, (8, 3)) * 2 * np.pi / 1.5
            field = np.cos(points @ waves.T + rng.uniform(0, 6.28, 8)).sum(axis=1) * bumps / 2.0
            points[:, axis] += field
            cloud = noisy(points, BLK360, rng)
            plane, _ = with_unevenness(fit_plane(cloud, STATION, BLK360), cloud)
            planes[name] = plane
        sigma = [intersect_three(planes[a], planes[b], planes[c]).sigma * 1000
                 for a in ("west", "east") for b in ("south", "north") for c in ("floor", "ceiling")]
        print(f"vertices of a room, surfaces {'uneven by 3 mm' if bumps else 'flat'}: sigma {np.mean(sigma):.2f} mm "
              f"({min(sigma):.2f}-{max(sigma):.2f} mm)")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=10000)
    parser.add_argument("--uneven-runs", type=int, default=400)
    parser.add_argument("--wall", type=float, nargs=2, metavar=("MM", "M"), help="only a wall uneven by MM over M metres")
    arguments = parser.parse_args()
    if arguments.wall:
        walls(arguments.uneven_runs, [tuple(arguments.wall)])
    else:
        independent(arguments.runs)
        uneven(arguments.uneven_runs)
        walls(arguments.uneven_runs, WALLS)
        findings()
