"""What stands in an opening, and how deep its reveal goes on. A box is u0, u1, z0, z1 on the face [m]."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .crossings import Crossings

Box = tuple[float, float, float, float]
Span = tuple[float, float]

RIM_M = (0.02, 0.055)
"""A frame lies this far inside the edge of its opening; the reveal itself does not."""
FILLED_SHARE = 0.4
RIM_BIN_M = 0.04
LEAST_BACK = 20
DEEPEST_BACK_M = 0.6
"""What ends the rays behind a hole farther off is no part of its wall."""
BACK_SHARE = 0.9
"""Of the rays into a recess, this many end on its back."""
FRAME_BEFORE_M = 0.012
FRAMED_SHARE = 0.3
"""Of what lies along the rim of an opening, so much stands before its leaf or pane where there is a frame."""
LEAST_REVEAL_RETURNS = 30
REVEAL_BIN_M = 0.01
FRAME_STEP_M = 0.02
"""A frame's face lies this close to the end of a reveal that it hides the rest of."""
DENSE_BINS = 2
"""Where returns follow each other this closely at the end of a reveal, its end is the last of them."""
LEAST_COLUMN = 3
STEPS = 2
BEYOND_M = 0.05
"""A ray that ends this far behind the place where it left the hole was not stopped by the wall there."""
"""Steps between columns of returns from which the spacing at a reveal's end is taken."""


def is_filled(sides: list[Crossings], box: Box, thickness: float, band: float) -> bool:
    """Whether something stands in the hole: along its rim (a frame), or over most of it (a leaf or pane)."""
    u0, u1, z0, z1 = box
    height, width = max(int((z1 - z0) / RIM_BIN_M), 1), max(int((u1 - u0) / RIM_BIN_M), 1)
    rim = np.zeros(2 * height + width, dtype=np.int64)
    inner = inner_in = 0
    for c in sides:
        inside = (c.u > u0) & (c.u < u1) & (c.z > z0) & (c.z < z1) & (c.depth > band)
        within = inside & (c.depth < thickness + 0.02)
        gaps = _inside_edges(c, box)
        within &= gaps.min(axis=0) > RIM_M[0]
        at_rim = within & (gaps.min(axis=0) < RIM_M[1])
        side = gaps[:, at_rim].argmin(axis=0)
        up = np.clip(((c.end_z[at_rim] - z0) / RIM_BIN_M).astype(np.int64), 0, height - 1)
        over = np.clip(((c.end_u[at_rim] - u0) / RIM_BIN_M).astype(np.int64), 0, width - 1)
        rim += np.bincount(np.choose(side, [up, height + up, 2 * height + over]), minlength=len(rim))
        inner += int(inside.sum())
        inner_in += int(within.sum())
    return bool((rim >= 2).mean() > FILLED_SHARE) or (inner > 20 and inner_in > 0.5 * inner)


def solid_back(sides: list[Crossings], box: Box, band: float) -> float | None:
    """How deep [m] the back of a recess lies: all rays into it end on one plane, and no frame stands before that.

    None for a hole, and of a wall that was seen from both sides: there a leaf shows on both, and a recess on one is wall.
    A closed leaf without a frame before it looks like a recess.
    """
    if len(sides) != 1:
        return None
    c, (u0, u1, z0, z1) = sides[0], box
    into = (c.u > u0) & (c.u < u1) & (c.z > z0) & (c.z < z1) & (c.depth > band)
    gap = _inside_edges(c, box).min(axis=0)
    inner = into & (gap > RIM_M[1]) & (c.end_z > z0 + RIM_M[1])
    if inner.sum() < LEAST_BACK:
        return None
    back = float(np.median(c.depth[inner]))
    if back > DEEPEST_BACK_M:
        return None
    on = inner & (np.abs(c.depth - back) < band)
    rim = into & (gap > RIM_M[0]) & (gap < RIM_M[1])
    before = rim & (c.depth < back - FRAME_BEFORE_M)
    if on.sum() < BACK_SHARE * inner.sum() or before.sum() > FRAMED_SHARE * rim.sum():
        return None
    return back


def _inside_edges(c: Crossings, box: Box) -> NDArray[np.float64]:
    """(3, N) how far within the start, the end and the head of a hole returns lie [m]."""
    u0, u1, _, z1 = box
    return np.stack([c.end_u - u0, u1 - c.end_u, z1 - c.end_z])


def reveal_depth(c: Crossings, box: Box, band: float) -> tuple[Span | None, float | None]:
    """(depths between which the reveal of the opening ends, depth of a leaf or pane that closes it), metres; None unknown."""
    u0, u1, z0, z1 = box
    deep = (c.depth > band) & (c.depth < 0.9) & (c.u > u0) & (c.u < u1) & (c.z > z0) & (c.z < z1)
    upright, level = deep & (c.end_z > z0) & (c.end_z < z1), deep & (c.end_u > u0) & (c.end_u < u1)
    reveals = [
        c.depth[own & (np.abs(off) < 0.01)]
        for own, off in ((upright, c.end_u - u0), (upright, c.end_u - u1), (level, c.end_z - z1))
    ]
    inner = deep & (c.end_u > u0 + 0.1) & (c.end_u < u1 - 0.1) & (c.end_z > z0 + 0.1) & (c.end_z < z1 - 0.1)
    leaf: float | None = None
    width, height = max(u1 - u0 - 0.2, 0.05), max(z1 - z0 - 0.2, 0.05)
    if inner.sum() > 20:
        bins = np.bincount((c.depth[inner] / 0.01).astype(np.int64))
        best = int(np.argmax(bins))
        cells = np.unique(np.floor(c.end_u[inner] / 0.05) * 10007 + np.floor(c.end_z[inner] / 0.05))
        if bins[max(best - 1, 0) : best + 2].sum() > 0.5 * inner.sum() and len(cells) * 0.0025 > 0.4 * width * height:
            leaf = float(np.median(c.depth[inner & (np.abs(c.depth - (best + 0.5) * 0.01) < 0.02)]))
    span = _end_of(reveals, leaf)
    if leaf is None and span is not None:
        leaf = _frame_depth(c, box, upright | level, span)
    return span, leaf


def passed_depth(c: Crossings, box: Box, margins: Box) -> float:
    """Depth at which rays left the hole sideways or upwards and went on: the wall is no thicker. Infinite if none did.

    ``margins`` are how far beyond each edge a ray is surely out of the hole [m]; the sill does not count, it may slope.
    """
    u0, u1, z0, z1 = box
    own = (c.depth > BEYOND_M) & (c.u > u0) & (c.u < u1) & (c.z > z0) & (c.z < z1)
    depth = c.depth[own]
    along, up = (c.end_u[own] - c.u[own]) / depth, (c.end_z[own] - c.z[own]) / depth
    with np.errstate(divide="ignore", invalid="ignore"):
        left = np.stack([
            np.where(along < 0, (u0 - margins[0] - c.u[own]) / along, np.inf),
            np.where(along > 0, (u1 + margins[1] - c.u[own]) / along, np.inf),
            np.where(up > 0, (z1 + margins[3] - c.z[own]) / up, np.inf),
        ]).min(axis=0)
    left = np.sort(left[(left < depth - BEYOND_M) & (c.z[own] + up * left > z0)])
    return float(left[LEAST_COLUMN - 1]) if len(left) >= LEAST_COLUMN else np.inf


def _frame_depth(c: Crossings, box: Box, inside: NDArray[np.bool_], span: Span) -> float | None:
    """How deep a frame stands that ends a reveal: it is seen no farther, even if the frame's pane sends nothing back."""
    gap = _inside_edges(c, box).min(axis=0)
    here = inside & (gap > RIM_M[0]) & (gap < RIM_M[1])
    here &= (c.depth > span[0] - FRAME_STEP_M) & (c.depth < span[1] + FRAME_STEP_M)
    return float(np.median(c.depth[here])) if here.sum() >= LEAST_REVEAL_RETURNS else None


def _end_of(reveals: list[NDArray[np.float64]], leaf: float | None) -> Span | None:
    """Between the deepest return on the reveal and as far again as the next one would lie: the rays' spacing there.

    Behind a pane a reveal is seen in a few slanted columns only, and the last of them falls short of its end.
    """
    depth = np.concatenate(reveals)
    if len(depth) < LEAST_REVEAL_RETURNS:
        return None
    bins = np.bincount((depth / REVEAL_BIN_M).astype(np.int64))
    enough = bins >= max(3.0, 0.05 * np.median(bins[bins > 0]))
    if not enough.any():
        return None
    last = int(np.flatnonzero(enough)[-1])
    tail = depth[(depth > (last - 1) * REVEAL_BIN_M) & (depth < (last + 1) * REVEAL_BIN_M)]
    end = float(np.quantile(tail, 0.98))
    if enough[max(last - DENSE_BINS, 0) : last + 1].all():
        return end, end
    side = next(r for r in reveals if ((r / REVEAL_BIN_M).astype(np.int64) == last).any())
    columns = np.flatnonzero(np.bincount((side / REVEAL_BIN_M).astype(np.int64))[: last + 1] >= LEAST_COLUMN) * REVEAL_BIN_M
    behind = columns[columns > leaf] if leaf is not None else columns
    # a single column behind the pane: the spacing is that before it, on the same side
    steps = np.diff(behind)[-STEPS:] if len(behind) > 1 else np.diff(columns[:-1])
    return end, end + float(steps.max() if len(steps) else end - (leaf or 0.0))
