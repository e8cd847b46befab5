"""Where the edges of a hole in a wall are, how surely, and which of them were not seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .crossings import Crossings

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SIDES = ("start", "end", "sill", "head")
"""Order of the edges everywhere: along the wall from its start, then upwards."""
OPEN_SHARE = 0.6
LEAST_CELLS = 2
JUMP_M = 0.1
"""What is open beyond a longer stretch of nothing seen need not belong to the same hole."""
LEAST_PIER_M = 0.06
"""No wall is as narrow between two holes: the end of a leaf that stands open at right angles before the wall is 4 or 5 cm."""
SEEN_CELLS = 3.0
"""An edge is seen where what is open and what is solid come this close."""
WITHIN_CELLS = 1.5
"""A face may reach so far beyond the line of cells at which its hole was found to begin."""
LEAST_STRIPS = 3
BEAM_M = 0.004
"""Radius of a beam's footprint: a beam that straddles an edge may still return from the face, so all strips see a hole too
narrow by up to that, and that much of an edge's error stays."""
REVEAL_BIN_M = 0.01
LEAST_REVEAL_RETURNS = 30
REVEAL_SPAN_M = (0.03, 0.2)
"""A reveal reaches at least this deep, and this far along the edge."""
REVEAL_BEGIN_M = 0.027
"""It begins at the face; the side of a frame, or a leaf that stands open, begins deeper."""


@dataclass(frozen=True)
class EdgePlace:
    """An edge's place along the wall or in height [m], its standard deviation [m], and whether it was seen."""

    at: float
    sigma: float
    seen: bool


@dataclass(frozen=True)
class Returns:
    """Rays at a wall's faces, both sides together. Places [m]."""

    u: Array
    z: Array
    on: Flags
    """The return lies on the face."""
    behind: Flags
    end_u: Array
    end_z: Array
    depth: Array


def gathered(sides: list[Crossings], band: float) -> Returns:
    """Of all sides of a wall."""
    u, z, depth, end_u, end_z = (
        np.concatenate([getattr(s, name) for s in sides]) for name in ("u", "z", "depth", "end_u", "end_z")
    )
    return Returns(u, z, np.abs(depth) <= band, depth > band, end_u, end_z, depth)


def bracket(holes: Flags, solid: Flags, end: int, sign: int, most_jump: int, pier: int) -> tuple[int, int]:
    """(last line that is open, first line that is solid) from line ``end`` of a hole outwards.

    ``holes`` and ``solid`` are (lines, across) restricted to the hole across; ``sign`` 1 outwards is towards larger lines.
    Lines of which nothing is known lie between the two. Without a solid line the second is the raster's own border.
    What is solid on fewer than ``pier`` lines before it opens again is no wall.
    """
    inner, jump = end, 0
    open_cells, solid_cells = holes.sum(axis=1), solid.sum(axis=1)
    is_wall = (solid_cells >= LEAST_CELLS) & (open_cells <= OPEN_SHARE * (open_cells + solid_cells))
    is_open = (open_cells >= LEAST_CELLS) & ~is_wall
    line = end + sign
    while 0 <= line < len(holes):
        beyond = is_open[line : line + pier] if sign > 0 else is_open[max(line - pier + 1, 0) : line + 1]
        if is_wall[line] and not beyond.any():
            return inner, line
        if is_open[line]:
            if jump > most_jump:
                return inner, line
            inner, jump = line, 0
        else:
            jump += 1
        line += sign
    return inner, line


def seen_edge(
    at: Array, across: Array, on: Flags, behind: Flags, inner: float, outer: float, cell: float, side: float
) -> EdgePlace | None:
    """The edge between the last return on the face and the first one behind it, median over strips; None if not seen.

    Up to ``inner`` it is open, from ``outer`` on solid; ``side`` 1 where the hole begins, -1 where it ends. What lies on
    the face farther within the hole is a leaf that stands open.
    """
    close = np.abs(at - 0.5 * (inner + outer)) < SEEN_CELLS * cell
    solid, through = on & close & (side * (at - inner) < WITHIN_CELLS * cell), behind & close
    if solid.sum() < LEAST_STRIPS or through.sum() < LEAST_STRIPS:
        return None
    width = max(2.0 * cell, 0.04)
    strip = np.floor(across / width).astype(np.int64)
    a = at * side
    first = int(strip[close].min())
    count = int(strip[close].max()) - first + 1
    last_solid, first_open = np.full(count, -np.inf), np.full(count, np.inf)
    np.maximum.at(last_solid, strip[solid] - first, a[solid])
    np.minimum.at(first_open, strip[through] - first, a[through])
    both = np.isfinite(last_solid) & np.isfinite(first_open)
    gap = np.where(both, first_open - np.where(both, last_solid, 0.0), np.inf)
    both &= (gap < 2.0 * cell) & (gap > -0.5 * cell)
    if both.sum() < LEAST_STRIPS:
        return None
    middle = 0.5 * (last_solid[both] + first_open[both])
    place = float(np.median(middle))
    scatter = 1.4826 * float(np.median(np.abs(middle - place)))
    # within its gap the edge may be anywhere. Where the grid of rays lies alike in all strips, they share that error and
    # their middles agree; what they share is not averaged away
    alone = scatter**2
    shared = max(float(np.mean(gap[both])) ** 2 / 12.0 - alone, 0.0)
    return EdgePlace(side * place, float(np.sqrt(shared + alone / both.sum() + BEAM_M**2)), True)


def reveal_edge(
    end: Array, along_edge: Array, depth: Array, inside: Flags, limits: tuple[float, float], thickness: float
) -> EdgePlace | None:
    """An edge whose face is hidden, from returns on the reveal: a plane that goes straight into the wall.

    ``end`` is the returns' place across the edge, ``inside`` those within the hole along the edge and behind the face.
    """
    low, high = limits
    own = inside & (depth < thickness) & (end > low) & (end < high)
    if own.sum() < LEAST_REVEAL_RETURNS:
        return None
    bins = np.bincount(((end[own] - low) / REVEAL_BIN_M).astype(np.int64))
    best = int(np.argmax(np.convolve(bins, np.ones(2), mode="valid"))) if len(bins) > 1 else 0
    here = own & (np.abs(end - low - (best + 1) * REVEAL_BIN_M) < REVEAL_BIN_M)
    if here.sum() < max(LEAST_REVEAL_RETURNS, 0.3 * own.sum()):
        return None
    if np.quantile(depth[here], 0.05) > REVEAL_BEGIN_M:
        return None
    spans = [np.subtract(*np.quantile(v[here], (0.95, 0.05))) for v in (depth, along_edge)]
    if spans[0] < REVEAL_SPAN_M[0] or spans[1] < REVEAL_SPAN_M[1]:
        return None
    return EdgePlace(float(np.median(end[here])), float(np.hypot(end[here].std() / np.sqrt(here.sum()), BEAM_M)), True)


def hidden_edge(inner: float, outer: float, cell: float) -> EdgePlace:
    """Anywhere between what is open and what is solid, both [m], as far as the raster's ``cell`` [m] tells."""
    return EdgePlace(0.5 * (inner + outer), max(abs(outer - inner), cell) / float(np.sqrt(12.0)), False)
