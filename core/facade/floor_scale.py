"""The scale of a facade from the height of its floors, when no length of it is known."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .boxes import find_boxes
from .features import features
from .pixel_box import groups

ROOF_M = 0.6
"""Of a facade's height that belongs to no floor: parapet, eave."""
SMALL_PX = 480
"""Rows of windows are seen as well in a small picture, and much quicker."""
FLOOR_COUNTS = (1, 2, 3, 4, 6, 8)
"""Scales that are tried; rows of a facade of five floors are seen with those of four and six."""
NARROWEST_M, WIDEST_M = 3.0, 120.0
SAME_PITCH = 0.15
"""Distances between rows whose logarithms differ by less are one."""
FITTING = 0.15
"""Standard deviation of the logarithm of the distance of rows over the floor height that was supposed to find them."""
UNLIKELY = 1e-3
NO_ROWS_SIGMA = 0.5


@dataclass(frozen=True)
class FloorScale:
    """Width of the facade [m], number of rows of windows, and how unsure it is which rows are floors (share of the width)."""

    width: float
    rows: int
    sigma: float


def scale_by_floors(picture: NDArray[np.uint8], aspect: float, floor_height: float) -> FloorScale:
    """Width of the facade from the distance of its rows of windows, for floors of ``floor_height`` [m].

    The search for windows needs a scale, the scale needs the rows. Rows are looked for with the scales of
    ``FLOOR_COUNTS``. Each distance of rows counts by how near to the floor height it is at the scale that found it;
    distances that agree count together, and the best supported one is taken. What else has support makes the sigma.
    """
    import cv2

    shrink = SMALL_PX / max(picture.shape[:2])
    if shrink < 1:
        small = cv2.resize(picture, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)
        picture = np.asarray(small, dtype=np.uint8)
    pitches, fit, rows = [], [], []
    for count in FLOOR_COUNTS:
        height = count * floor_height + ROOF_M
        if not NARROWEST_M < height / aspect < WIDEST_M:
            continue
        middles = _rows(picture, picture.shape[1] * aspect / height, 0.5 * floor_height)
        if len(middles) < 2:
            continue
        pitch = float(np.median(np.diff(middles))) / picture.shape[0]
        pitches.append(math.log(pitch))
        fit.append(math.log(pitch * height / floor_height))
        rows.append(len(middles))
    if not pitches:
        return FloorScale((floor_height + ROOF_M) / aspect, 1, NO_ROWS_SIGMA)
    place = np.array(pitches)
    weight = np.exp(-0.5 * (np.array(fit) / FITTING) ** 2) + UNLIKELY
    alike = np.abs(place[:, None] - place[None]) < SAME_PITCH
    best = int(np.argmax(alike @ weight))
    middle = float(np.average(place[alike[best]], weights=weight[alike[best]]))
    sigma = float(np.sqrt(np.average((place - middle) ** 2, weights=weight)))
    return FloorScale(floor_height / math.exp(middle) / aspect, rows[best], sigma)


def _rows(picture: NDArray[np.uint8], pixels_per_metre: float, least_m: float) -> list[float]:
    """Middles of the rows of windows [px], the highest first, at least so far apart."""
    seen = features(picture, pixels_per_metre)
    boxes = find_boxes(seen)
    found = [r for r in groups(boxes, "y", seen.scale) if len(r) > 1]
    out: list[float] = []
    for middle in sorted(float(np.median([0.5 * (boxes[k].y0 + boxes[k].y1) for k in r])) for r in found):
        if not out or middle - out[-1] > least_m * seen.scale:
            out.append(middle)
    return out
