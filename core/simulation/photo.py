"""A quick photo of a model by ray casting: plain paint lit from the camera, through a lens with distortion.

For tests and benchmarks; ``scripts/render_photos.py`` makes better ones in Blender.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..imagery.camera import Camera, Interior
from ..model.elements import BuildingModel
from ..model.raycast import RayScene
from .scene import build_scene
from .stand_points import find_stand_points

Array = NDArray[np.float64]
ROWS_AT_ONCE = 64
LIGHT = np.array([0.25, -0.5, 0.83])
"""Towards the light, camera frame with z backward."""


def photograph(
    model: BuildingModel, camera: Camera, *, shift: Array | None = None, oversampling: int = 2, noise: float = 2.0,
    seed: int = 0,
) -> NDArray[np.uint8]:
    """A grey image (H, W); ``shift`` (E, 3) [m] moves elements from their planned places, ``noise`` is in grey values."""
    scene = RayScene(model, shift)
    lens = camera.interior
    rng = np.random.default_rng((seed, 5))
    paint = rng.uniform(60.0, 220.0, len(model.elements) + 1)
    paint[-1] = 240.0
    step = 1.0 / oversampling
    x = (np.arange(lens.width * oversampling) + 0.5) * step - 0.5
    image = np.empty((lens.height, lens.width))
    light = (LIGHT * [1.0, 1.0, -1.0]) @ camera.rotation
    for top in range(0, lens.height, ROWS_AT_ONCE):
        rows = min(ROWS_AT_ONCE, lens.height - top)
        y = (np.arange(rows * oversampling) + 0.5) * step - 0.5 + top
        pixel = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        ray = camera.rays(pixel)
        _, triangle = scene.first_hit(np.repeat(camera.position[None], len(ray), 0), ray)
        normal = scene.normal[triangle]
        normal = normal * -np.sign(np.einsum("ni,ni->n", normal, ray))[:, None]
        shade = 0.55 + 0.45 * np.einsum("ni,i->n", normal, light)
        hit = triangle >= 0
        value = paint[np.where(hit, scene.element[triangle], -1)] * np.where(hit, shade, 1.0)
        image[top : top + rows] = value.reshape(rows, oversampling, lens.width, oversampling).mean(axis=(1, 3))
    return np.clip(image + rng.normal(0.0, noise, image.shape), 0, 255).astype(np.uint8)


def view_points(model: BuildingModel, lens: Interior, count: int, rng: np.random.Generator) -> list[Camera]:
    """Places on the floors and directions with a free sight: what a person with a camera chooses."""
    scene = RayScene(model)
    stands = find_stand_points(model, build_scene(model, {}), count=160, seed=int(rng.integers(1 << 30)))
    inside = stands.position[: 3 * len(stands.position) // 4]
    found: list[tuple[float, Camera]] = []
    x, y = np.meshgrid(np.linspace(0, lens.width - 1, 16), np.linspace(0, lens.height - 1, 12))
    rays = np.column_stack([(x.ravel() - lens.cx) / lens.fx, (y.ravel() - lens.cy) / lens.fy, np.ones(x.size)])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    for place in inside[rng.permutation(len(inside))]:
        best = (0.0, Camera("", lens, np.eye(3), place))
        for heading in rng.uniform(0, 2 * math.pi, 8):
            tilt, roll = rng.normal(-0.05, 0.12), rng.normal(0, 0.03)
            rotation = looking(heading, tilt, roll)
            depth, triangle = scene.first_hit(np.repeat(place[None], len(rays), 0), rays @ rotation)
            hit = triangle >= 0
            planes = len(np.unique(np.round(scene.normal[triangle[hit]], 2), axis=0)) if hit.any() else 0
            kinds = len(np.unique(scene.element[triangle[hit]])) if hit.any() else 0
            score = float(np.median(depth[hit])) if hit.mean() > 0.9 else 0.0
            score = min(score, 5.0) * min(planes, 5) * min(kinds, 8) if score > 1.8 and depth[hit].min() > 0.6 else 0.0
            if score > best[0]:
                best = (score, Camera("", lens, rotation, place))
        if best[0] > 0:
            found.append(best)
        if len(found) >= 4 * count:
            break
    found.sort(key=lambda pair: -pair[0])
    return [
        Camera(f"photo_{k:02d}.jpg", lens, camera.rotation, camera.position) for k, (_, camera) in enumerate(found[:count])
    ]


def looking(heading: float, tilt: float, roll: float) -> Array:
    """World to camera (3, 3) of a camera that looks along a heading [rad], tilted up and rolled."""
    forward = np.array([math.cos(heading) * math.cos(tilt), math.sin(heading) * math.cos(tilt), math.sin(tilt)])
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    c, s = math.cos(roll), math.sin(roll)
    return np.array([c * right + s * down, -s * right + c * down, forward])
