"""What the boxes are: window or door, rectangular or arched, groups that are alike; and the floors they stand on."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from .features import Features
from .pixel_box import PixelBox
from .records import FacadeBox, Kind

SILL_M = 0.22
"""Under a door there is a step at most, under a window a wall."""
LEAST_DOOR_M = 1.75
ALIKE_M, SAME_TYPE_M = 0.12, 0.16
ARCHED = 0.45
ROW_OVERLAP = 0.5
LOWEST_STOREY_M = 2.2
USUAL_SILL_M, BELOW_SILL = 0.85, 0.6
"""Height of sills above their floor, and the most they are of the wall between two rows: the rest is lintel and slab."""
TYPICAL_STOREY_M, STOREY_SIGMA = 3.2, 0.12
"""Floor to floor height of buildings of several storeys, and its relative standard deviation."""


def kind_of(z0: float, height: float) -> Kind:
    """A door reaches the ground and lets a person through."""
    return "door" if z0 < SILL_M and height > LEAST_DOOR_M else "window"


def arch_rise(seen: Features, box: PixelBox) -> float:
    """Rise of the arch above its springing line, pixels; 0 for a rectangle.

    The two corners above a half circle, or above a flat arc, show the wall where the opening is arched.
    """
    y0, x0 = max(round(box.y0), 0), max(round(box.x0), 0)
    part = seen.distance[y0 : round(box.y1), x0 : round(box.x1)]
    if part.shape[0] < 6 or part.shape[1] < 6:
        return 0.0
    w = part.shape[1]
    level = max(float(np.median(part)), 7.0)
    dark = part > 0.5 * level
    y, x = np.mgrid[: part.shape[0], :w] + 0.5
    best, found = ARCHED, 0.0
    for share in (0.5, 0.35, 0.2):
        rise = share * w
        radius = (w * w / 4 + rise * rise) / (2 * rise)
        outside = (np.hypot(x - w / 2, y - radius) > radius + 1.5) & (y < rise)
        inside = (np.hypot(x - w / 2, y - radius) < radius - 1.5) & (y < rise)
        if outside.sum() < 8 or not inside.any():
            continue
        contrast = float(dark[inside].mean() - dark[outside].mean())
        if contrast > best:
            best, found = contrast, rise
    return found


def alike_shapes(boxes: list[FacadeBox], tolerance: float = ALIKE_M) -> list[FacadeBox]:
    """The shape of most of those of one kind and size in a row: a blind or a shadow hides the corners of a few only."""
    out = []
    for box in boxes:
        mates = [
            b.rise
            for b in boxes
            if b.kind == box.kind
            and not b.inferred
            and all(abs(getattr(b, e) - getattr(box, e)) < tolerance for e in ("z0", "z1", "width"))
        ]
        arched = [r for r in mates if r > 0]
        if len(mates) > 1 and 2 * len(arched) != len(mates):
            box = replace(box, rise=float(np.median(arched)) if 2 * len(arched) > len(mates) else 0.0)
        out.append(box)
    return out


def floors(boxes: list[tuple[float, float]], height: float) -> tuple[float, ...]:
    """Heights of the floors from the (z0, z1) of the windows: one floor a row, evenly spaced above the second.

    A floor lies below the sills of its row by what sills usually have, or by most of the space that the rows leave where that
    is less.
    """
    if not boxes:
        return (0.0,)
    spans = sorted(boxes, key=lambda s: 0.5 * (s[0] + s[1]))
    rows: list[list[tuple[float, float]]] = []
    for span in spans:
        if rows:
            low, high = (float(np.median([s[k] for s in rows[-1]])) for k in (0, 1))
            shared = min(high, span[1]) - max(low, span[0])
            if shared > ROW_OVERLAP * min(high - low, span[1] - span[0]):
                rows[-1].append(span)
                continue
        rows.append([span])
    middles = [float(np.median([0.5 * (a + b) for a, b in row])) for row in rows]
    kept = [rows[0]]
    for row, (before, middle) in zip(rows[1:], itertools.pairwise(middles), strict=True):
        if middle - before < 0.5 * LOWEST_STOREY_M:
            kept[-1] = kept[-1] + row
        else:
            kept.append(row)
    levels = [0.0]
    for below, above in itertools.pairwise(kept):
        top, foot = float(np.median([s[1] for s in below])), float(np.median([s[0] for s in above]))
        gap = max(foot - top, 0.0)
        levels.append(max(foot - min(USUAL_SILL_M, BELOW_SILL * gap), levels[-1] + 0.1))
    return tuple(v for v in levels if v < height)


def group_types(boxes: list[FacadeBox], tolerance: float = SAME_TYPE_M) -> list[int]:
    """Numbers of groups: same kind, same shape, sizes that agree (average linkage)."""
    numbers = [-1] * len(boxes)
    first = 0
    keys = sorted({(b.kind, b.rise > 0) for b in boxes}, reverse=True)
    for key in keys:
        rows = [k for k, b in enumerate(boxes) if (b.kind, b.rise > 0) == key]
        if len(rows) > 1:
            from scipy.cluster.hierarchy import fcluster, linkage

            size = np.array([[boxes[k].width, boxes[k].height] for k in rows])
            label = fcluster(linkage(size, "average", metric="chebyshev"), tolerance, "distance")
        else:
            label = np.ones(1, dtype=np.int64)
        for k, value in zip(rows, label, strict=True):
            numbers[k] = first + int(value) - 1
        first += int(label.max())
    order: dict[int, int] = {}
    for value in numbers:
        order.setdefault(value, len(order))
    return [order[v] for v in numbers]
