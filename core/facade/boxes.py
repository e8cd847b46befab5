"""Element boxes of a rectified facade: what is not wall, cut where the wall shows, set to the edges that bound it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .edges import agreed, set_to_edges
from .features import LEAST_DISTANCE, MARGIN_M, Features
from .lattice import regular
from .pixel_box import PixelBox

OUTLIER = 4.9
"""Times the lower quartile: 5.4 times the standard deviation along each of the three axes of colour."""
JOINED_M = 0.10
"""Bars of windows are narrower, piers between windows wider."""
THIN_M = 0.26
"""Poles, pipes, sills and string courses are thinner than any window."""
COURSE_M = 0.5
NARROWEST_M = 0.35
LEAST_AREA_M2 = 0.3
LEAST_FILL = 0.5
DIVIDER_M, ACROSS, LEAST_PIECE_M = 0.04, 0.6, 1.0
"""What is seen of the wall between two windows of a strip, over a sill; cross bars leave less than this above them."""


def not_wall(seen: Features) -> NDArray[np.bool_]:
    """(H, W) where something else than wall is seen; plants are neither."""
    import cv2

    scale = seen.scale
    mask = (seen.distance > wall_limit(seen)) & ~seen.vegetation
    mask &= ~courses(mask, scale)[:, None]

    def block(x: float, y: float) -> NDArray[np.uint8]:
        return np.ones((max(round(y * scale), 1), max(round(x * scale), 1)), dtype=np.uint8)

    out: Any = mask.astype(np.uint8)
    out = cv2.morphologyEx(out, cv2.MORPH_CLOSE, block(JOINED_M, 0.0))
    out = cv2.morphologyEx(out, cv2.MORPH_CLOSE, block(0.0, JOINED_M))
    outline, _ = cv2.findContours(out, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    small: Any = [c for c in outline if cv2.boundingRect(c)[2] < 0.5 * mask.shape[1]]
    cv2.drawContours(out, small, -1, (1.0,), cv2.FILLED)
    out = cv2.morphologyEx(out, cv2.MORPH_OPEN, block(THIN_M, 0.0))
    out = cv2.morphologyEx(out, cv2.MORPH_OPEN, block(0.0, THIN_M))
    return np.asarray(out, dtype=np.bool_)


def wall_limit(seen: Features) -> float:
    """The largest distance in colour that is still wall, CIE Lab units: from the spread where wall is for sure, at the ends."""
    d, edge = seen.distance, max(int(MARGIN_M * seen.scale), 2)
    ends = np.concatenate([d[:, :edge].ravel(), d[:, -edge:].ravel()])
    # glass may be more than half of the facade, and things in the street hide its ends
    return max(LEAST_DISTANCE, OUTLIER * float(min(np.quantile(ends, 0.25), np.quantile(d, 0.25))))


def courses(mask: NDArray[np.bool_], scale: float) -> NDArray[np.bool_]:
    """(H,) rows of string courses and cornices: they reach over both ends of the wall, and are low."""
    edge = max(int(MARGIN_M * scale), 2)
    ends = np.minimum(mask[:, :edge].mean(axis=1), mask[:, -edge:].mean(axis=1))
    full = (ends > 0.6) & (mask.mean(axis=1) > 0.6)
    out = np.zeros(len(mask), dtype=np.bool_)
    change = np.flatnonzero(np.diff(np.concatenate([[False], full, [False]]).astype(np.int8)))
    for first, last in change.reshape(-1, 2):
        if last - first < COURSE_M * scale or first < COURSE_M * scale:
            out[max(first - 2, 0) : last + 2] = True
    return out


def find_boxes(seen: Features) -> list[PixelBox]:
    """All openings of a facade, in no order."""
    boxes = set_to_edges(seen, regular(seen, coarse_boxes(seen)))
    return agreed(seen, boxes)


def coarse_boxes(seen: Features) -> list[PixelBox]:
    """One for each patch that is no wall and about a rectangle."""
    import cv2

    scale, mask = seen.scale, not_wall(seen)
    wall = (seen.distance <= wall_limit(seen)) & ~seen.vegetation
    count, label, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=4)
    out = []
    for k in range(1, count):
        x, y, w, h = (int(v) for v in stats[k, :4])
        patch = label[y : y + h, x : x + w] == k
        for box in _cut(patch, scale):
            whole = PixelBox(x + box.x0, y + box.y0, x + box.x1, y + box.y1)
            for piece in _divided(wall, whole, scale):
                part = patch[int(piece.y0) - y : int(piece.y1) - y, int(piece.x0) - x : int(piece.x1) - x]
                if min(piece.width, piece.height) < NARROWEST_M * scale:
                    continue
                if piece.width * piece.height >= LEAST_AREA_M2 * scale**2 and part.mean() >= LEAST_FILL:
                    out.append(piece)
    return out


def _divided(wall: NDArray[np.bool_], box: PixelBox, scale: float) -> list[PixelBox]:
    """Cut where wall shows over the whole width, with a window's height left on both sides: strips of windows."""
    inner = slice(round(box.x0 + 0.2 * box.width), max(round(box.x1 - 0.2 * box.width), round(box.x0) + 1))
    first, last = round(box.y0), round(box.y1)
    band = np.concatenate([[False], wall[first:last, inner].mean(axis=1) > ACROSS, [False]])
    out, top = [], first
    for a, b in np.flatnonzero(np.diff(band.astype(np.int8))).reshape(-1, 2):
        if b - a < max(DIVIDER_M * scale, 2) or first + a - top < LEAST_PIECE_M * scale:
            continue
        if last - first - b < LEAST_PIECE_M * scale:
            break
        out.append(PixelBox(box.x0, top, box.x1, first + int(a)))
        top = first + int(b)
    return [*out, PixelBox(box.x0, top, box.x1, last)]


def _cut(patch: NDArray[np.bool_], scale: float) -> list[PixelBox]:
    """The extent of a patch where at least half of it is; a patch of several windows is cut at its narrow places."""
    out = []
    rows = patch.sum(axis=1)
    for top, bottom in _spans(rows, 0.4, scale):
        part = patch[top:bottom]
        columns = part.sum(axis=0)
        for left, right in _spans(columns, 0.4, scale):
            inner = _spans(part[:, left:right].sum(axis=1), 0.4, scale)
            for a, b in inner:
                out.append(PixelBox(left, top + a, right, top + b))
    return out


def _spans(profile: NDArray[np.int64], share: float, scale: float) -> list[tuple[int, int]]:
    if not profile.any():
        return []
    high = profile > share * np.quantile(profile[profile > 0], 0.8)
    change = np.flatnonzero(np.diff(np.concatenate([[False], high, [False]]).astype(np.int8))).reshape(-1, 2)
    merged: list[list[int]] = []
    for first, last in change:
        if merged and first - merged[-1][1] < JOINED_M * scale:
            merged[-1][1] = int(last)
        else:
            merged.append([int(first), int(last)])
    return [(a, b) for a, b in merged if b - a >= THIN_M * scale]
