"""Vertices, edges, slopes and unevenness of a room from the fitted faces that bound it, as rows of a table."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from shapely import MultiPolygon, Polygon
from shapely.geometry.polygon import orient

from ..errors import BimVerifyError
from ..planes.derived import (
    Estimate,
    edge_length,
    intersect_three,
    intersect_two,
    level_of_accuracy,
    plane_slope,
    plumb_deviation,
    rise,
)
from ..planes.fit import Plane
from ..planes.unevenness import Unevenness
from .table import Dimension, measured

Array = NDArray[np.float64]

ON_SIDE_M = 0.05
"""A face this close to a side of the outline, and along it, is the side's."""
ALONG_SIN = np.sin(np.radians(5.0))
FARTHEST_M = 1.0
"""A face that ends farther from a corner says nothing of it."""


@dataclass(frozen=True)
class Bound:
    """A face that bounds a room. Metres, the frame of the room's outline."""

    name: str
    """Of its element."""
    plane: Plane
    """As measured, its normal turned into the room."""
    unevenness: Unevenness | None
    ends: tuple[Array, Array] | None = None
    """Two places in plan (2,) between which an upright face lies; None for floors and ceilings."""
    planned: tuple[Array, Array] | None = None
    """(3,) normal into the room and (3,) a place, where a plan is known."""


@dataclass(frozen=True)
class Room:
    """What is measured: its name, its outline in plan and what bounds it, as far as it was seen."""

    name: str
    global_id: str
    outline: Polygon | MultiPolygon
    walls: Sequence[Bound]
    floor: Bound | None
    ceiling: Bound | None
    origin: Array = field(default_factory=lambda: np.zeros(3))
    """(3,) frame of the results minus that of the faces [m]."""
    registration_sigma: float = 0.0
    """Of the stations [m]: where a face is counts it."""


@dataclass(frozen=True)
class _Corner:
    before: Bound | None
    """Faces of the sides that end and that begin here, as one goes round with the room at the left."""
    after: Bound | None


def corner_rows(room: Room) -> Iterator[Dimension]:
    """Rows for what was seen well enough; lengths in metres, leans and slopes in metres over one metre."""
    levels = [_registered(b, room) for b in (room.floor, room.ceiling) if b is not None]
    walls = [_registered(w, room) for w in room.walls]
    used: dict[int, Bound] = {}
    for polygon in room.outline.geoms if isinstance(room.outline, MultiPolygon) else (room.outline,):
        corners = _corners(polygon, walls)
        used |= {id(b): b for c in corners for b in (c.before, c.after) if b is not None}
        for here, there in zip(corners, [*corners[1:], *corners[:1]], strict=True):
            if here.before is not None and here.after is not None:
                yield from _upright(room, here.before, here.after, levels)
            if here.after is not None and here.after is there.before:
                for level in levels:
                    yield from _level(room, here.after, level, here.before, there.after)
    for face in [*used.values(), *levels]:
        yield from _face(room, face)


def _registered(bound: Bound, room: Room) -> Bound:
    shift = np.diag([0.0, 0.0, room.registration_sigma**2])
    return replace(bound, plane=bound.plane.replaced(covariance=bound.plane.covariance + shift))


def _corners(polygon: Polygon, walls: list[Bound]) -> list[_Corner]:
    ring = np.array(orient(polygon.simplify(0.001)).exterior.coords)[:-1]
    sides = list(zip(ring, np.roll(ring, -1, axis=0), strict=True))
    return [
        _Corner(_face_at(corner, sides[k - 1], walls), _face_at(corner, sides[k], walls)) for k, corner in enumerate(ring)
    ]


def _face_at(corner: Array, side: tuple[Array, Array], walls: list[Bound]) -> Bound | None:
    """Of the faces that lie on a side of the outline, the one that comes nearest to the corner."""
    along = (side[1] - side[0]) / max(float(np.linalg.norm(side[1] - side[0])), 1e-9)
    inward = np.array([-along[1], along[0]])
    best, least = None, FARTHEST_M
    for wall in walls:
        normal, place = wall.planned or (wall.plane.normal, wall.plane.centroid)
        if wall.ends is None or normal[:2] @ inward < 0.5 or abs(normal[:2] @ along) > ALONG_SIN:
            continue
        if max(abs(float((end - place[:2]) @ normal[:2])) for end in side) > ON_SIDE_M:
            continue
        low, high = sorted(float((end - corner) @ along) for end in wall.ends)
        if (gap := max(low, -high, 0.0)) < least:
            best, least = wall, gap
    return best


def _upright(room: Room, a: Bound, b: Bound, levels: list[Bound]) -> Iterator[Dimension]:
    """The edge of two walls, and the vertices at its ends."""
    try:
        edge = intersect_two(a.plane, b.plane)
        vertices = [intersect_three(a.plane, b.plane, level.plane) for level in levels]
    except BimVerifyError:
        return
    for level, vertex in zip(levels, vertices, strict=True):
        planned = _planned_vertex(a, b, level)
        loa = level_of_accuracy(vertex.sigma)
        for k, axis in enumerate("xyz"):
            found = Estimate(float(vertex.position[k] + room.origin[k]), float(np.sqrt(vertex.covariance[k, k])))
            expected = None if planned is None else float(planned[k] + room.origin[k])
            row = measured(room.name, room.global_id, f"vertex {axis}", (a.name, b.name, level.name), found, expected, loa)
            yield replace(row, covariance=tuple(vertex.covariance[k].tolist()))
    between = (a.name, b.name)
    for axis, lean in zip("xy", edge.lean, strict=True):
        yield measured(room.name, room.global_id, f"edge lean {axis}", between, lean)
    if len(levels) == 2:
        yield _length(room, between, edge_length(a.plane, b.plane, levels[0].plane, levels[1].plane))


def _level(room: Room, wall: Bound, level: Bound, start: Bound | None, end: Bound | None) -> Iterator[Dimension]:
    """The edge of a wall and a floor or ceiling, between the walls beside it."""
    between = (wall.name, level.name)
    try:
        slope = intersect_two(wall.plane, level.plane).slope
        if start is not None and end is not None:
            yield _length(room, between, edge_length(wall.plane, level.plane, start.plane, end.plane))
    except BimVerifyError:
        return
    yield measured(room.name, room.global_id, "edge slope", between, _tangent(slope))


def _length(room: Room, between: tuple[str, ...], found: Estimate) -> Dimension:
    return measured(room.name, room.global_id, "edge length", between, found, loa=level_of_accuracy(found.sigma))


def _face(room: Room, face: Bound) -> Iterator[Dimension]:
    planned = None if face.planned is None else face.planned[0]
    normal = face.plane.normal
    rows: list[tuple[str, Estimate, float | None]] = []
    if abs(normal[2]) < ALONG_SIN:
        expected = None if planned is None else float(planned[2] / np.hypot(planned[0], planned[1]))
        rows.append(("lean", _tangent(plumb_deviation(face.plane)), expected))
    elif np.hypot(normal[0], normal[1]) < ALONG_SIN:
        for k, found in enumerate(rise(face.plane)):
            rows.append((f"slope {'xy'[k]}", found, None if planned is None else float(-planned[k] / planned[2])))
    else:
        expected = None if planned is None else float(np.hypot(planned[0], planned[1]) / abs(planned[2]))
        rows.append(("slope", _tangent(plane_slope(face.plane)), expected))
    if face.unevenness is not None:
        rows.append(("unevenness", Estimate(face.unevenness.sigma, face.unevenness.sigma_spread), None))
    for what, found, expected in rows:
        row = measured(room.name, room.global_id, what, (face.name,), found, expected)
        if what == "unevenness" and face.unevenness is not None:
            row = replace(row, interval_95=face.unevenness.interval_95)
        yield row


def _tangent(angle: Estimate) -> Estimate:
    """Over one metre [m]."""
    return Estimate(float(np.tan(angle.value)), angle.sigma / float(np.cos(angle.value)) ** 2)


def _planned_vertex(*faces: Bound) -> Array | None:
    planned = [f.planned for f in faces if f.planned is not None]
    if len(planned) < 3:
        return None
    normals = np.stack([normal for normal, _ in planned])
    return np.asarray(np.linalg.solve(normals, [float(normal @ place) for normal, place in planned]))
