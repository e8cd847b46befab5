"""Sides of boxes set to the edges that bound an opening: outside frames and reveals, inside surrounds and sills."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .features import Features
from .pixel_box import PixelBox, groups

INWARD_M, OUTWARD_M = 0.24, 0.10
"""How far from what was found in colour the edge of the opening is looked for: surrounds and sills lie outside it."""
OUTER_SHARE = 0.3
"""The outermost edge that has this share of the strongest one: the wall's, not that of the reveal or the frame."""
FAINT_SHARE = 0.12
"""The other edge of a surround, where one of the two is strong."""
IN_LINE_M = 0.12
OWN_SHARE = 0.1
"""An edge that several have in line is one's own if it has this share of one's strongest."""
SURROUND_M, EQUAL_M = (0.085, 0.26), 0.035
OUTLINE_M = 0.07
"""Where the outline in colour has no straight edge within this, the edge is weak."""
SILL_M, SILL_OUT_M, SILL_SHARE = 0.2, 0.07, 0.4


def set_to_edges(seen: Features, boxes: list[PixelBox]) -> list[PixelBox]:
    """Each side to a straight edge near it, to a fraction of a pixel; those that nearly line up are found together.

    The wall's edge is the outermost of the strong ones: frames and reveals lie inside it. Where both sides have a second
    one at the same distance, wider than a frame, it is a surround, and the opening begins inside it.
    """
    own = [k for k, b in enumerate(boxes) if not b.inferred]
    out, scale = list(boxes), seen.scale
    found = {side: _lines_of(seen, boxes, own, side, OUTER_SHARE) for side in ("x0", "x1", "y0", "y1")}
    faint = {side: _lines_of(seen, boxes, own, side, FAINT_SHARE) for side in ("x0", "x1")}
    for row in groups([boxes[k] for k in own], "y", scale):
        members = [own[k] for k in row]
        seen_at = {
            side: {k: _with_outline(found[side][k], getattr(boxes[k], side), side, scale) for k in members}
            for side in ("x0", "x1", "y0")
        }
        widths = []
        for k in members:
            strong = seen_at["x0"][k], seen_at["x1"][k]
            width = _surround(strong[0], faint["x1"][k], scale) or _surround(faint["x0"][k], strong[1], scale)
            widths += [width] if width else []
        surround = float(np.median(widths)) if len(widths) > 0.5 * len(members) else 0.0
        sill = _sill(seen, boxes, found, members)
        for k in members:
            places: Any = {side: found[side][k][0] for side in found}
            if surround:
                places |= {side: _behind(lines[k], surround, scale) for side, lines in seen_at.items()}
                for side, lines in faint.items():
                    if places[side] in (found[side][k][0], seen_at[side][k][0]):
                        places[side] = _behind(lines[k], surround, scale)
                places["y1"] = _behind(found["y1"][k], surround, scale)
            if sill is not None and places["y1"] == found["y1"][k][0]:
                places["y1"] = sill
            foot = seen.distance.shape[0] - boxes[k].y1 < 0.15 * scale
            if foot:
                places["y1"] = float(seen.distance.shape[0])
            if places["x1"] - places["x0"] > 0.5 * boxes[k].width and places["y1"] - places["y0"] > 0.5 * boxes[k].height:
                out[k] = replace(boxes[k], **places)
    return out


def _sill(seen: Features, boxes: list[PixelBox], found: dict[str, dict[int, list[float]]], members: list[int]) -> float | None:
    """Upper edge of the sill of a row of windows: the innermost edge near their foot that reaches out; None without one."""
    lines = max((found["y1"][k] for k in members), key=len)
    near = [v for v in lines if lines[0] - v < SILL_M * seen.scale]
    if len(near) < 2 or np.median([_reaches_out(seen, boxes[k], found, k, near[0]) for k in members]) <= SILL_SHARE:
        return None
    inner = [v for v in near[1:] if np.median([_reaches_out(seen, boxes[k], found, k, v) for k in members]) > SILL_SHARE]
    return inner[-1] if inner else near[1]


def _reaches_out(seen: Features, box: PixelBox, found: dict[str, dict[int, list[float]]], k: int, row: float) -> float:
    """Strength of an edge beside the box, as a share of that below it: a sill is wider than its window."""
    left, right = found["x0"][k][0], found["x1"][k][0]
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


def _lines_of(seen: Features, boxes: list[PixelBox], own: list[int], side: str, share: float) -> dict[int, list[float]]:
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
        # never past the middle of what parts it from the next one
        outward = min([outward, *(0.5 * _gap(boxes, k, side) for k in members)])
        low = near - (outward if outer < 0 else inward)
        high = near + (inward if outer < 0 else outward)
        profiles = {}
        for k in members:
            profile = _profile(seen, boxes[k], along_x)
            part = profile[max(round(low), 0) : round(high) + 1]
            profiles[k] = profile / max(float(part.max(initial=0.0)), 1e-6)
        lines = _peaks(np.sum(list(profiles.values()), axis=0), low, high, outer, share) or [near]
        for k in members:
            # a door's edge is not that of the window over it
            out[k] = [v for v in lines if _at(profiles[k], v) > OWN_SHARE] or lines
    return out


def _at(profile: NDArray[np.float32], place: float) -> float:
    """The strongest of the pixels next to a place."""
    return float(profile[max(int(place) - 1, 0) : int(place) + 2].max(initial=0.0))


def _gap(boxes: list[PixelBox], k: int, side: str) -> float:
    """Pixels from one side of a box to the next box there; infinite without one."""
    axis, outer = side[0], -1 if side[1] == "0" else 1
    other, back = "y" if axis == "x" else "x", f"{axis}{'1' if outer < 0 else '0'}"
    own = boxes[k]
    away = [
        outer * (getattr(b, back) - getattr(own, side))
        for b in boxes
        if b is not own
        and min(getattr(b, f"{other}1"), getattr(own, f"{other}1")) > max(getattr(b, f"{other}0"), getattr(own, f"{other}0"))
        and outer * (getattr(b, f"{axis}0") + getattr(b, f"{axis}1") - getattr(own, f"{axis}0") - getattr(own, f"{axis}1")) > 0
    ]
    return max(min(away, default=np.inf), 0.0)


def _profile(seen: Features, box: PixelBox, along_x: bool) -> NDArray[np.float32]:
    rows = slice(round(box.y0 + 0.2 * box.height), max(round(box.y1 - 0.2 * box.height), round(box.y0) + 1))
    columns = slice(round(box.x0 + 0.2 * box.width), max(round(box.x1 - 0.2 * box.width), round(box.x0) + 1))
    part = seen.vertical[rows].mean(axis=0) if along_x else seen.horizontal[:, columns].mean(axis=1)
    return np.abs(part)


def _peaks(profile: NDArray[np.float32], low: float, high: float, outer: int, share: float) -> list[float]:
    first, last = max(round(low), 1), min(round(high) + 1, len(profile) - 1)
    if last <= first:
        return []
    strong = share * float(profile[first:last].max())
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


def _with_outline(lines: list[float], outline: float, side: str, scale: float) -> list[float]:
    """The lines, and before them the outline in colour where no straight edge is at it: stone as light as the wall."""
    inward = (lines[0] - outline) * (1 if side[1] == "0" else -1)
    return [outline, *lines] if inward > OUTLINE_M * scale else lines


def _behind(lines: list[float], surround: float, scale: float) -> float:
    """The inner one of two lines that are the surround's width apart, or the outermost."""
    pairs = [(abs(abs(b - a) - surround), b) for k, a in enumerate(lines) for b in lines[k + 1 :]]
    fit, inner = min(pairs, default=(np.inf, 0.0))
    return inner if fit < EQUAL_M * scale else lines[0]


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
