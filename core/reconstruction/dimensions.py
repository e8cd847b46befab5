"""As-built dimensions of rooms, and their walls against plumb, square, parallel and flat (DIN 18202), from the fitted faces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from shapely import Point

from ..dimensions.table import Dimension, conformity, width
from ..planes.conformity import Conformity, orthogonality, parallelism, plumb
from ..planes.derived import Estimate, distance_between, level_of_accuracy
from ..planes.fit import Plane
from .building import BuiltRoom, BuiltStorey, Reconstruction

ON_FACE_M = 0.03
"""A side of a room this close to a face is the face's."""
PARALLEL_COS = np.cos(np.radians(5.0))
SQUARE_COS = np.sin(np.radians(5.0))


@dataclass(frozen=True)
class RoomWidth:
    """Clear distance of two faces that look at each other: metres, with its standard deviation."""

    walls: tuple[int, int]
    """Rows of the storey's walls."""
    distance: Estimate

    @property
    def level(self) -> str:
        """Level of accuracy that its 95 % interval keeps."""
        return level_of_accuracy(self.distance.sigma)


@dataclass(frozen=True)
class RoomDimensions:
    """What was measured in one room."""

    widths: tuple[RoomWidth, ...]
    tests: tuple[tuple[tuple[int, ...], Conformity], ...]
    """Rows of the walls concerned, and the test."""


def room_dimensions(storey: BuiltStorey, room: BuiltRoom) -> RoomDimensions:
    """Widths and tests of the faces that bound ``room``; faces that were not seen well enough to be fitted are left out."""
    height = room.ceiling - room.floor
    middle = np.array([*room.outline.representative_point().coords[0], 0.5 * (room.floor + room.ceiling)])
    faces = [
        (k, plane, length)
        for k, wall in enumerate(storey.walls) for plane in wall.planes
        if (length := _length_in(room, plane)) > 0.0
    ]  # fmt: skip
    widths: list[RoomWidth] = []
    tests: list[tuple[tuple[int, ...], Conformity]] = [((k,), plumb(plane, height)) for k, plane, _ in faces]
    tests += [
        ((k,), test) for k, wall in enumerate(storey.walls) for plane, own in zip(wall.planes, wall.flatness, strict=False)
        if _length_in(room, plane) > 0.0 for test in own
    ]  # fmt: skip
    for i, (a, first, first_length) in enumerate(faces):
        for b, second, second_length in faces[i + 1 :]:
            cosine = float(first.normal @ second.normal)
            length = min(first_length, second_length)
            if cosine < -PARALLEL_COS:
                widths.append(RoomWidth((a, b), distance_between(first, second, middle)))
                tests.append(((a, b), parallelism(first, second, length)))
            elif abs(cosine) < SQUARE_COS:
                tests.append(((a, b), orthogonality(first, second, length)))
    return RoomDimensions(tuple(widths), tuple(tests))


def dimension_rows(result: Reconstruction) -> list[Dimension]:
    """All rooms of a reconstruction as rows of a table; walls are named by their number in their storey."""
    rows = []
    for storey in result.storeys:
        for number, room in enumerate(storey.rooms, start=1):
            where, found = f"{storey.name}, room {number}", room_dimensions(storey, room)
            rows += [width(where, "", "width", _walls(w.walls), w.distance) for w in found.widths]
            rows += [conformity(where, "", _walls(walls), test) for walls, test in found.tests]
    return rows


def _walls(rows: Sequence[int]) -> tuple[str, ...]:
    return tuple(f"wall {k + 1}" for k in rows)


def _length_in(room: BuiltRoom, plane: Plane) -> float:
    """Length [m] of the room's outline that lies on the face, which looks into the room."""
    ring = np.array(room.outline.exterior.coords)
    total = 0.0
    for start, end in pairwise(ring):
        ends = np.column_stack([np.stack([start, end]), np.full(2, plane.centroid[2])])
        if np.abs(plane.distance(ends)).max() > ON_FACE_M:
            continue
        before = 0.5 * (start + end) + 2 * ON_FACE_M * plane.normal[:2]
        if room.outline.contains(Point(*before)):
            total += float(np.linalg.norm(end - start))
    return total


def dimensions_to_json(found: RoomDimensions) -> dict[str, Any]:
    """Plain values, metres; walls by number from 1."""
    return {
        "widths": [
            {"walls": _numbers(w.walls), "width": w.distance.value, "sigma": w.distance.sigma,
             "interval_95": list(w.distance.interval), "loa": w.level}
            for w in found.widths
        ],
        "tests": [
            {"test": t.name, "walls": _numbers(walls), "offset": t.value, "sigma": t.sigma, "p_value": t.p_value,
             "limit": t.limit, "p_limit": t.p_limit, "exceeds": t.exceeds}
            for walls, t in found.tests
        ],
    }  # fmt: skip


def _numbers(walls: Sequence[int]) -> list[int]:
    return [k + 1 for k in walls]
