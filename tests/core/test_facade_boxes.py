"""Boxes on plain painted walls: glass that is most of the facade, strips, things in the street before windows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bim_verify.core.facade.boxes import find_boxes
from bim_verify.core.facade.features import features

SCALE = 50
Rectangle = tuple[float, float, float, float]


def wall(width: float, height: float, windows: list[Rectangle], before: list[Rectangle]) -> NDArray[np.uint8]:
    """A picture of a light wall; rectangles are x0, z0, x1, z1, metres."""
    rng = np.random.default_rng(5)
    out = np.full((round(height * SCALE), round(width * SCALE), 3), 190.0)
    for color, rectangles in ((60.0, windows), (100.0, before)):
        for x0, z0, x1, z1 in rectangles:
            rows = slice(round((height - z1) * SCALE), round((height - z0) * SCALE))
            out[rows, round(x0 * SCALE) : round(x1 * SCALE)] = color
    return np.clip(out + rng.normal(0.0, 3.0, out.shape), 0, 255).astype(np.uint8)


def found(picture: NDArray[np.uint8]) -> NDArray[np.float64]:
    """(N, 4) boxes in metres."""
    high = picture.shape[0]
    boxes = find_boxes(features(picture, float(SCALE)))
    return np.array([[b.x0, high - b.y1, b.x1, high - b.y0] for b in boxes]).reshape(-1, 4) / SCALE


def assert_same(boxes: NDArray[np.float64], windows: list[Rectangle]) -> None:
    """One box for each window, which it covers by intersection over union."""
    true = np.array(windows)
    assert len(boxes) == len(true)
    low, high = np.maximum(boxes[:, None, :2], true[None, :, :2]), np.minimum(boxes[:, None, 2:], true[None, :, 2:])
    both = np.prod(np.clip(high - low, 0, None), axis=2)
    area = [np.prod(b[:, 2:] - b[:, :2], axis=1) for b in (boxes, true)]
    assert (both / (area[0][:, None] + area[1][None] - both)).max(axis=0).min() > 0.8


def test_glass_may_be_most_of_the_facade() -> None:
    windows = [(0.4 + 2.0 * k, 0.9 + 3.0 * n, 2.2 + 2.0 * k, 3.0 + 3.0 * n) for k in range(5) for n in range(3)]
    assert_same(found(wall(10.6, 9.4, windows, [])), windows)


def test_strips_are_cut_where_the_wall_shows() -> None:
    windows = [(1.0 + 2.5 * k, 0.6 + 2.9 * n, 2.4 + 2.5 * k, 3.28 + 2.9 * n) for k in range(4) for n in range(3)]
    sills = [(x0 - 0.07, z0 - 0.12, x1 + 0.07, z0) for x0, z0, x1, _ in windows]
    assert_same(found(wall(10.9, 9.9, windows, sills)), windows)


def test_a_car_before_two_windows_is_no_opening() -> None:
    windows = [(1.0 + 2.2 * k, 0.9 + 3.0 * n, 2.2 + 2.2 * k, 2.4 + 3.0 * n) for k in range(5) for n in range(3)]
    car = [(3.0, 0.0, 6.8, 1.1), (3.6, 1.1, 6.0, 1.5)]
    assert_same(found(wall(12.0, 9.6, windows, car)), windows)


def test_a_door_and_the_window_over_it_keep_their_own_edges() -> None:
    windows = [(1.0 + 3.0 * k, 4.2, 2.3 + 3.0 * k, 6.3) for k in range(3)]
    windows += [(1.0, 1.0, 2.3, 3.0), (7.0, 1.0, 8.3, 3.0), (3.9, 0.0, 5.4, 2.8)]
    boxes = found(wall(9.5, 7.2, windows, []))
    assert_same(boxes, windows)
    over = boxes[np.abs(0.5 * (boxes[:, 0] + boxes[:, 2]) - 4.65) < 0.3]
    door, window = over[np.argsort(over[:, 1])]
    assert np.allclose(door[[0, 2]], (3.9, 5.4), atol=0.04)
    assert np.allclose(window[[0, 2]], (4.0, 5.3), atol=0.04)
