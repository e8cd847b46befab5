"""Photos of simple scenes made in code: a room's edges seen by a camera, and a ring of cameras around points."""

from __future__ import annotations

import numpy as np

from bim_verify.core.imagery.bundle_problem import BundleProblem, Control, ImageObservations
from bim_verify.core.imagery.camera import Camera, Interior, from_omega_phi_kappa
from bim_verify.core.imagery.uncertain_lines import LineMatches, join

INTERIOR = Interior(1600, 1200, 1333.3, 1333.3, 799.5, 599.5)
CAMERA = Camera(
    "room", INTERIOR, from_omega_phi_kappa(*np.radians([-67.318, 1.8, 29.498])), np.array([43.907, 28.847, 8.053])
)
BOXES = (
    ((42.2, 23.2, 7.3), (43.8, 23.3, 8.6)), ((42.4, 25.6, 6.4), (43.6, 26.3, 7.14)), ((44.3, 26.4, 6.4), (45.5, 27.2, 7.14)),
    ((44.0, 23.8, 6.4), (44.6, 24.5, 7.5)), ((43.2, 26.9, 6.4), (43.7, 27.3, 7.4)),
)


SHORTEST_PX = 60.0


def edges() -> tuple[np.ndarray, np.ndarray]:
    """Both ends (N, 3) of the boxes' edges."""
    start, end = [], []
    for low, high in BOXES:
        for corner in range(8):
            bits = [(corner >> axis) & 1 for axis in range(3)]
            here = np.where(bits, high, low)
            for axis in range(3):
                if not bits[axis]:
                    start.append(here)
                    end.append(np.where(np.arange(3) == axis, high, here))
    ends = np.array(start), np.array(end)
    long_enough = np.linalg.norm(CAMERA.project(ends[0]) - CAMERA.project(ends[1]), axis=1) > SHORTEST_PX
    return ends[0][long_enough], ends[1][long_enough]


def observed_lines(seed: int, model_sigma: float, pixel_sigma: float) -> tuple[LineMatches, Camera]:
    """Lines with noise of the image and of the model, and a coarse pose 15 cm and 1 degree off."""
    rng = np.random.default_rng(seed)
    start, end = edges()
    ends = [CAMERA.project(p) + rng.normal(0, pixel_sigma, (len(p), 2)) for p in (start, end)]
    image = np.tile(np.eye(2) * pixel_sigma**2, (len(start), 1, 1))
    line, cov = join(ends[0], ends[1], image, image)
    model = np.tile(np.eye(3) * model_sigma**2, (len(start), 1, 1))
    noisy = [p + rng.normal(0, model_sigma, p.shape) for p in (start, end)]
    coarse = CAMERA.moved(np.radians(rng.normal(0, 1, 3)), rng.normal(0, 0.15, 3))
    return LineMatches(line, cov, noisy[0], noisy[1], model, model), coarse


def bundle(seed: int, cameras: int = 8, count: int = 80) -> tuple[BundleProblem, np.ndarray]:
    """A ring of cameras that look at points in the middle, with control points and a lens to calibrate; and the truth."""
    fixed = np.random.default_rng(5)
    points = fixed.uniform(-1.5, 1.5, (count, 3))
    interior = Interior(3000, 2000, 2400.0, 2400.0, 1499.5, 999.5, (-0.05, 0.01, 0.0005, -0.0003, 0.0))
    made = []
    for number in range(cameras):
        angle = 2 * np.pi * number / cameras
        position = np.array([6 * np.cos(angle), 6 * np.sin(angle), 0.8 * np.sin(2 * angle)])
        forward = -position / np.linalg.norm(position)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        made.append(Camera(f"c{number}", interior, np.array([right, np.cross(forward, right), forward]), position))
    rng = np.random.default_rng(100 + seed)
    pixel = np.concatenate([interior.distort(c.project(points)) for c in made])
    observed = ImageObservations(
        np.repeat(np.arange(cameras), count), np.tile(np.arange(count), cameras),
        pixel + rng.normal(0, 0.5, pixel.shape), np.full(len(pixel), 0.5),
    )
    control = Control(np.arange(6), points[:6] + rng.normal(0, 0.002, (6, 3)), np.full((6, 3), 0.002))
    start = tuple(c.moved(rng.normal(0, 0.003, 3), rng.normal(0, 0.03, 3)) for c in made)
    rough = Interior(3000, 2000, 2410.0, 2410.0, 1499.5, 999.5)
    problem = BundleProblem(
        start, (rough,), np.zeros(cameras, np.int64), points + rng.normal(0, 0.03, points.shape), observed, control,
        ("f", "cx", "cy", "k1", "k2", "p1", "p2"),
    )
    return problem, points
