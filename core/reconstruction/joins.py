"""Ends of walls: against the face of the wall they meet, or mitred at a corner."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon

from .walls import WallLine

Array = NDArray[np.float64]

LEAST_ANGLE = np.sin(np.radians(15.0))
REACH_M = 0.35
"""A wall that ends this far before another one's middle plane (beyond half of its thickness) goes up to it."""
CORNER_M = 0.25
"""A meeting this close to the other wall's end (beyond half of the own thickness) is a corner."""


@dataclass(frozen=True)
class Join:
    """Where a wall's end meets another wall."""

    other: int
    kind: str
    """CORNER or BUTT."""


@dataclass(frozen=True)
class JoinedWall:
    """A wall's plan with its ends cut."""

    footprint: Polygon
    start: Array
    end: Array
    """(2,) ends of the axis."""
    joins: tuple[Join | None, Join | None]


def join_walls(walls: list[WallLine]) -> list[JoinedWall]:
    """The footprint of every wall."""
    found = [[_partner(walls, k, at_end) for at_end in (False, True)] for k in range(len(walls))]
    found = [[_against(walls, found, k, join) for join in pair] for k, pair in enumerate(found)]
    out = []
    for k, wall in enumerate(walls):
        cuts = []
        for at_end in (False, True):
            join = found[k][at_end]
            cuts.append(_cut(wall, walls[join.other] if join else None, join, at_end))
        corners = []
        for across, order in ((wall.near - wall.thickness, (0, 1)), (wall.near, (1, 0))):
            for end in order:
                corners.append(_meet(wall, across, cuts[end]))
        footprint = Polygon(corners)
        axis = [_meet(wall, wall.axis, cut) for cut in cuts]
        if not footprint.is_valid or footprint.area < 1e-4:
            square = [wall.point(u, a) for a, us in ((wall.near - wall.thickness, (wall.u0, wall.u1)),
                                                     (wall.near, (wall.u1, wall.u0))) for u in us]
            footprint, axis = Polygon(square), [wall.point(u, wall.axis) for u in (wall.u0, wall.u1)]
        out.append(JoinedWall(footprint, axis[0], axis[1], (found[k][0], found[k][1])))
    return out


def _partner(walls: list[WallLine], k: int, at_end: bool) -> Join | None:
    wall = walls[k]
    u = wall.u1 if at_end else wall.u0
    best: tuple[float, Join] | None = None
    for j, other in enumerate(walls):
        sine = abs(float(wall.along[0] * other.along[1] - wall.along[1] * other.along[0]))
        if j == k or sine < LEAST_ANGLE:
            continue
        place = _cross_axes(wall, other)
        beyond = abs(float(place @ wall.along) - u)
        if beyond > (other.thickness / 2 + wall.thickness / 2) / sine + REACH_M:
            continue
        v = float(place @ other.along)
        slack = wall.thickness / 2 / sine + CORNER_M
        if v < other.u0 - slack or v > other.u1 + slack:
            continue
        corner = v < other.u0 + slack or v > other.u1 - slack
        if best is None or beyond < best[0]:
            best = beyond, Join(j, "CORNER" if corner else "BUTT")
    return best[1] if best else None


def _against(walls: list[WallLine], found: list[list[Join | None]], k: int, join: Join | None) -> Join | None:
    """A wall that meets the corner of two others ends at the face of the one it meets: only those two are mitred."""
    if join is None or join.kind != "CORNER":
        return join
    other = walls[join.other]
    place = float(_cross_axes(walls[k], other) @ other.along)
    corner = found[join.other][int(abs(place - other.u1) < abs(place - other.u0))]
    third = corner is not None and corner.kind == "CORNER" and corner.other != k
    return Join(join.other, "BUTT") if third else join


def _cross_axes(a: WallLine, b: WallLine) -> Array:
    return np.asarray(np.linalg.solve(np.stack([a.normal, b.normal]), [a.axis, b.axis]))


def _cut(wall: WallLine, other: WallLine | None, join: Join | None, at_end: bool) -> tuple[Array, float]:
    """The line (normal, offset) that ends the wall."""
    u = wall.u1 if at_end else wall.u0
    if other is None or join is None:
        return wall.along, u
    inner = wall.point(0.5 * (wall.u0 + wall.u1), wall.axis)
    side = 1.0 if float(other.normal @ inner) > other.axis else -1.0
    if join.kind == "BUTT":
        return other.normal, other.near if side > 0 else other.near - other.thickness
    # mitre: through the corner of the inner faces and that of the outer faces
    other_inner = other.point(0.5 * (other.u0 + other.u1), other.axis)
    own_side = 1.0 if float(wall.normal @ other_inner) > wall.axis else -1.0

    def corner(sign: float) -> Array:
        a = wall.axis + sign * own_side * wall.thickness / 2
        b = other.axis + sign * side * other.thickness / 2
        return np.asarray(np.linalg.solve(np.stack([wall.normal, other.normal]), [a, b]))

    first, second = corner(1.0), corner(-1.0)
    step = second - first
    normal = np.array([-step[1], step[0]]) / max(float(np.linalg.norm(step)), 1e-12)
    return normal, float(normal @ first)


def _meet(wall: WallLine, across: float, cut: tuple[Array, float]) -> Array:
    return np.asarray(np.linalg.solve(np.stack([wall.normal, cut[0]]), [across, cut[1]]))
