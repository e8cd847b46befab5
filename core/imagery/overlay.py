"""A photo with the model's edges over it, before and after."""

from __future__ import annotations

import base64
import io
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup, escape
from numpy.typing import NDArray

from .camera import Camera
from .read_image import eight_bits, opened_image
from .register_image import ImageRegistration
from .visible_edges import VisibleEdges

Vector = NDArray[np.float64]
WIDTH_PX = 1000
PIECES = 24
"""An edge is drawn in so many pieces, since the lens bends it."""
BEFORE, PLANNED, KEPT, LEFT_OUT = (235, 64, 52), (255, 255, 255), (28, 214, 90), (255, 190, 30)


def overlay_pair(path: str | Path, found: ImageRegistration) -> Markup:
    """Two pictures as HTML: edges from the coarse pose; edges from the refined one, with the lines that were matched."""
    camera, coarse = found.camera, found.coarse.camera
    first = _picture(path, lambda draw, scale: _edges(draw, found.before, coarse, scale, BEFORE))

    def after(draw: Any, scale: float) -> None:
        if found.after is not None:
            _edges(draw, found.after, camera, scale, PLANNED)
        for match in found.matches:
            ends = match.line.reshape(2, 2)
            _line(draw, camera, ends[0], ends[1], scale, KEPT if match.kept else LEFT_OUT, 2)

    second = _picture(path, after)
    name = escape(Path(path).name)
    return Markup("").join([
        Markup('<p><img alt="{}: edges of the model from the coarse pose" src="{}"></p>').format(name, first),
        Markup('<p><img alt="{}: edges from the refined pose, matched lines" src="{}"></p>').format(name, second),
    ])


def _picture(path: str | Path, draw_on: Any) -> str:
    from PIL import ImageDraw

    with opened_image(Path(path)) as image:
        scale = min(WIDTH_PX / image.width, 1.0)
        small = eight_bits(image).convert("RGB").resize((round(image.width * scale), round(image.height * scale)))
    draw_on(ImageDraw.Draw(small), scale)
    stream = io.BytesIO()
    small.save(stream, "JPEG", quality=80)
    return "data:image/jpeg;base64," + base64.b64encode(stream.getvalue()).decode("ascii")


def _edges(draw: Any, edges: VisibleEdges, camera: Camera, scale: float, color: tuple[int, int, int]) -> None:
    ends = camera.project(edges.start), camera.project(edges.end)
    for a, b in zip(*ends, strict=True):
        if np.isfinite(a).all() and np.isfinite(b).all():
            _line(draw, camera, a, b, scale, color, 1)


def _line(draw: Any, camera: Camera, a: Vector, b: Vector, scale: float, color: tuple[int, int, int], width: int) -> None:
    lens = camera.interior
    ideal = a + np.linspace(0.0, 1.0, PIECES)[:, None] * (b - a)
    inside = ((ideal > -0.1 * lens.width) & (ideal < 1.1 * lens.width)).all(axis=1)
    seen = (lens.distort(ideal[inside]) + 0.5) * scale
    if len(seen) > 1:
        draw.line([tuple(map(float, p)) for p in seen], fill=color, width=width)
