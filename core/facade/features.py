"""What a rectified facade shows pixel by pixel: straight edges along its axes, the wall's own colour, plants."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .lighting import even_light

Array = NDArray[np.float32]
LINE_M = 0.4
"""Edges are averaged along themselves over this length, which leaves windows and takes out bricks and leaves."""
FINE_M = 0.012
MARGIN_M = 0.3
"""At both ends of a facade there is wall."""
STRIP_M = 2.2
ENDS_SHARE = 1.0
"""How much the ends of the wall count, compared with all between them."""
BIN = 5.0
LEAST_DISTANCE = 7.0
"""CIE Lab units: a change that a person sees at once."""


@dataclass(frozen=True)
class Features:
    """All (H, W) unless said otherwise."""

    scale: float
    """Pixels per metre."""
    lab: Array
    """(H, W, 3) smoothed."""
    vertical: Array
    """Signed change of lightness across upright edges, averaged along them."""
    horizontal: Array
    distance: Array
    """From the colour of the wall at that height, CIE Lab units."""
    vegetation: NDArray[np.bool_]


def features(picture: NDArray[np.uint8], scale: float) -> Features:
    """Of a rectified picture with ``scale`` pixels per metre."""
    import cv2

    plants = vegetation(picture, scale)
    fine = max(FINE_M * scale, 0.6)
    smooth = cv2.GaussianBlur(even_light(picture, scale) / 255.0, (0, 0), fine)
    lab = np.asarray(cv2.cvtColor(smooth, cv2.COLOR_RGB2LAB), dtype=np.float32)
    gx, gy = (_change(lab, dx, dy) for dx, dy in ((1, 0), (0, 1)))
    gy = gy - np.median(gy, axis=1, keepdims=True)
    along = max(int(LINE_M * scale) | 1, 3)
    vertical, horizontal = _float(cv2.blur(gx, (1, along))), _float(cv2.blur(gy, (along, 1)))
    return Features(scale, lab, vertical, horizontal, wall_distance(lab, plants, scale), plants)


def _float(values: NDArray[Any]) -> Array:
    return np.asarray(values, dtype=np.float32)


def _change(lab: Array, dx: int, dy: int) -> Array:
    """Change of lightness along one axis."""
    import cv2

    return np.asarray(cv2.Scharr(np.ascontiguousarray(lab[..., 0]), cv2.CV_32F, dx, dy) / 32.0)


def wall_distance(lab: Array, plants: NDArray[np.bool_], scale: float) -> Array:
    """Distance of each pixel's colour from the wall's: the likeliest colours at that height, ends counted more."""
    import cv2

    height, width = lab.shape[:2]
    step = max(int(0.25 * scale), 2)
    half = max(int(STRIP_M / 2 * scale), 4)
    edge = max(int(MARGIN_M * scale), 2)
    small = _float(cv2.medianBlur(lab, 5))
    rows = np.arange(step // 2, height, step)
    found = np.empty((len(rows), 3, 3), dtype=np.float32)
    for k, row in enumerate(rows):
        low, high = max(row - half, 0), min(row + half + 1, height)
        strip, hidden = small[low:high:4, ::4], plants[low:high:4, ::4]
        weight = np.where(hidden, 0.0, 1.0)
        ends = max(edge // 4, 1)
        boost = ENDS_SHARE * strip.shape[1] / (2 * ends)
        weight[:, :ends] *= 1 + boost
        weight[:, -ends:] *= 1 + boost
        found[k, 0] = _mode(strip.reshape(-1, 3), weight.ravel())
        near = slice(max(row - half // 3, 0), min(row + half // 3 + 1, height))
        for side, part in ((1, small[near, :edge]), (2, small[near, width - edge :])):
            found[k, side] = np.median(part.reshape(-1, 3), axis=0)
    out = np.full((height, width), np.inf, dtype=np.float32)
    nearest = np.minimum(np.arange(height) // step, len(rows) - 1)
    # what stands at one end only (a pipe, a plant) is no wall unless the strip has much of it
    for c in range(3):
        color = found[nearest, c][:, None, :]
        trust = 0.0 if c == 0 else np.linalg.norm(found[nearest, c] - found[nearest, 0], axis=1)[:, None]
        far = lab - color
        far[..., 0] *= 0.8
        away = np.linalg.norm(far, axis=2)
        out = np.minimum(out, np.where(np.asarray(trust) < 14.0, away, np.inf))
    return np.asarray(out, dtype=np.float32)


def _mode(colors: Array, weight: NDArray[np.float64]) -> Array:
    """The commonest colour: the fullest cell of a smoothed histogram, then the mean around it."""
    from scipy.ndimage import gaussian_filter

    if weight.sum() <= 0:
        return np.asarray(np.median(colors, axis=0))
    cell = np.clip(np.round((colors - [0.0, -60.0, -60.0]) / BIN).astype(np.int64), 0, [20, 24, 24])
    flat = np.ravel_multi_index(tuple(cell.T), (21, 25, 25))
    counts = gaussian_filter(np.bincount(flat, weight, 21 * 25 * 25).reshape(21, 25, 25), 0.8)
    best = np.array(np.unravel_index(int(np.argmax(counts)), counts.shape)) * BIN + [0.0, -60.0, -60.0]
    for reach in (1.5 * BIN, 1.2 * BIN):
        near = (np.linalg.norm(colors - best, axis=1) < reach) & (weight > 0)
        if near.any():
            best = np.average(colors[near], axis=0, weights=weight[near])
    return np.asarray(best, dtype=np.float32)


def vegetation(picture: NDArray[np.uint8], scale: float) -> NDArray[np.bool_]:
    """(H, W) where leaves are: greener than red and blue, and ragged at the size of leaves."""
    import cv2

    rgb = picture.astype(np.float32)
    total = rgb.sum(axis=2) + 30.0
    green = cv2.blur((2 * rgb[..., 1] - rgb[..., 0] - rgb[..., 2]) / total, (3, 3))
    light = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY).astype(np.float32)
    reach = max(int(0.12 * scale) | 1, 3)
    spread = np.sqrt(np.maximum(cv2.blur(light * light, (reach, reach)) - cv2.blur(light, (reach, reach)) ** 2, 0))
    ragged = spread / (cv2.blur(light, (reach, reach)) + 10.0)
    seed = ((green > 0.09) & (ragged > 0.12)).astype(np.float32)
    wide = max(int(0.3 * scale) | 1, 3)
    return np.asarray(cv2.GaussianBlur(seed, (wide, wide), 0) > 0.35)
