"""One photo and its corners to a facade with windows and doors in metres."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from .boxes import find_boxes
from .classify import (
    STOREY_SIGMA,
    TYPICAL_STOREY_M,
    arch_rise,
    floors,
    group_types,
    kind_of,
)
from .features import Features, features
from .pixel_box import PixelBox, groups
from .records import Arrangement, Array, Facade, FacadeBox, Scale
from .rectify import CORNER_SIGMA_PX, aspect_ratio, order_corners, rectify

CONNECTED_M = 0.6
"""Elements are connected along an axis when what is between them is narrower than this."""
ROOF_M = 0.6
GIVEN_FLOOR_SIGMA = 0.02
MAKE_PX, LEAST_PX = 120, 60


def read_picture(
    image: NDArray[np.uint8],
    name: str,
    corners: Array,
    *,
    width: float | None = None,
    height: float | None = None,
    floor_height: float | None = None,
    focal: float | None = None,
    seed: int = 0,
) -> Facade:
    """The facade with these corners (4, 2) [px] in an image (H, W, 3), RGB.

    Lengths in metres, ``focal`` in pixels. Raises BimVerifyError when the corners are no rectangle in perspective, or too
    small in the image.
    """
    ring = order_corners(corners)
    size = (image.shape[1], image.shape[0])
    if np.ptp(ring, axis=0).min() < LEAST_PX:
        raise BimVerifyError(f"{name}: the facade is smaller than {LEAST_PX} pixels in the image; take a closer photo.")
    aspect, aspect_sigma = aspect_ratio(ring, size, focal, seed)
    if width and height:
        aspect = height / width
    picture = rectify(image, ring, aspect)
    warnings: list[str] = []
    across = width or (height / aspect if height else None)
    boxes, seen = [], None
    source: Literal["WIDTH", "HEIGHT", "BOTH", "FLOORHEIGHT"] = "BOTH" if width and height else "WIDTH" if width else "HEIGHT"
    pixel_sigma = CORNER_SIGMA_PX / float(np.ptp(ring[:, 0]))
    relative = pixel_sigma
    if across is None:
        source = "FLOORHEIGHT"
        across, rows = _by_floors(picture, aspect, floor_height)
        share = GIVEN_FLOOR_SIGMA if floor_height else STOREY_SIGMA
        relative = math.hypot(share, 0.3 / max(rows, 1) / 3)
        if not floor_height:
            warnings.append(
                f"No length is known: the scale is from a typical floor height of {TYPICAL_STOREY_M:g} m, and may be off by "
                f"{100 * relative:.0f} % (one sigma); give --width, --height or --floor-height."
            )
    seen = features(picture, picture.shape[1] / across)
    boxes = find_boxes(seen)
    if not boxes:
        warnings.append("No window or door was found.")
    scale = Scale(
        across, across * picture.shape[0] / picture.shape[1], source, relative, 0.0 if source == "BOTH" else aspect_sigma
    )
    found = _to_metres(seen, boxes, scale)
    found = [replace(b, type=t) for b, t in zip(found, group_types(found), strict=True)]
    found.sort(key=lambda b: (round(b.z0, 2), b.x0))
    levels = floors([(b.z0, b.z1) for b in found], scale.height)
    hidden = float(seen.vegetation.mean())
    if hidden > 0.05:
        warnings.append(f"Plants hide {100 * hidden:.0f} % of the facade; what is behind is taken from its neighbours.")
    profile_x, profile_z = (np.abs(v).mean(axis=a) for v, a in ((seen.horizontal, 0), (seen.vertical, 1)))
    return Facade(
        name,
        tuple(found),
        levels,
        scale,
        _arrangement(found, "x"),
        _arrangement(found, "z"),
        ring,
        picture,
        profile_x / max(float(profile_x.max()), 1e-9),
        profile_z / max(float(profile_z.max()), 1e-9),
        seen.vegetation,
        warnings,
    )


def _by_floors(picture: NDArray[np.uint8], aspect: float, floor_height: float | None) -> tuple[float, int]:
    """Width of the facade from the distance of its rows of windows, metres; and how many rows there are.

    The search for windows needs a scale, the scale needs the rows: a few guesses of the number of floors are tried, and
    that is taken whose rows stand a floor height apart.
    """
    wanted = floor_height or TYPICAL_STOREY_M
    best, found = math.inf, (wanted * 3 / aspect, 3)
    for count in range(1, 9):
        height = count * wanted + ROOF_M
        across = height / aspect
        if not 3.0 < across < 120.0:
            continue
        seen: Features = features(picture, picture.shape[1] / across)
        boxes = find_boxes(seen)
        rows = [r for r in groups(boxes, "y", seen.scale) if len(r) > 1]
        if not rows:
            continue
        middle = sorted(float(np.median([0.5 * (boxes[k].y0 + boxes[k].y1) for k in r])) / seen.scale for r in rows)
        step = np.diff(middle)
        step = step[step > 0.5 * wanted]
        pitch = float(np.median(step)) if len(step) else wanted
        cost = abs(math.log(pitch / wanted)) + 0.5 / math.sqrt(len(boxes)) + 0.3 * abs(len(step) + 1 - count)
        if cost < best:
            best, found = cost, (across * wanted / pitch, len(step) + 1)
    return found


def _to_metres(seen: Features, boxes: list[PixelBox], scale: Scale) -> list[FacadeBox]:
    s = seen.scale
    high = seen.distance.shape[0]
    out = []
    for box in boxes:
        z0, z1 = max((high - box.y1) / s, 0.0), (high - box.y0) / s
        kind = kind_of(z0, z1 - z0)
        rise = 0.0 if box.inferred else arch_rise(seen, box) / s
        out.append(FacadeBox(
            max(box.x0 / s, 0.0), 0.0 if kind == "door" else z0, min(box.x1 / s, scale.width), min(z1, scale.height), kind,
            rise, 0, box.inferred,
        ))  # fmt: skip
    return out


def _arrangement(boxes: list[FacadeBox], axis: str) -> Arrangement:
    """Connected: most elements are closer to the next one along the axis than a pier of a wall is wide."""
    other = "z" if axis == "x" else "x"
    gaps = []
    for a in boxes:
        ahead = [
            getattr(b, f"{axis}0") - getattr(a, f"{axis}1")
            for b in boxes
            if getattr(b, f"{axis}0") >= getattr(a, f"{axis}1") - 0.05
            and min(getattr(a, f"{other}1"), getattr(b, f"{other}1")) > max(getattr(a, f"{other}0"), getattr(b, f"{other}0"))
        ]
        if ahead:
            gaps.append(min(ahead))
    return "connected" if gaps and float(np.median(gaps)) < CONNECTED_M else "separated"
