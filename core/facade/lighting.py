"""Light that changes slowly across a facade: the dark corners of a lens, a lamp or the sun from one side."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float32]
PER_METRE = 12.0
"""Pixels of the small picture in which the light is looked for."""
APART_M = 0.25
FLAT = 0.08
"""Log lightness changes less than this over ``APART_M`` where nothing but the light changes."""
DARKEST = 12.0
TURNS, TERMS = 12, 5
MOST = 0.7
"""Log lightness; no light changes more across a facade of one colour."""


def even_light(picture: NDArray[np.uint8], scale: float) -> Array:
    """The picture (H, W, 3), 0 to 255, as in a light that does not change along the facade. ``scale``: pixels a metre.

    Colours of walls and windows go in steps, light does not. So where the picture is flat, its differences along x are
    those of the light, whatever stands there: a smooth field is fitted to them. Along z the wall's colour is free anyway.
    """
    out = np.log(picture.astype(np.float32).mean(axis=2) + DARKEST)
    field = _field(out, scale)
    return np.asarray(picture.astype(np.float32) * np.exp(-field)[..., None], dtype=np.float32)


def _field(light: Array, scale: float) -> Array:
    """(H, W) log of the light over its mean in each row."""
    import cv2

    height, width = light.shape
    size = (max(round(width * PER_METRE / scale), 8), max(round(height * PER_METRE / scale), 8))
    small: Any = cv2.resize(light, size, interpolation=cv2.INTER_AREA)
    apart = max(round(APART_M * PER_METRE), 1)
    small = cv2.GaussianBlur(small, (0, 0), 0.8)
    change = (small[:, apart:] - small[:, :-apart]).ravel()
    x, z = (np.linspace(-1.0, 1.0, n) for n in size)
    design = (_terms(x[apart:], z) - _terms(x[:-apart], z)).reshape(-1, TERMS)
    # in turns without what is no change of light
    kept = np.abs(change) < FLAT
    if kept.sum() < 100:
        return np.zeros_like(light)
    found = np.zeros(TERMS)
    for _ in range(TURNS):
        off = change - design @ found
        width_of = max(2.5 * float(np.median(np.abs(off[kept]))), 0.004)
        weight = np.where(np.abs(off) < width_of, (1.0 - (off / width_of) ** 2) ** 2, 0.0)
        normal = (design * weight[:, None]).T @ design + 1e-3 * np.eye(TERMS)
        found = np.linalg.solve(normal, (design * weight[:, None]).T @ change)
    field = _terms(np.linspace(-1.0, 1.0, width), np.linspace(-1.0, 1.0, height)) @ found
    field -= field.mean(axis=1, keepdims=True)
    return np.asarray(np.clip(field, -MOST, MOST), dtype=np.float32)


def _terms(x: NDArray[np.float64], z: NDArray[np.float64]) -> NDArray[np.float64]:
    """(H, W, TERMS) of a field that is smooth along x and changes along z, both from -1 to 1."""
    across, up = np.broadcast_to(x, (len(z), len(x))), np.broadcast_to(z[:, None], (len(z), len(x)))
    return np.stack([across, across**2, across * up, across**2 * up, across**3], axis=-1)
