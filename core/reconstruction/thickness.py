"""Thickness of walls that were seen from one side only: from the reveals of their openings, else assumed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .building import ASSUMED, REVEAL
from .crossings import Crossings
from .opening_edges import SIDES
from .opening_fill import Span, passed_depth, reveal_depth
from .openings import Opening
from .walls import WallLine

DEFAULT_M = 0.30
BEYOND_LEAF_M = 0.03
"""A reveal that goes on this far behind the leaf is taken to end with the wall."""
HALF_LEAF_M = 0.015
LEAST_M, MOST_M = 0.06, 0.8
BEHIND_LEAF_M = 0.05
"""A wall goes on at least this far behind the deepest leaf or pane of its kind."""
SAME_REVEAL_M = 0.02
EDGE_SIGMAS = 3.0
EDGE_M = 0.002
"""A ray is out of a hole this many standard deviations of its edge, and this far, beyond it."""
REVEAL_SIGMA_M = 0.005
SAME_END_M = 2.0 * np.sqrt(2.0) * REVEAL_SIGMA_M
"""Two reveals of one thickness seem to end no farther apart, at 95 %."""
LEAF_SIGMA_M = 0.05
BORROWED_SIGMA_M = 0.12
"""Standard deviations of a thickness: from a reveal, from a leaf in the wall, from other walls (6 to 50 cm occur)."""


@dataclass(frozen=True)
class Hint:
    """What the openings of one wall say of its thickness [m]; None for nothing."""

    reveal: Span | None
    """Depths between which a reveal ends that goes on behind the leaf."""
    at_least: float
    leaf: float | None
    at_most: float = np.inf
    """Rays went on beside its holes at this depth."""
    recess: float = 0.0
    """Its deepest recess; the wall goes on behind it."""


def hint(side: Crossings, openings: list[Opening], band: float) -> Hint:
    """From all openings of a wall."""
    reveals: list[Span] = []
    least, most, leaves = 0.0, np.inf, []
    recess = max((o.recess for o in openings), default=0.0)
    for opening in (o for o in openings if o.kind != "recess"):
        box = opening.u0, opening.u1, opening.z0, opening.z1
        most = min(most, passed_depth(side, box, _margins(opening)))
        span, leaf = reveal_depth(side, box, band)
        if leaf is not None:
            leaves.append(leaf)
        if span is None or not LEAST_M < span[0] < MOST_M or opening.kind == "door" or opening.down or opening.foot_hidden:
            continue
        least = max(least, span[0])
        if leaf is None or span[0] > leaf + BEYOND_LEAF_M:
            reveals.append(span)
    # reveals end at the frame in other openings of the same wall: a depth is an end only if nothing goes deeper
    reveals = [r for r in reveals if r[1] >= least and not (leaves and r[0] < min(leaves) + BEYOND_LEAF_M)]
    reveal = _ended((_common(reveals) or max(reveals)), most) if reveals else None
    most = most if most > least - REVEAL_SIGMA_M else np.inf
    return Hint(reveal, least, float(np.median(leaves)) if leaves else None, most, recess)


def _margins(opening: Opening) -> tuple[float, float, float, float]:
    """How far beyond each edge is surely out of the hole; endless beyond one that was not seen [m]."""
    start, end, sill, head = (
        np.inf if name in opening.hidden else EDGE_SIGMAS * sigma + EDGE_M
        for name, sigma in zip(SIDES, opening.edge_sigma, strict=True)
    )
    return start, end, sill, head


def _ended(span: Span, most: float) -> Span:
    """A reveal's end where rays went on at the depth ``most``; what contradicts the reveal is of another wall."""
    return span if most < span[0] - REVEAL_SIGMA_M else (span[0], max(span[0], min(span[1], most)))


def _common(spans: list[Span]) -> Span | None:
    """What all spans share, within the error of a reveal; None where they tell of several thicknesses."""
    if not spans:
        return None
    low, high = max(s[0] for s in spans), min(s[1] for s in spans)
    return (min(low, high), max(low, high)) if low < high + SAME_END_M else None


def settle(walls: list[WallLine], hints: list[Hint]) -> None:
    """Give every one-sided wall its thickness, say where it is from, and how far it may be off.

    Where the ends of all reveals of a storey agree, its outer walls are taken to be equally thick.
    """
    open_walls = [(w, h) for w, h in zip(walls, hints, strict=True) if not w.two_sided]
    reveals = [h.reveal for _, h in open_walls if h.reveal is not None]
    common = _common(reveals)
    if common is not None:
        for _, h in open_walls:
            common = _ended(common, h.at_most)
    typical = float(np.mean(common)) if common else float(np.median(np.mean(reveals, axis=1))) if reveals else None
    # a leaf or pane is taken to stand in the middle of the wall; walls of a storey that are like each other tell more
    leaves = [h.leaf for _, h in open_walls if h.leaf is not None]
    middle = max(2 * (float(np.median(leaves)) + HALF_LEAF_M), max(leaves) + BEHIND_LEAF_M) if leaves else None
    for wall, h in open_walls:
        wall.source, wall.thickness_sigma = ASSUMED, BORROWED_SIGMA_M
        if h.reveal is not None and (typical is None or h.reveal[1] > typical - SAME_REVEAL_M):
            span = common or h.reveal
            wall.thickness, wall.source = float(np.mean(span)), REVEAL
            wall.thickness_sigma = float(np.hypot(REVEAL_SIGMA_M, (span[1] - span[0]) / np.sqrt(12.0)))
        elif typical is not None and typical >= h.at_least - 0.02:
            wall.thickness = typical
        else:
            wall.thickness = middle if middle is not None else DEFAULT_M
        wall.thickness = min(wall.thickness, h.at_most)
        if h.recess:
            wall.thickness = max(wall.thickness, h.recess + BEHIND_LEAF_M)
        if wall.source == ASSUMED and h.leaf is not None:
            wall.thickness_sigma = LEAF_SIGMA_M
