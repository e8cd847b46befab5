"""One photo and its corners to a facade with windows and doors in metres."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from .arrangement import arrangement
from .boxes import find_boxes
from .classify import (
    STOREY_SIGMA,
    TYPICAL_STOREY_M,
    alike_shapes,
    arch_rise,
    floors,
    group_types,
    kind_of,
)
from .features import Features, features
from .floor_scale import scale_by_floors
from .pixel_box import PixelBox
from .records import Array, CornerSource, Facade, FacadeBox, Scale
from .rectify import CORNER_SIGMA_PX, aspect_ratio, check_inside, order_corners, rectify

GIVEN_FLOOR_SIGMA, GROUND_FLOOR_SIGMA = 0.02, 0.1
"""Of a given floor height; and of the distance between the two lowest rows of windows, as a share of the floor height."""
MAKE_PX, LEAST_PX = 120, 60
FOUND_CORNER_SIGMA = 0.03
"""Of corners found by lines, as a share of the facade's larger extent: one of ten is off by more, some by far more."""


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
    corner_source: CornerSource = "GIVEN",
) -> Facade:
    """The facade with these corners (4, 2) [px], given or found by lines, in an image (H, W, 3), RGB.

    Lengths in metres, ``focal`` in pixels. Raises BimVerifyError when the corners are no rectangle in perspective, or too
    small in the image.
    """
    ring = order_corners(corners)
    size = (image.shape[1], image.shape[0])
    if np.ptp(ring, axis=0).min() < LEAST_PX:
        raise BimVerifyError(f"{name}: the facade is smaller than {LEAST_PX} pixels in the image; take a closer photo.")
    check_inside(ring, size, name)
    corner_sigma = CORNER_SIGMA_PX if corner_source == "GIVEN" else FOUND_CORNER_SIGMA * float(np.ptp(ring, axis=0).max())
    aspect, aspect_sigma = aspect_ratio(ring, size, focal, seed, corner_sigma)
    if width and height:
        aspect = height / width
    picture = rectify(image, ring, aspect)
    warnings: list[str] = []
    across = width or (height / aspect if height else None)
    source: Literal["WIDTH", "HEIGHT", "BOTH", "FLOORHEIGHT"] = "BOTH" if width and height else "WIDTH" if width else "HEIGHT"
    relative = corner_sigma / float(np.ptp(ring[:, 1 if source == "HEIGHT" else 0]))
    if across is None:
        source = "FLOORHEIGHT"
        by_floors = scale_by_floors(picture, aspect, floor_height or TYPICAL_STOREY_M)
        across = by_floors.width
        share = GIVEN_FLOOR_SIGMA if floor_height else STOREY_SIGMA
        # a ground floor is often higher: of few rows it is much
        relative = math.hypot(share, GROUND_FLOOR_SIGMA / max(by_floors.rows - 1, 1), by_floors.sigma)
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
    found = alike_shapes(_to_metres(seen, boxes, scale))
    found = [replace(b, type=t) for b, t in zip(found, group_types(found), strict=True)]
    found.sort(key=lambda b: (round(b.z0, 2), b.x0))
    levels = floors([(b.z0, b.z1) for b in found], scale.height)
    hidden = float(seen.vegetation.mean())
    if hidden > 0.05:
        warnings.append(f"Plants hide {100 * hidden:.0f} % of the facade; what is behind is taken from its neighbours.")
    profile_x, profile_z = profiles(seen)
    return Facade(
        name,
        tuple(found),
        levels,
        scale,
        arrangement(found, "x"),
        arrangement(found, "z"),
        ring,
        picture,
        profile_x,
        profile_z,
        seen.vegetation,
        warnings,
        corner_source,
    )


def profiles(seen: Features) -> tuple[Array, Array]:
    """Gradients across and up, summed along the other direction, 0 to 1."""
    across, up = (np.abs(v).mean(axis=a) for v, a in ((seen.horizontal, 0), (seen.vertical, 1)))
    return across / max(float(across.max()), 1e-9), up / max(float(up.max()), 1e-9)


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
