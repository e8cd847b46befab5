"""Element boxes of a rectified facade: what is not wall, cut where the wall shows, set to the edges that bound it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .features import MARGIN_M, Features

LEAST_DISTANCE = 7.0
"""CIE Lab units: a change that a person sees at once."""
OUTLIER = 3.5
JOINED_M = 0.10
"""Bars of windows are narrower, piers between windows wider."""
THIN_M = 0.26
"""Poles, pipes, sills and string courses are thinner than any window."""
COURSE_M = 0.5
NARROWEST_M = 0.35
LEAST_AREA_M2 = 0.3
LEAST_FILL = 0.5
INWARD_M, OUTWARD_M = 0.24, 0.10
"""How far from what was found in colour the edge of the opening is looked for: surrounds and sills lie outside it."""
OUTER_SHARE = 0.3
"""The outermost edge that has this share of the strongest one: the wall's, not that of the reveal or the frame."""
IN_LINE_M = 0.12
SURROUND_M, EQUAL_M = (0.085, 0.26), 0.035
SILL_M, SILL_OUT_M, SILL_SHARE = 0.14, 0.07, 0.4
SAME_M = 0.2
LARGEST_GROWTH = 3.0
GOES_ON = 0.35
HIDDEN = 0.3
SEEN = 0.3


@dataclass(frozen=True)
class PixelBox:
    """Rows and columns of the rectified picture, end not included; fractions of pixels."""

    x0: float
    y0: float
    x1: float
    y1: float
    inferred: bool = False

    @property
    def width(self) -> float:
        return self.x1 - self.x0

    @property
    def height(self) -> float:
        return self.y1 - self.y0


def not_wall(seen: Features) -> NDArray[np.bool_]:
    """(H, W) where something else than wall is seen; plants are neither."""
    import cv2

    scale, d = seen.scale, seen.distance
    low = d[d < np.median(d) + 2 * LEAST_DISTANCE]
    limit = max(LEAST_DISTANCE, OUTLIER * float(np.median(low)))
    mask = (d > limit) & ~seen.vegetation
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
    count, label, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=4)
    out = []
    for k in range(1, count):
        x, y, w, h = (int(v) for v in stats[k, :4])
        patch = label[y : y + h, x : x + w] == k
        for box in _cut(patch, scale):
            part = patch[int(box.y0) : int(box.y1), int(box.x0) : int(box.x1)]
            if min(box.width, box.height) < NARROWEST_M * scale or box.width * box.height < LEAST_AREA_M2 * scale**2:
                continue
            if part.mean() >= LEAST_FILL:
                out.append(PixelBox(x + box.x0, y + box.y0, x + box.x1, y + box.y1))
    return out


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


def regular(seen: Features, boxes: list[PixelBox]) -> list[PixelBox]:
    """The pattern of rows and columns: a part of a window grows to the window, one behind a plant is put in."""
    scale = seen.scale
    out = [_grown(seen, box, boxes) for box in boxes]
    out = _without_overlap([_shrunk(seen, box, out) for box in out])
    rows, columns = groups(out, "y", scale), groups(out, "x", scale)
    mask = seen.distance > LEAST_DISTANCE
    lines = np.abs(seen.vertical) + np.abs(seen.horizontal)
    busy = float(np.median([_mean(lines, b) for b in out])) if out else 0.0
    added: list[PixelBox] = []
    for row in rows:
        if len(row) < 2:
            continue
        y0, y1 = (float(np.median([getattr(out[k], e) for k in row])) for e in ("y0", "y1"))
        for column in columns:
            if len(column) < 2 or set(row) & set(column):
                continue
            x0, x1 = (float(np.median([getattr(out[k], e) for k in column])) for e in ("x0", "x1"))
            wide = float(np.median([out[k].width for k in row]))
            guess = PixelBox(x0, y0, x1, y1, True)
            if abs(guess.width - wide) > 0.5 * wide or any(overlap(guess, b) > 0.05 for b in [*out, *added]):
                continue
            hidden, shown, edged = _mean(seen.vegetation, guess), _mean(mask, guess), _mean(lines, guess)
            if hidden > HIDDEN or (shown > SEEN and edged > 0.5 * busy):
                added.append(guess)
    return out + added


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


def overlap(a: PixelBox, b: PixelBox) -> float:
    """Of the smaller one's area."""
    w, h = min(a.x1, b.x1) - max(a.x0, b.x0), min(a.y1, b.y1) - max(a.y0, b.y0)
    return 0.0 if w <= 0 or h <= 0 else w * h / max(min(a.width * a.height, b.width * b.height), 1e-9)


def groups(boxes: list[PixelBox], axis: str, scale: float) -> list[list[int]]:
    """Rows (axis y) or columns (axis x): boxes whose two edges along that axis agree."""
    out: list[list[int]] = []
    for k, box in enumerate(boxes):
        for group in out:
            first = boxes[group[0]]
            if all(abs(getattr(box, f"{axis}{e}") - getattr(first, f"{axis}{e}")) < SAME_M * scale for e in (0, 1)):
                group.append(k)
                break
        else:
            out.append([k])
    return out


def _mean(values: NDArray[np.generic], box: PixelBox) -> float:
    part = values[max(round(box.y0), 0) : max(round(box.y1), 1), max(round(box.x0), 0) : max(round(box.x1), 1)]
    return float(part.mean()) if part.size else 0.0


def set_to_edges(seen: Features, boxes: list[PixelBox]) -> list[PixelBox]:
    """Each side to a straight edge near it, to a fraction of a pixel; those that nearly line up are found together.

    The wall's edge is the outermost of the strong ones: frames and reveals lie inside it. Where both sides have a second
    one at the same distance, wider than a frame, it is a surround, and the opening begins inside it.
    """
    own = [k for k, b in enumerate(boxes) if not b.inferred]
    out, scale = list(boxes), seen.scale
    found = {side: _lines_of(seen, boxes, own, side) for side in ("x0", "x1", "y0", "y1")}
    for row in groups([boxes[k] for k in own], "y", scale):
        members = [own[k] for k in row]
        widths = [w for k in members if (w := _surround(found["x0"][k], found["x1"][k], scale)) is not None]
        surround = float(np.median(widths)) if len(widths) > 0.5 * len(members) else 0.0
        sill = np.median([_reaches_out(seen, boxes[k], found, k) for k in members]) > SILL_SHARE
        for k in members:
            places: Any = {side: _behind(found[side][k], surround, scale) for side in found}
            if sill and len(found["y1"][k]) > 1 and found["y1"][k][0] - found["y1"][k][1] < SILL_M * scale:
                places["y1"] = found["y1"][k][1]
            foot = seen.distance.shape[0] - boxes[k].y1 < 0.15 * scale
            if foot:
                places["y1"] = float(seen.distance.shape[0])
            if places["x1"] - places["x0"] > 0.5 * boxes[k].width and places["y1"] - places["y0"] > 0.5 * boxes[k].height:
                out[k] = replace(boxes[k], **places)
    return out


def _reaches_out(seen: Features, box: PixelBox, found: dict[str, dict[int, list[float]]], k: int) -> float:
    """Strength of the lowest edge beside the box, as a share of that below it: a sill is wider than its window."""
    row, left, right = found["y1"][k][0], found["x0"][k][0], found["x1"][k][0]
    light, reach = seen.lab[..., 0], max(0.02 * seen.scale, 1.5)
    above, below = max(round(row - reach - 0.5), 0), min(round(row + reach - 0.5), len(light) - 1)
    change = np.abs(light[above] - light[below])
    if above >= below:
        return 0.0
    beside = [
        change[max(round(a), 0) : max(round(b), 0)]
        for a, b in ((left - SILL_OUT_M * seen.scale, left - 1.5), (right + 1.5, right + SILL_OUT_M * seen.scale))
    ]
    under = float(np.median(change[round(box.x0) : round(box.x1)]))
    sides = [float(np.median(part)) for part in beside if len(part)]
    return float(np.mean(sides)) / max(under, 1e-6) if sides else 0.0


def _lines_of(seen: Features, boxes: list[PixelBox], own: list[int], side: str) -> dict[int, list[float]]:
    """For each box the places of the strong edges near one of its sides, the outermost first; shared by those in line."""
    scale, along_x = seen.scale, side[0] == "x"
    outer = -1 if side[1] == "0" else 1
    order = sorted(own, key=lambda k: getattr(boxes[k], side))
    lined: list[list[int]] = []
    for k in order:
        if lined and getattr(boxes[k], side) - getattr(boxes[lined[-1][0]], side) < IN_LINE_M * scale:
            lined[-1].append(k)
        else:
            lined.append([k])
    out = {}
    for members in lined:
        near = float(np.median([getattr(boxes[k], side) for k in members]))
        size = min((boxes[k].width if along_x else boxes[k].height) for k in members)
        inward, outward = min(INWARD_M * scale, 0.3 * size), OUTWARD_M * scale
        low = near - (outward if outer < 0 else inward)
        high = near + (inward if outer < 0 else outward)
        total = None
        for k in members:
            profile = _profile(seen, boxes[k], along_x)
            part = profile[max(round(low), 0) : round(high) + 1]
            profile = profile / max(float(part.max(initial=0.0)), 1e-6)
            total = profile if total is None else total + profile
        assert total is not None
        lines = _peaks(total, low, high, outer) or [near]
        for k in members:
            out[k] = lines
    return out


def _profile(seen: Features, box: PixelBox, along_x: bool) -> NDArray[np.float32]:
    rows = slice(round(box.y0 + 0.2 * box.height), max(round(box.y1 - 0.2 * box.height), round(box.y0) + 1))
    columns = slice(round(box.x0 + 0.2 * box.width), max(round(box.x1 - 0.2 * box.width), round(box.x0) + 1))
    part = seen.vertical[rows].mean(axis=0) if along_x else seen.horizontal[:, columns].mean(axis=1)
    return np.abs(part)


def _peaks(profile: NDArray[np.float32], low: float, high: float, outer: int) -> list[float]:
    first, last = max(round(low), 1), min(round(high) + 1, len(profile) - 1)
    if last <= first:
        return []
    strong = OUTER_SHARE * float(profile[first:last].max())
    out = []
    for at in range(first, last):
        left, middle, right = (float(profile[k]) for k in (at - 1, at, at + 1))
        if middle >= strong and middle >= left and middle > right:
            bend = left - 2 * middle + right
            # pixel k covers k to k + 1
            out.append(at + 0.5 + (0.5 * (left - right) / bend if bend < 0 else 0.0))
    return out if outer < 0 else out[::-1]


def _surround(left: list[float], right: list[float], scale: float) -> float | None:
    """Width of the strip that both sides have, pixels; None without one."""
    for a in left[1:]:
        for b in right[1:]:
            x, y = a - left[0], right[0] - b
            if abs(x - y) < EQUAL_M * scale and SURROUND_M[0] * scale < 0.5 * (x + y) < SURROUND_M[1] * scale:
                return 0.5 * (x + y)
    return None


def _behind(lines: list[float], surround: float, scale: float) -> float:
    """The outermost line, or that at the inner edge of the surround, where there is one."""
    if not surround:
        return lines[0]
    wanted = [v for v in lines if abs(abs(v - lines[0]) - surround) < 2 * EQUAL_M * scale]
    return wanted[0] if wanted else lines[0]


def agreed(seen: Features, boxes: list[PixelBox]) -> list[PixelBox]:
    """Edges that nearly agree along a row or a column are one edge: their median."""
    out = list(boxes)
    for edge in ("x0", "x1", "y0", "y1"):
        values = np.array([getattr(b, edge) for b in out])
        order = np.argsort(values, kind="stable")
        start = 0
        for stop in range(1, len(order) + 1):
            if stop == len(order) or values[order[stop]] - values[order[stop - 1]] > 0.06 * seen.scale:
                members = order[start:stop]
                middle = float(np.median(values[members]))
                for k in members:
                    if abs(values[k] - middle) < 0.12 * seen.scale:
                        out[k] = replace(out[k], **{edge: middle})
                start = stop
    return out
