"""Where the edges of a hole in a wall are, how surely, and which of them were not seen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_opening, gaussian_filter1d
from scipy.special import ndtr

from .crossings import BEFORE, Crossings

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SIDES = ("start", "end", "sill", "head")
"""Order of the edges everywhere: along the wall from its start, then upwards."""
CLEAR_SHARE = 0.1
"""Of an edge's length, at both its ends: there another edge is near."""
OPEN_SHARE = 0.6
LEAST_CELLS = 2
JUMP_M = 0.1
"""What is open beyond a longer stretch of nothing seen need not belong to the same hole."""
LEAST_DEEP = 5
"""Lines: one row of returns fills up to four of them where nothing else is known."""
SIDE_SEEN = 0.5
"""A side of a hole was seen if wall follows close to what is open along this share of it."""
LEAST_PIER_M = 0.06
"""No wall is as narrow between two holes: the end of a leaf that stands open at right angles before the wall is 4 or 5 cm."""
SEEN_CELLS = 3.0
"""An edge is seen where what is open and what is solid come this close."""
WITHIN_CELLS = 1.5
"""A face may reach so far beyond the line of cells at which its hole was found to begin."""
LEAST_STRIPS = 3
BEAM_M = (0.001, 0.002)
"""A beam whose middle passes an edge by up to its radius may still return from the face: mean and standard deviation of how
far within its edge a hole seems to begin."""
STRAY = 0.02
"""Share of columns in which something else than the edge ends the face or the hole."""
ON_REVEAL = 0.4
"""Last returns that lie so much deeper than the face beside them, in half-widths of the band, are not on it. The face
itself lies as deep where one station is off."""
BANDS_PER_NOISE = 12.0
"""Half-widths of the band per standard deviation of a return's place along the face."""
LEAST_NOISE_M, COLUMN_NOISES = 0.0002, 4.0
"""Least standard deviation of a return's place along the face; strips that differ by no more than so many show one column."""
GRID_M = 0.00025
BEYOND_M = 0.012
"""What is likely is looked at so far beyond the middles of what was seen."""
REVEAL_BIN_M = 0.01
LEAST_REVEAL_RETURNS = 30
REVEAL_SPAN_M = (0.03, 0.2)
"""A reveal reaches at least this deep, and this far along the edge."""
LINE_BIN_M = 0.002
LINE_SHARE = 0.4
"""Of the returns between the last one on the face and the first one behind it: those on a reveal lie in one line."""
LINE_DEPTH_M = .03
"""A column of rays on something else makes a line as well, but at one depth."""
LAYER_M = 0.01
"""The two neighbouring layers of this depth that hold most returns are left out: there a frame may stand."""
NEAR_M = 0.004
REVEAL_SIGMA_M = 0.0007
"""Of a place by the reveal, however many returns are on it."""
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
    """Of all sides of a wall. A return on the face is where it is, also where the face was moved after rays were followed."""
    u, z, depth, end_u, end_z = (
        np.concatenate([getattr(s, name) for s in sides]) for name in ("u", "z", "depth", "end_u", "end_z")
    )
    on = np.abs(depth) <= band
    return Returns(np.where(on, end_u, u), np.where(on, end_z, z), on, depth > band, end_u, end_z, depth)


def wall_lines(solid: Flags) -> Flags:
    """(lines,) of ``solid`` (lines, across) that show wall: along half of the line, or in cells that go on over lines.

    A level top before a hole ends at the wall's plane in a few cells, and so does what stands upright there.
    """
    deep = binary_opening(solid, np.ones((LEAST_DEEP, 1), dtype=np.bool_)).sum(axis=1)
    shown: Flags = (deep >= LEAST_CELLS) | (solid.sum(axis=1) >= max(SIDE_SEEN * solid.shape[1], LEAST_CELLS))
    return shown


def bracket(holes: Flags, solid: Flags, end: int, sign: int, most_jump: int, pier: int) -> tuple[int, int, int]:
    """(last line that is open, where it may end, first line that is solid) from line ``end`` of a hole outwards.

    ``holes`` and ``solid`` are (lines, across) restricted to the hole across; ``sign`` 1 outwards is towards larger lines.
    Lines of which nothing is known lie between the first two. The second is the third, or a line before it that is open
    but so far off that it need not belong to the same hole. Without a solid line it is the raster's own border. What is
    solid on fewer than ``pier`` lines before it opens again is no wall.
    """
    inner, jump = end, 0
    open_cells, solid_cells = holes.sum(axis=1), solid.sum(axis=1)
    is_solid = (solid_cells >= LEAST_CELLS) & (open_cells <= OPEN_SHARE * (open_cells + solid_cells))
    is_open = (open_cells >= LEAST_CELLS) & ~is_solid
    is_wall = is_solid & wall_lines(solid)
    line, ends = end + sign, None
    while 0 <= line < len(holes):
        beyond = is_open[line : line + pier] if sign > 0 else is_open[max(line - pier + 1, 0) : line + 1]
        if is_wall[line] and not beyond.any():
            break
        if is_open[line]:
            if jump > most_jump and ends is None:
                ends = line
            if ends is None:
                inner = line
            jump = 0
        else:
            jump += 1
        line += sign
    return inner, line if ends is None else ends, line


def seen_edge(
    at: Array, across: Array, depth: Array, chosen: Flags, inner: float, outer: float, cell: float, side: float, band: float,
    reveal: Callable[[float, float], EdgePlace | None],
) -> EdgePlace | None:
    """The edge between the last return on the face and the first one behind it in each of many strips; None if not seen.

    Up to ``inner`` it is open, from ``outer`` on solid; ``side`` 1 where the hole begins, -1 where it ends. What lies on
    the face farther within the hole is a leaf that stands open. Strips share the edge: where their grids of rays differ,
    they narrow it down together, and where they are alike they do not. What returns from deeper than the face, beyond where
    rays surely went through in the same strip, is no face. ``reveal`` is asked for the edge by what was seen of the reveal
    between two places.
    """
    close = chosen & (np.abs(at - 0.5 * (inner + outer)) < SEEN_CELLS * cell)
    solid = close & (depth >= -BEFORE * band) & (depth <= band) & (side * (at - inner) < WITHIN_CELLS * cell)
    through = close & (depth > band)
    if solid.sum() < LEAST_STRIPS or through.sum() < LEAST_STRIPS:
        return None
    width = max(2.0 * cell, 0.04)
    strip = np.floor(across / width).astype(np.int64)
    a = at * side
    first = int(strip[close].min())
    count = int(strip[close].max()) - first + 1
    last, first_open, first_deep = np.full(count, -1), np.full(count, np.inf), np.full(count, np.inf)
    for opens, chosen in ((first_open, through), (first_deep, close & (depth > (1.0 + ON_REVEAL) * band))):
        np.minimum.at(opens, strip[chosen] - first, a[chosen])
    rows = np.flatnonzero(solid)
    # what a beam returns that met the edge and what is behind it lies between the two
    deep = depth - np.median(depth[rows]) > ON_REVEAL * band
    rows = rows[~(deep[rows] & (a[rows] > first_deep[strip[rows] - first]))]
    rows = rows[np.argsort(a[rows])]
    last[strip[rows] - first] = rows
    both = (last >= 0) & np.isfinite(first_open)
    last, first_open = last[both], first_open[both]
    gap = first_open - a[last]
    good = (gap < 2.0 * cell) & (gap > -0.5 * cell)
    if good.sum() < LEAST_STRIPS:
        return None
    last, first_open, noise = last[good], first_open[good], band / BANDS_PER_NOISE
    middles = float(np.median(a[last])), float(np.median(first_open))
    low, high = sorted((side * (min(middles) - NEAR_M), side * (max(middles) + NEAR_M)))
    by_reveal = reveal(low, high)
    if by_reveal is None and depth[last].mean() - np.median(depth[solid]) > ON_REVEAL * band:
        # the last returns within the band lie on the reveal, and the last of many goes beyond it by their noise
        place = float(np.median(a[last[deep[last]]])) - noise
        return EdgePlace(side * place, float(np.hypot(noise, REVEAL_SIGMA_M)), True)
    return by_reveal or _between(a[last], first_open, noise, side)


def _between(last_solid: Array, first_open: Array, noise: float, side: float) -> EdgePlace:
    """An edge that lies between the two in all strips but a few."""
    middles = float(np.median(last_solid)), float(np.median(first_open))
    t = np.arange(min(middles) - BEYOND_M, max(middles) + BEYOND_M, GRID_M)
    log = np.zeros(len(t))
    for sign, values in ((1.0, last_solid), (-1.0, first_open)):
        column, spread = _columns(values, noise)
        log += np.log(STRAY + (1.0 - STRAY) * ndtr(sign * (t[:, None] - column) / spread)).sum(axis=1)
    likely = gaussian_filter1d(np.exp(log - np.max(log)), BEAM_M[1] / GRID_M, mode="constant")
    t = t - BEAM_M[0]
    likely /= likely.sum()
    place = float(likely @ t)
    return EdgePlace(side * place, float(np.sqrt(likely @ (t - place) ** 2)), True)


def _columns(values: Array, most_noise: float) -> tuple[Array, Array]:
    """Places and standard deviations of the columns of rays that (N,) strips show.

    One column is seen in many strips. Each of them as a bound of its own would cut off what lies within its noise.
    """
    noise = float(np.clip(1.05 * np.median(np.abs(np.diff(values))), LEAST_NOISE_M, most_noise))
    ordered = np.sort(values)
    first = np.unique(np.searchsorted(ordered, ordered[0] + COLUMN_NOISES * noise * np.arange(np.ptp(ordered) // noise + 1)))
    first = first[first < len(ordered)]
    count = np.diff(np.append(first, len(ordered)))
    return np.add.reduceat(ordered, first) / count, noise / np.sqrt(count)


def reveal_between(
    end: Array, along_edge: Array, depth: Array, chosen: Flags, low: float, high: float
) -> EdgePlace | None:
    """A seen edge by the returns on its reveal, which lie in one line; None where there is no such line.

    ``chosen`` are those behind the face within the hole along the edge; the edge is known to be between ``low`` and ``high``.
    """
    own = chosen & (end > low) & (end < high)
    if own.sum() < LEAST_REVEAL_RETURNS:
        return None
    # a row of rays on a frame's face beside the reveal makes a line too, and often the stronger one
    layer = (depth / LAYER_M).astype(np.int64)
    densest = int(np.argmax(np.convolve(np.bincount(layer[own]), np.ones(2))))
    own &= (layer != densest) & (layer != densest - 1)
    if own.sum() < LEAST_REVEAL_RETURNS:
        return None
    number = ((end[own] - low) / LINE_BIN_M).astype(np.int64)
    line = low + (float(np.argmax(np.convolve(np.bincount(number), np.ones(3), mode="same"))) + 0.5) * LINE_BIN_M
    here = own & (np.abs(end - line) < 1.5 * LINE_BIN_M)
    if here.sum() < max(LEAST_REVEAL_RETURNS, LINE_SHARE * own.sum()):
        return None
    spans = [np.subtract(*np.quantile(v[here], (0.95, 0.05))) for v in (depth, along_edge)]
    if spans[0] < LINE_DEPTH_M or spans[1] < REVEAL_SPAN_M[1]:
        return None
    sigma = float(np.hypot(end[here].std() / np.sqrt(here.sum()), REVEAL_SIGMA_M))
    return EdgePlace(float(np.median(end[here])), sigma, True)


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
    sigma = float(np.hypot(end[here].std() / np.sqrt(here.sum()), REVEAL_SIGMA_M))
    return EdgePlace(float(np.median(end[here])), sigma, True)


def hidden_edge(inner: float, outer: float, far: float, cell: float) -> EdgePlace:
    """Anywhere between what is open and what is solid, as far as the raster's ``cell`` tells: put in the middle [m].

    ``far`` is where wall was seen: farther than ``outer`` if the wall is open there and it may be the same hole.
    """
    at, sign = 0.5 * (inner + outer), np.sign(outer - inner) or 1.0
    ends = np.array([inner - sign * cell, max(far * sign, outer * sign) * sign + sign * cell]) - at
    return EdgePlace(at, float(np.sqrt((ends**2).sum() + ends.prod()) / np.sqrt(3.0)), False)


def edge_near(
    rays: Returns, chosen: Flags, k: int, box: tuple[float, float, float, float], cell: float, thickness: float, band: float
) -> EdgePlace | None:
    """Edge ``k`` of ``SIDES`` of a hole that is about ``box``, by the ``chosen`` rays alone; None where they do not show it."""
    upright = k < 2
    at, across = (rays.u, rays.z) if upright else (rays.z, rays.u)
    end, along_edge = (rays.end_u, rays.end_z) if upright else (rays.end_z, rays.end_u)
    low, high = box[2:] if upright else box[:2]
    trim = CLEAR_SHARE * (high - low)
    clear = chosen & (across > low + trim) & (across < high - trim)
    into = chosen & (rays.depth > 0.5 * band) & (rays.depth < thickness) & (along_edge > low) & (along_edge < high)
    return seen_edge(
        at, across, rays.depth, clear, box[k], box[k], cell, (1.0, -1.0)[k % 2], band,
        partial(reveal_between, end, along_edge, rays.depth, into),
    )
