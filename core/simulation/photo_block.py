"""A block of photos of a building as it was built: tie points in images, control points, and a dense cloud.

For tests and benchmarks of what photos prove. Images are not rendered: rays say what each camera sees.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..imagery.bundle_problem import BundleProblem, Control, ImageObservations
from ..imagery.camera import Camera, Interior
from ..imagery.detect_lines import ImageLines
from ..imagery.visible_edges import EdgeViewer
from ..model.elements import BuildingModel
from ..model.raycast import RayScene
from .photo import looking

Array = NDArray[np.float64]
LENS = Interior(4000, 3000, 2900.0, 2900.0, 1999.5, 1499.5, (-0.05, 0.01, 0.0005, -0.0003, 0.0))
NOISE_PX, CONTROL_M = 0.5, 0.002
FREE = ("f", "cx", "cy", "k1", "k2", "p1", "p2")
LEAST_RAYS, MOST_RAYS = 3, 8
SAME_M = 0.01
WAVES, WAVELENGTHS_M = 24, (0.3, 1.2)


def cameras_around(places: Array, headings: int, lens: Interior = LENS) -> tuple[Camera, ...]:
    """At each place (P, 3) a ring of photos, every other one tilted up or down."""
    found = []
    for p, place in enumerate(places):
        for k in range(headings):
            tilt = (0.25, -0.25, 0.0)[k % 3]
            turn = looking(2 * math.pi * (k + 0.5 * (p % 2)) / headings, tilt, 0.0)
            found.append(Camera(f"{p}_{k}.jpg", lens, turn, place))
    return tuple(found)


def photograph_block(
    scene: RayScene, cameras: Sequence[Camera], per_image: int, seed: int, *, control: int = 12, noise_px: float = NOISE_PX,
    track: int | None = None, closed: bool = False, free: tuple[str, ...] = FREE,
) -> tuple[BundleProblem, Array]:
    """A bundle problem whose tie points lie on what the cameras see of ``scene``, and the true points (M, 3).

    A point is found again in the next ``track`` images only (a series; the first follow the last where it is ``closed``), or
    in all that see it.
    """
    rng = np.random.default_rng((seed, 21))
    points, source = [], []
    for number, camera in enumerate(cameras):
        pixel = rng.uniform(0, 1, (per_image, 2)) * [camera.interior.width - 1, camera.interior.height - 1]
        ray = camera.rays(pixel)
        reach, triangle = scene.first_hit(np.repeat(camera.position[None], len(ray), 0), ray)
        hit = triangle >= 0
        points.append(camera.position + ray[hit] * reach[hit, None])
        source.append(np.full(int(hit.sum()), number))
    cloud, first_image = np.concatenate(points), np.concatenate(source)
    camera_of, point_of, pixels = [], [], []
    for k, camera in enumerate(cameras):
        with np.errstate(invalid="ignore"):
            pixel = camera.interior.distort(camera.project(cloud))
            inside = ((pixel > 0) & (pixel < [camera.interior.width - 1, camera.interior.height - 1])).all(axis=1)
        if track is not None:
            later = (k - first_image) % len(cameras) if closed else k - first_image
            inside &= (later >= 0) & (later <= track)
        rows = np.flatnonzero(inside)
        to = cloud[rows] - camera.position
        far = np.linalg.norm(to, axis=1)
        first, _ = scene.first_hit(np.repeat(camera.position[None], len(to), 0), to / far[:, None])
        rows = rows[np.abs(first - far) < SAME_M]
        camera_of.append(np.full(len(rows), k))
        point_of.append(rows)
        pixels.append(pixel[rows])
    c, p, xy = np.concatenate(camera_of), np.concatenate(point_of), np.concatenate(pixels)
    c, p, xy, good = thinned(c, p, xy, len(cloud), rng)
    cloud = cloud[good]
    known = _spread(cloud, control) if control else np.zeros(0, np.int64)
    return BundleProblem(
        tuple(one.moved(rng.normal(0, 0.002, 3), rng.normal(0, 0.02, 3)) for one in cameras), (cameras[0].interior,),
        np.zeros(len(cameras), np.int64), cloud + rng.normal(0, 0.02, cloud.shape),
        ImageObservations(c, p, xy + rng.normal(0, noise_px, xy.shape), np.full(len(c), noise_px)),
        Control(known, cloud[known] + rng.normal(0, CONTROL_M, (len(known), 3)), np.full((len(known), 3), CONTROL_M)),
        free,
    ), cloud


def as_built(model: BuildingModel, shift: Array) -> BuildingModel:
    """The model with its elements moved by ``shift`` (E, 3) [m]."""
    moved = model.vertices.copy()
    for e in range(len(model.elements)):
        moved[np.unique(model.triangles[model.triangle_element == e])] += shift[e]
    return replace(model, vertices=moved)


def edge_lines(viewer: EdgeViewer, camera: Camera, noise_px: float, rng: np.random.Generator) -> ImageLines:
    """The lines that a detector would find on the edges that ``camera`` sees, with noise of each end."""
    seen = viewer.look(camera)
    seen_px = seen.pixel + rng.normal(0, noise_px, seen.pixel.shape)
    order = np.argsort(-seen.length_px, kind="stable")
    start, end = seen_px[order, :2], seen_px[order, 2:]
    length = np.linalg.norm(end - start, axis=1)
    count = len(order)
    return ImageLines(
        start, end, np.full(count, noise_px / math.sqrt(2.0)), math.sqrt(2.0) * noise_px / length, np.full(count, 100.0),
        length / length.max(initial=1.0),
    )


def walk(length: float, images: int, lens: Interior = LENS) -> tuple[Camera, ...]:
    """A series of photos along x, looking ahead, in a corridor of ``length`` [m] that is 2.4 m wide."""
    found = []
    for k in range(images):
        place = np.array([0.8 + k / (images - 1) * (length - 3.8), 1.2 + 0.2 * math.sin(1.1 * k), 1.5 + 0.1 * (k % 2)])
        found.append(Camera(f"{k:03d}.jpg", lens, looking(0.2 * math.sin(0.9 * k), -0.05, 0.0), place))
    return tuple(found)


def walk_around(side: float, images: int, corner: float, lens: Interior = LENS) -> tuple[Camera, ...]:
    """A series of photos, looking ahead, once around a square of ``side`` [m], ``corner`` [m] its corners' radius."""
    straight, arc = side - 2.0 * corner, 0.5 * math.pi * corner
    found = []
    for k in range(images):
        leg, at = divmod(k / images * 4.0 * (straight + arc), straight + arc)
        turned = max(at - straight, 0.0) / corner
        along = np.array([
            corner + min(at, straight) + corner * math.sin(turned), corner * (1.0 - math.cos(turned)),
        ]) - side / 2.0
        c, s = (round(f(leg * math.pi / 2.0)) for f in (math.cos, math.sin))
        place = np.array([c * along[0] - s * along[1], s * along[0] + c * along[1], 1.5 + 0.1 * (k % 2)])
        turn = looking(leg * math.pi / 2.0 + turned + 0.1 * math.sin(0.9 * k), -0.05, 0.0)
        found.append(Camera(f"{k:03d}.jpg", lens, turn, place))
    return tuple(found)


def _spread(points: Array, count: int) -> NDArray[np.int64]:
    """Rows (count,) of points far from each other."""
    chosen = [int(np.argmin(points.sum(axis=1)))]
    away = np.full(len(points), np.inf)
    for _ in range(count - 1):
        away = np.minimum(away, np.linalg.norm(points - points[chosen[-1]], axis=1))
        chosen.append(int(np.argmax(away)))
    return np.array(chosen, dtype=np.int64)


def dense_cloud(
    scene: RayScene, cameras: Sequence[Camera], step_px: float, sigma: float, seed: int
) -> tuple[Array, NDArray[np.float32]]:
    """Points (N, 3) and normals (N, 3) of a dense match: half the variance of ``sigma`` [m] is noise of each point, half is
    shared by those around it, as smoothing in the match makes it."""
    rng = np.random.default_rng((seed, 22))
    waves = rng.normal(size=(WAVES, 3))
    waves *= (2 * np.pi / rng.uniform(*WAVELENGTHS_M, WAVES) / np.linalg.norm(waves, axis=1))[:, None]
    phase = rng.uniform(0, 2 * np.pi, WAVES)
    points, normals = [], []
    for camera in cameras:
        lens = camera.interior
        grid = np.meshgrid(np.arange(0, lens.width - 1, step_px), np.arange(0, lens.height - 1, step_px))
        ray = camera.rays(np.stack(grid, axis=-1).reshape(-1, 2) + rng.uniform(0, 1, (grid[0].size, 2)))
        reach, triangle = scene.first_hit(np.repeat(camera.position[None], len(ray), 0), ray)
        hit = triangle >= 0
        place = camera.position + ray[hit] * reach[hit, None]
        normal = scene.normal[triangle[hit]]
        normal = normal * -np.sign(np.einsum("ni,ni->n", normal, ray[hit]))[:, None]
        smooth = np.cos(place @ waves.T + phase).sum(axis=1) * np.sqrt(2.0 / WAVES)
        off = sigma * np.sqrt(0.5) * (smooth + rng.normal(size=len(place)))
        points.append(place + off[:, None] * normal)
        normals.append(normal.astype(np.float32))
    return np.concatenate(points), np.concatenate(normals)


def thinned(
    camera: NDArray[np.int64], point: NDArray[np.int64], pixel: Array, points: int, rng: np.random.Generator
) -> tuple[NDArray[np.int64], NDArray[np.int64], Array, NDArray[np.bool_]]:
    """Of the observations (N,) at most eight of a point, chosen by chance, and none of a point with fewer than three.

    Returns camera, number of the point among those that are left, pixel, and which of the ``points`` are left.
    """
    order = np.lexsort((rng.random(len(camera)), point))
    camera, point, pixel = camera[order], point[order], pixel[order]
    kept = np.arange(len(point)) - np.searchsorted(point, point) < MOST_RAYS
    camera, point, pixel = camera[kept], point[kept], pixel[kept]
    good = np.bincount(point, minlength=points) >= LEAST_RAYS
    kept = good[point]
    return camera[kept], (np.cumsum(good) - 1)[point[kept]], pixel[kept], good
