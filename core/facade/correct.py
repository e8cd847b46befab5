"""A mock-up made anew after a person moved, added or took away openings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from .arrangement import arrangement
from .features import features
from .footprint import MapPlace
from .mockup import Mockup, mockup
from .read_facade import profiles
from .records import Facade, FacadeBox, Scale


def corrected(
    facades: Sequence[dict[str, Any]], boxes: Sequence[Sequence[FacadeBox]], footprint: NDArray[np.float64] | None,
    place: MapPlace | None = None,
) -> Mockup:
    """The mock-up of facades as ``facade_to_plain`` writes them, with other boxes. Types and storeys' openings are new.

    Raises BimVerifyError when nothing is left.
    """
    if not any(boxes):
        raise BimVerifyError("No window or door is left on any facade; keep at least one, or read the photos again.")
    made = [
        replace(_from_plain(f), boxes=tuple(b), arrangement_x=arrangement(b, "x"), arrangement_z=arrangement(b, "z"))
        for f, b in zip(facades, boxes, strict=True)
    ]
    return mockup(made, footprint, place)


def with_pictures(made: Mockup, pictures: Sequence[NDArray[np.uint8]]) -> Mockup:
    """The same with the rectified pictures (H, W, 3) of its facades, their profiles and plants, for the report."""
    facades = []
    for facade, picture in zip(made.facades, pictures, strict=True):
        seen = features(picture, picture.shape[1] / facade.scale.width)
        across, up = profiles(seen)
        facades.append(replace(facade, picture=picture, profile_x=across, profile_z=up, vegetation=seen.vegetation))
    return replace(made, facades=facades)


def _from_plain(data: dict[str, Any]) -> Facade:
    scale = Scale(data["width_m"], data["height_m"], data["scale_source"], data["scale_sigma"], data["aspect_sigma"])
    wide, high = (int(v) for v in data["picture_px"])
    picture = np.broadcast_to(np.zeros(1, dtype=np.uint8), (high, wide, 3))
    return Facade(
        str(data["image"]),
        (),
        tuple(float(v) for v in data["levels_m"]),
        scale,
        data["arrangement_x"],
        data["arrangement_z"],
        np.array(data["corners_px"], dtype=np.float64),
        picture,
        warnings=list(data["warnings"]),
        corner_source="LINES" if data.get("corner_source") == "LINES" else "GIVEN",
    )
