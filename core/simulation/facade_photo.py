"""A photo of a planned facade: where a person with a camera stands, and a quick painted picture for tests.

``scripts/render_facades.py`` makes better pictures in Blender of the same plans, with the same cameras and truth.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..imagery.camera import Camera, Interior
from .facade_plan import ElementType, FacadePlan
from .photo import looking

Array = NDArray[np.float64]
ARCH_STEPS = 16
FILLED = 0.93
"""Of the image by the facade, in the tighter direction."""
REVEAL_M = 0.15
OVERSAMPLING = 2


def arch(kind: ElementType, inset: float) -> list[tuple[float, float]]:
    """The outline of an opening from its left lower corner, counter-clockwise, drawn in by ``inset`` metres."""
    w, h, rise = kind.width, kind.height, kind.rise
    if rise <= 0:
        return [(inset, inset), (w - inset, inset), (w - inset, h - inset), (inset, h - inset)]
    radius = (w * w / 4 + rise * rise) / (2 * rise)
    half = math.asin(min((w / 2 - inset) / (radius - inset), 1.0))
    top = [
        (w / 2 + (radius - inset) * math.sin(a), h - radius + (radius - inset) * math.cos(a))
        for a in np.linspace(half, -half, ARCH_STEPS)
    ]
    return [(inset, inset), (w - inset, inset), *top]


def street_camera(plan: FacadePlan, size: int, rng: np.random.Generator) -> Camera:
    """A camera in the street (now and then at a window opposite) that sees the whole facade; ``size`` in pixels."""
    largest = max(plan.width, plan.height)
    place = np.array(
        [
            plan.width * rng.uniform(0.1, 0.9),
            -largest * rng.uniform(0.95, 1.7),
            rng.uniform(1.5, 2.0) if rng.random() < 0.65 else rng.uniform(3.0, 0.7 * plan.height),
        ]
    )
    corners = np.array([[x, 0.0, z] for x in (0.0, plan.width) for z in (0.0, plan.height)])
    aim = corners.mean(axis=0)
    roll = float(rng.normal(0.0, 0.01))
    wide = plan.width >= 0.95 * plan.height
    width, height = (size, round(0.75 * size)) if wide else (round(0.75 * size), size)
    focal = float(size)
    lens = Interior(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2)
    rotation = np.eye(3)
    for _ in range(6):
        way = aim - place
        rotation = looking(math.atan2(way[1], way[0]), math.atan2(way[2], math.hypot(way[0], way[1])), roll)
        seen = (corners - place) @ rotation.T
        flat = seen[:, :2] / seen[:, 2:]
        low, high = flat.min(axis=0), flat.max(axis=0)
        focal = float(FILLED * np.min(np.array([width, height]) / (high - low)))
        middle = 0.5 * (low + high)
        aim = aim + np.linalg.norm(way) * (np.array([middle[0], middle[1], 0.0]) @ rotation)
    k1 = float(rng.uniform(-0.04, 0.01))
    shift = rng.normal(0.0, 0.004 * size, 2)
    lens = Interior(
        width,
        height,
        focal,
        focal,
        (width - 1) / 2 + float(shift[0]),
        (height - 1) / 2 + float(shift[1]),
        (k1, 0.0, 0.0, 0.0, 0.0),
    )
    return Camera(f"facade_{plan.seed:02d}.jpg", lens, rotation, place)


def homography(camera: Camera) -> Array:
    """(3, 3) from the wall (x, z, 1) in metres to ideal pixels."""
    return np.asarray(camera.matrix[:, [0, 2, 3]])


def truth_of(plan: FacadePlan, camera: Camera) -> dict[str, Any]:
    """What is known of the picture, as plain data; metres, and pixels of the image as the lens bends it."""
    corners = np.array([[0.0, 0.0, plan.height], [plan.width, 0.0, plan.height], [plan.width, 0.0, 0.0], [0.0, 0.0, 0.0]])
    lens = camera.interior
    return {
        "style": plan.style,
        "finish": plan.finish,
        "width_m": plan.width,
        "height_m": plan.height,
        "levels_m": list(plan.levels),
        "corners_px": lens.distort(camera.project(corners)).tolist(),
        "homography": homography(camera).tolist(),
        "lens": {"size": [lens.width, lens.height], "f": lens.fx, "c": [lens.cx, lens.cy], "k1": lens.distortion[0]},
        "elements": [
            {"box_m": list(plan.box(e)), "kind": plan.types[e.type].kind, "rise_m": plan.types[e.type].rise, "type": e.type}
            for e in plan.elements
        ],
    }


def paint_facade(plan: FacadePlan, camera: Camera, seed: int = 0) -> NDArray[np.uint8]:
    """A colour image (H, W, 3), RGB: flat paint with grain, frames, panes and one shadow, through the camera's lens."""
    import cv2

    rng = np.random.default_rng((seed, plan.seed, 33))
    lens = camera.interior
    scale = OVERSAMPLING * max(lens.width, lens.height) / max(plan.width, plan.height)
    border = 2.0
    wide, high = (round((v + 2 * border) * scale) for v in (plan.width, plan.height))

    def at(x: float, z: float) -> tuple[int, int]:
        return round((x + border) * scale), round((plan.height + border - z) * scale)

    flat = np.empty((high, wide, 3), dtype=np.float32)
    flat[:] = (150, 185, 225)
    cv2.rectangle(flat, (0, at(0, 0)[1]), (wide, high), (105, 103, 100), -1)
    base = rng.uniform(120, 215) * (1.0 - rng.uniform(0.0, 0.35) * np.array([0.0, 0.5, 1.0]))
    wall = base + cv2.resize(rng.normal(0, 12, (high // 24, wide // 24, 1)).astype(np.float32), (wide, high))[..., None]
    inside = np.zeros((high, wide), dtype=np.uint8)
    cv2.rectangle(inside, at(0, plan.height), at(plan.width, 0), 1, -1)
    flat = np.where(inside[..., None] == 1, wall, flat).astype(np.float32)
    frame = (235, 235, 230) if base.mean() < 170 or rng.random() < 0.5 else (60, 55, 50)
    leaf = tuple(float(v) for v in rng.uniform(30, 100, 3))
    for element in plan.elements:
        kind = plan.types[element.type]

        def ring(inset: float, kind: ElementType = kind, x: float = element.x, z: float = element.z) -> NDArray[np.int32]:
            return np.array([at(x + a, z + b) for a, b in arch(kind, inset)], dtype=np.int32)

        solid = kind.kind == "door" and not kind.glazed
        cv2.fillPoly(flat, [ring(0.0)], leaf if solid else frame)
        pane = float(rng.uniform(25, 70))
        cv2.fillPoly(flat, [ring(0.08)], tuple(0.8 * v for v in leaf) if solid else (pane, pane + 5, pane + 12))
        for k in range(1, kind.casements):
            x = element.x + kind.width * k / kind.casements
            top = element.z + kind.height - (kind.rise if kind.casements > 2 else 0.05)
            cv2.rectangle(flat, at(x - 0.03, top), at(x + 0.03, element.z), leaf if solid else frame, -1)
        x0, z0, x1, z1 = plan.box(element)
        if kind.rise == 0:
            shade = flat[at(0, z1)[1] : at(0, z1 - 0.1)[1], at(x0, 0)[0] : at(x1, 0)[0]]
            shade *= 0.5
        if kind.kind == "window" and plan.sills:
            cv2.rectangle(flat, at(x0 - 0.06, z0), at(x1 + 0.06, z0 - 0.06), tuple(float(v) for v in 1.1 * base), -1)
    column, row = np.meshgrid(np.arange(lens.width, dtype=np.float64), np.arange(lens.height, dtype=np.float64))
    ideal = lens.undistort(np.column_stack([column.ravel(), row.ravel()]))
    on_wall = np.column_stack([ideal, np.ones(len(ideal))]) @ np.linalg.inv(homography(camera)).T
    on_wall = on_wall[:, :2] / on_wall[:, 2:]
    u = ((on_wall[:, 0] + border) * scale).reshape(row.shape).astype(np.float32)
    v = ((plan.height + border - on_wall[:, 1]) * scale).reshape(row.shape).astype(np.float32)
    smooth = cv2.GaussianBlur(flat, (0, 0), 0.5 * OVERSAMPLING)
    seen = cv2.remap(smooth, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.clip(seen + rng.normal(0, 2.5, seen.shape), 0, 255).astype(np.uint8)
