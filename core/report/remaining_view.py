"""Partly demolished elements in the report: what is left of each beside what was planned."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..change.results import CONFIRMED, DISAPPEARED, ChangeResult, ElementChange
from .palette import VOXEL_COLORS, to_bytes
from .pictures import png
from .remaining import Shape

MOST_SHAPES = 40
"""Drawn: those that lost most."""
MOST_PIXELS = 160
SIDES = (("from above", 0, 1), ("from the south (-y)", 0, 2), ("from the east (+x)", 1, 2))


@dataclass(frozen=True)
class ShapeView:
    """One element. Volumes in m3, None where its surface is open."""

    element: ElementChange
    planned: float | None
    left: float | None
    """With what was not seen."""
    gone: float | None
    side: str
    image: str
    """PNG, base64: its planned shape, in it red what is gone."""
    width: int
    height: int


def remaining_views(result: ChangeResult) -> list[ShapeView]:
    """Of the elements that lost most, those that lost most first."""
    rows = sorted(result.remaining, key=lambda row: (-result.elements[row].disappeared_volume, row))
    views = []
    for row in rows[:MOST_SHAPES]:
        shape, element = Shape.of(result, row), result.elements[row]
        if not len(shape.planned):
            continue
        volume = element.volume or None
        left = None if volume is None else shape.share * volume
        gone = None if volume is None or left is None else volume - left
        views.append(ShapeView(element, volume, left, gone, *_picture(shape)))
    return views


def _picture(shape: Shape) -> tuple[str, str, int, int]:
    """Side, image, width and height, from the side from which most of the planned shape is seen."""
    index = shape.box.index(shape.planned)
    index -= index.min(axis=0)
    size = index.max(axis=0) + 1
    side, across, up = max(SIDES, key=lambda s: int(size[s[1]] * size[s[2]]))
    place = index[:, [across, up]] // -(-int(size[[across, up]].max()) // MOST_PIXELS)
    width, height = (int(v) + 1 for v in place.max(axis=0))
    pixel = (height - 1 - place[:, 1]) * width + place[:, 0]
    planned, left = (np.bincount(pixel[of], minlength=width * height) for of in (slice(None), shape.left))
    return side, png(to_bytes(_color(planned, left)).reshape(height, width, 3)), width, height


def _color(planned: NDArray[np.int64], left: NDArray[np.int64]) -> NDArray[np.float64]:
    share = (left / np.maximum(planned, 1))[:, None]
    color = share * VOXEL_COLORS[CONFIRMED] + (1.0 - share) * VOXEL_COLORS[DISAPPEARED]
    return np.asarray(np.where((planned > 0)[:, None], color, 1.0))
