"""Bundle adjustment: time and memory of 200 images and 50 000 tie points, and whether its covariances are true.

    python scripts/bench_bundle.py [--images 200] [--points 50000] [--runs 100] [--quick]

The block is a walk through a hall of 24 x 16 x 4 m, every tie point seen by up to 8 images with 0.5 pixels of noise, eight
control points of 2 mm, and a lens that is calibrated with it. The Monte Carlo repeats a smaller block of the same kind.
"""

from __future__ import annotations

import argparse
import json
import resource
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from headless_entry import package
from numpy.typing import NDArray

PACKAGE = package()

from scipy.stats import chi2  # noqa: E402

from bim_verify.core.imagery.bundle import adjust_bundle  # noqa: E402
from bim_verify.core.imagery.bundle_problem import BundleProblem, Control, ImageObservations  # noqa: E402
from bim_verify.core.imagery.camera import Camera, Interior  # noqa: E402
from bim_verify.core.simulation.photo_block import thinned  # noqa: E402

Array = NDArray[np.float64]
LENS = Interior(4000, 3000, 3000.0, 3000.0, 1999.5, 1499.5, (-0.05, 0.01, 0.0005, -0.0003, 0.0))
FREE = ("f", "cx", "cy", "k1", "k2", "p1", "p2")
NOISE_PX, CONTROL_M = 0.5, 0.002
HALL = (24.0, 16.0, 4.0)
CONTROL_POINTS = 8


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--images", type=int, default=200)
    parser.add_argument("--points", type=int, default=50_000)
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--quick", action="store_true", help="50 images, 5 000 points, 20 runs")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None)
    images, points, runs = (50, 5_000, 20) if options.quick else (options.images, options.points, options.runs)
    found = monte_carlo(runs) | speed(images, points)
    if options.json:
        options.json.write_text(json.dumps(found, indent=1), encoding="ascii")


def block(images: int, count: int, seed: int) -> tuple[BundleProblem, tuple[Camera, ...], Array]:
    """A block with noise from ``seed``; its geometry is the same for every seed."""
    fixed = np.random.default_rng(1)
    points = fixed.uniform(0, 1, (count, 3)) * HALL
    wall = fixed.integers(0, 4, count)
    for k, (axis, value) in enumerate(((0, 0.0), (0, HALL[0]), (1, 0.0), (1, HALL[1]))):
        points[wall == k, axis] = value
    cameras = []
    for k in range(images):
        turn = 2 * np.pi * k / images * 3
        position = np.array([
            HALL[0] / 2 + HALL[0] / 4 * np.cos(0.37 * turn + 1), HALL[1] / 2 + HALL[1] / 4 * np.sin(0.53 * turn),
            1.6 + 0.3 * np.sin(5 * turn),
        ])
        forward = np.array([np.cos(turn), np.sin(turn), 0.05 * np.sin(3 * turn)])
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, [0, 0, 1.0])
        right /= np.linalg.norm(right)
        cameras.append(Camera(f"image {k}", LENS, np.array([right, np.cross(forward, right), forward]), position))
    camera, point, pixel = [], [], []
    for k, one in enumerate(cameras):
        ideal = one.project(points)
        rows = np.flatnonzero(np.isfinite(ideal).all(axis=1) & (np.abs(ideal - [2000, 1500]) < 2600).all(axis=1))
        bent = LENS.distort(ideal[rows])
        seen = ((bent > 0) & (bent < [3999, 2999])).all(axis=1)
        camera.append(np.full(int(seen.sum()), k))
        point.append(rows[seen])
        pixel.append(bent[seen])
    c, p, xy = np.concatenate(camera), np.concatenate(point), np.concatenate(pixel)
    c, p, xy, good = thinned(c, p, xy, count, fixed)
    points = points[good]
    rng = np.random.default_rng((seed, 2))
    corners = np.array([[x, y, z] for x in (0, HALL[0]) for y in (0, HALL[1]) for z in (0.5, HALL[2])])
    well = np.flatnonzero(np.bincount(p, minlength=len(points)) >= 4)
    control = np.unique([well[np.argmin(np.linalg.norm(points[well] - corner, axis=1))] for corner in corners])
    problem = BundleProblem(
        tuple(one.moved(rng.normal(0, 0.005, 3), rng.normal(0, 0.05, 3)) for one in cameras),
        (replace(LENS, fx=3006.0, fy=3006.0, distortion=(0.0,) * 5),), np.zeros(images, np.int64),
        points + rng.normal(0, 0.05, points.shape),
        ImageObservations(c, p, xy + rng.normal(0, NOISE_PX, xy.shape), np.full(len(c), NOISE_PX)),
        Control(control, points[control] + rng.normal(0, CONTROL_M, (len(control), 3)), np.full((len(control), 3), CONTROL_M)),
        FREE,
    )
    return problem, tuple(cameras), points


def monte_carlo(runs: int) -> dict[str, float]:
    """Posterior standard deviations against the scatter of many runs."""
    squares: list[Array] = []
    stated: list[Array] = []
    chi, pose_squares, pose_stated, factors, inside = [], [], [], [], []
    for seed in range(runs):
        problem, cameras, points = block(24, 500, seed)
        found = adjust_bundle(problem)
        away = found.points - points
        squares.append(away**2)
        stated.append(found.point_covariance[:, [0, 1, 2], [0, 1, 2]])
        chi.append(np.einsum("pi,pij,pj->p", away, np.linalg.inv(found.point_covariance), away).mean())
        pose_squares.append([(a.position - b.position) ** 2 for a, b in zip(found.cameras, cameras, strict=True)])
        pose_stated.append(found.pose_covariance[:, [3, 4, 5], [3, 4, 5]])
        inside.append(((found.interiors[0].fx - LENS.fx) / (found.interior_sigma[0, 0] * LENS.fx)) ** 2)
        factors.append(found.variance_factor)
    per_axis = np.sqrt(np.mean(squares, axis=(0, 1)) / np.mean(stated, axis=(0, 1)))
    each = np.sqrt(np.mean(squares, axis=0).sum(axis=1) / np.mean(stated, axis=0).sum(axis=1))
    low, high = np.percentile(each, [5, 95])
    bounds = np.sqrt(chi2.ppf([0.025, 0.975], runs) / runs)  # of one parameter's scatter in so many runs
    poses = float(np.sqrt(np.mean(pose_squares) / np.mean(pose_stated)))
    print(
        f"Monte Carlo, {runs} runs of 24 images and {len(points)} tie points: scatter over predicted sigma of tie points x, y, "
        f"z {per_axis[0]:.3f} {per_axis[1]:.3f} {per_axis[2]:.3f}; of single points 5 to 95 % {low:.2f} to {high:.2f}; of "
        f"projection centres {poses:.3f}; of the focal length {np.sqrt(np.mean(inside)):.3f} "
        f"({bounds[0]:.2f} to {bounds[1]:.2f} at 95 %); chi-square per point {np.mean(chi):.2f} (3 expected); variance factor "
        f"{np.mean(factors):.3f}."
    )
    return {"points": float(per_axis.max()), "points_least": float(per_axis.min()), "poses": poses}


def speed(images: int, count: int) -> dict[str, float]:
    """Time and memory of one large block, covariances of all points included."""
    problem, _, points = block(images, count, 0)
    adjust_bundle(block(24, 300, 0)[0])  # kernels are compiled once
    begin, worked = time.perf_counter(), time.process_time()
    found = adjust_bundle(problem)
    seconds, worked = time.perf_counter() - begin, time.process_time() - worked
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    error = np.sqrt(((found.points - points) ** 2).mean())
    print(
        f"{images} images, {len(points)} tie points, {len(problem.observed)} observations: {seconds:.1f} s, {worked:.1f} s of "
        f"processor time, {found.rounds} rounds, peak {peak:.2f} GB; tie points off by {1000 * error:.2f} mm (rms), variance "
        f"factor {found.variance_factor:.3f}."
    )
    return {"seconds": seconds, "peak_gb": peak}


if __name__ == "__main__":
    main()
