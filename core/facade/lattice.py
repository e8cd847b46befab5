"""The pattern of rows and columns: what it says about each box, and where a box is missing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .edges import OUTWARD_M
from .features import Features
from .pixel_box import SAME_M, PixelBox, groups, mean_in, overlap

LARGEST_GROWTH = 3.0
GOES_ON = 0.35
HIDDEN = 0.3
ENOUGH, MOST_SIDES = 0.4, 3
"""An edge that has this share of the others' strength is one; a place of the pattern with so many of them is an opening."""
LARGER = 1.2
FOOT_M, LEAST_DOOR_M = 0.25, 1.75


def regular(seen: Features, boxes: list[PixelBox]) -> list[PixelBox]:
    """The pattern of rows and columns: a part of a window grows to the window, one behind a plant is put in.

    Where a box that fits no row and no column lies over places of the pattern whose sides are seen, it is several things
    in one (windows with a car or a shadow), and they take its place.
    """
    out = [_grown(seen, box, boxes) for box in boxes]
    out = _without_overlap([_shrunk(seen, box, out) for box in out])
    rows, columns = groups(out, "y", seen.scale), groups(out, "x", seen.scale)
    alone = {row[0] for row in rows if len(row) < 2} & {column[0] for column in columns if len(column) < 2}
    typical = _typical(seen, [b for k, b in enumerate(out) if k not in alone])
    added: list[PixelBox] = []
    replaced: set[int] = set()
    for guess, sure in _places(seen, out, rows, columns):
        share = _sides(seen, guess, typical) if typical is not None else 0
        hidden = mean_in(seen.vegetation, guess)
        met = [k for k, b in enumerate(out) if overlap(guess, b) > 0.05]
        if any(overlap(guess, b) > 0.05 for b in added) or any(k not in alone for k in met):
            continue
        if met and any(out[k].width * out[k].height < LARGER * guess.width * guess.height for k in met):
            continue
        if share >= MOST_SIDES:
            added.append(replace(guess, inferred=hidden > HIDDEN))
            replaced.update(met)
        elif not met and sure and hidden > HIDDEN:
            added.append(guess)
    kept = [b for k, b in enumerate(out) if k not in replaced and not (k in alone and _in_street(seen, b))]
    return kept + added


def _places(
    seen: Features, boxes: list[PixelBox], rows: list[list[int]], columns: list[list[int]]
) -> list[tuple[PixelBox, bool]]:
    """Where rows and columns cross and no box is, the best supported first."""
    out = []
    for row in rows:
        y0, y1 = (float(np.median([getattr(boxes[k], e) for k in row])) for e in ("y0", "y1"))
        wide = float(np.median([boxes[k].width for k in row]))
        for column in columns:
            if set(row) & set(column) or max(len(row), len(column)) < 2:
                continue
            x0, x1 = (float(np.median([getattr(boxes[k], e) for k in column])) for e in ("x0", "x1"))
            if abs(x1 - x0 - wide) <= 0.5 * wide:
                sure = min(len(row), len(column)) > 1
                out.append((len(row) * len(column), PixelBox(x0, y0, x1, y1, True), sure))
    return [(guess, sure) for _, guess, sure in sorted(out, key=lambda p: (-p[0], p[1].y0, p[1].x0))]


def _in_street(seen: Features, box: PixelBox) -> bool:
    """Stands on the ground and is too low for a door: a car, a bush, a shadow."""
    foot = seen.distance.shape[0] - box.y1
    return foot < FOOT_M * seen.scale and box.height < LEAST_DOOR_M * seen.scale


def _strengths(seen: Features, box: PixelBox) -> NDArray[np.float64]:
    """(4,) of the strongest straight edge near each side: left, right, top, bottom; NaN where plants hide it."""
    reach = max(OUTWARD_M * seen.scale, 2.0)
    out = np.empty(4)
    for k, (side, axis) in enumerate((("x0", 1), ("x1", 1), ("y0", 0), ("y1", 0))):
        at = getattr(box, side)
        across = slice(max(round(at - reach), 0), round(at + reach) + 1)
        low, high = (box.y0, box.y1) if axis else (box.x0, box.x1)
        along = slice(max(round(low + 0.15 * (high - low)), 0), max(round(high - 0.15 * (high - low)), 1))
        edges = seen.vertical[along, across] if axis else seen.horizontal[across, along].T
        hidden = seen.vegetation[along, across] if axis else seen.vegetation[across, along].T
        shown = ~hidden.any(axis=1) if hidden.size else np.zeros(0, dtype=np.bool_)
        out[k] = np.abs(edges[shown].mean(axis=0)).max() if shown.sum() > 0.3 * len(shown) > 0 else np.nan
    return out


def _typical(seen: Features, boxes: list[PixelBox]) -> NDArray[np.float64] | None:
    """(4,) medians of the strengths of the sides of boxes that are sure."""
    if not boxes:
        return None
    found = np.array([_strengths(seen, b) for b in boxes])
    return None if np.isnan(found).all(axis=0).any() else np.nanmedian(found, axis=0)


def _sides(seen: Features, box: PixelBox, typical: NDArray[np.float64]) -> int:
    """How many sides of the box are edges about as strong as those of the others."""
    own = _strengths(seen, box)
    return int(np.sum(np.nan_to_num(own) > ENOUGH * typical))


def _grown(seen: Features, box: PixelBox, boxes: list[PixelBox]) -> PixelBox:
    """With the edges of those beside or above it, where some that agree go on: part of a window looks like the wall."""
    scale = seen.scale
    for low, high, other_low, other_high in (("y0", "y1", "x0", "x1"), ("x0", "x1", "y0", "y1")):
        a, b = getattr(box, low), getattr(box, high)
        mates = [
            m
            for m in boxes
            if m is not box
            and min(b, getattr(m, high)) - max(a, getattr(m, low)) > 0.8 * (b - a)
            and min(getattr(box, other_high), getattr(m, other_high)) <= max(getattr(box, other_low), getattr(m, other_low))
        ]
        spans = [(getattr(m, low), getattr(m, high)) for m in mates]
        whole = [
            (c, d)
            for c, d in spans
            if c < a + SAME_M * scale
            and d > b - SAME_M * scale
            and d - c < LARGEST_GROWTH * (b - a)
            and sum(abs(c - e) < SAME_M * scale and abs(d - f) < SAME_M * scale for e, f in spans) >= max(2, 0.25 * len(spans))
        ]
        if not whole:
            continue
        for start, end in sorted(whole, key=lambda s: s[0] - s[1]):
            if a - start < SAME_M * scale and end - b < SAME_M * scale:
                break
            if _goes_on(seen, box, low == "y0", start, a) and _goes_on(seen, box, low == "y0", b, end):
                box = replace(box, **{low: start, high: end})
                break
    return box


def _shrunk(seen: Features, box: PixelBox, boxes: list[PixelBox]) -> PixelBox:
    """Cut at the foot of its neighbours where it has their edge too: a shadow on the wall goes on below a window."""
    near = SAME_M * seen.scale
    mates = [m for m in boxes if m is not box and abs(m.y0 - box.y0) < near and abs(m.width - box.width) < 2 * near]
    feet = np.array([m.y1 for m in mates])
    if len(mates) < 2:
        return box
    foot = float(np.median(feet))
    if np.mean(np.abs(feet - foot) < near) < 0.5 or box.y1 - foot < near:
        return box
    own, others = _edge_at(seen, box, foot), np.median([_edge_at(seen, m, foot) for m in mates])
    return replace(box, y1=foot) if own > 0.5 * others else box


def _edge_at(seen: Features, box: PixelBox, row: float) -> float:
    reach = OUTWARD_M * seen.scale
    inner = slice(round(box.x0 + 0.2 * box.width), round(box.x1 - 0.2 * box.width) + 1)
    part = seen.horizontal[max(round(row - reach), 0) : round(row + reach) + 1, inner]
    return float(np.abs(part.mean(axis=1)).max(initial=0.0))


def _goes_on(seen: Features, box: PixelBox, upward: bool, first: float, last: float) -> bool:
    """Both sides of the box go on as edges between two places outside it; True where there is nothing between."""
    if last - first < SAME_M * seen.scale:
        return True
    edges = seen.vertical if upward else seen.horizontal.T
    sides, inside = ((box.x0, box.x1), (box.y0, box.y1)) if upward else ((box.y0, box.y1), (box.x0, box.x1))
    reach = OUTWARD_M * seen.scale
    more = np.abs(edges[max(round(first), 0) : round(last)].mean(axis=0))
    own = np.abs(edges[max(round(inside[0]), 0) : round(inside[1])].mean(axis=0))
    for side in sides:
        near = slice(max(round(side - reach), 0), round(side + 2 * reach) + 1)
        if more[near].max(initial=0.0) < GOES_ON * own[near].max(initial=0.0):
            return False
    return True


def _without_overlap(boxes: list[PixelBox]) -> list[PixelBox]:
    kept: list[PixelBox] = []
    for box in sorted(boxes, key=lambda b: -b.width * b.height):
        if all(overlap(box, other) < 0.3 for other in kept):
            kept.append(box)
    return kept
