"""As-built dimensions of rooms and openings, and faces against plumb, square, parallel and flat (DIN 18202)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..dimensions.corners import Bound, Room, corner_rows
from ..dimensions.table import Dimension, conformity, unmeasured, width
from ..planes.conformity import Conformity, orthogonality, parallelism, plumb
from ..planes.derived import Estimate, distance_between, level_of_accuracy
from ..planes.fit import Plane
from .building import ASSUMED, NO_IDS, BuiltRoom, BuiltStorey, Reconstruction, StoreyIds
from .fitted import sides_on

Array = NDArray[np.float64]

LEVELS = ("floor", "ceiling")
LEAST_OVERLAP_M = 0.02
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
    height: Estimate | None
    """From floor to ceiling in the room's middle [m]; None where one of them was not seen."""
    tests: tuple[tuple[tuple[int, ...], Conformity], ...]
    """Rows of the walls concerned, and the test."""


def room_dimensions(room: BuiltRoom) -> RoomDimensions:
    """Widths and tests of the faces that bound ``room``; faces that were not seen well enough to be fitted are left out."""
    height = room.ceiling - room.floor
    middle = np.array([*room.outline.representative_point().coords[0], 0.5 * (room.floor + room.ceiling)])
    faces = [(f.wall, f.face.plane, sides_on(room.outline, f.face.plane)) for f in room.wall_faces]
    widths: list[RoomWidth] = []
    tests: list[tuple[tuple[int, ...], Conformity]] = [((k,), plumb(plane, height)) for k, plane, _ in faces]
    tests += [((f.wall,), test) for f in room.wall_faces for test in f.face.flatness]
    for i, (a, first, first_sides) in enumerate(faces):
        for b, second, second_sides in faces[i + 1 :]:
            cosine = float(first.normal @ second.normal)
            length = min(_length(first_sides), _length(second_sides))
            if cosine < -PARALLEL_COS:
                between = _between(first, first_sides, second, second_sides)
                if between is not None:
                    at = np.array([*between, middle[2]])
                    widths.append(RoomWidth((a, b), distance_between(first, second, at)))
                    tests.append(((a, b), parallelism(first, second, length)))
            elif abs(cosine) < SQUARE_COS:
                tests.append(((a, b), orthogonality(first, second, length)))
    bottom, top = room.floor_face, room.ceiling_face
    clear = distance_between(bottom.plane, top.plane, middle) if bottom and top else None
    return RoomDimensions(tuple(widths), clear, tuple(tests))


def dimension_rows(result: Reconstruction, ids: Sequence[StoreyIds] = ()) -> list[Dimension]:
    """All rooms and openings of a reconstruction as rows of a table, metres, frame of the scans.

    Walls are named by their number in their storey. ``ids``: of what was written (``write_ifc.written_building``).
    """
    given = ids or [NO_IDS] * len(result.storeys)
    return [
        row for storey, own in zip(result.storeys, given, strict=True) for row in storey_rows(storey, result.origin, own)
    ]


def storey_rows(storey: BuiltStorey, origin: Array, ids: StoreyIds = NO_IDS) -> list[Dimension]:
    """The same of one storey."""
    rows: list[Dimension] = []
    for number, room in enumerate(storey.rooms, start=1):
        where, own, found = f"{storey.name}, room {number}", ids.room(number - 1), room_dimensions(room)
        rows += [width(where, own, "width", _walls(w.walls), w.distance) for w in found.widths]
        if found.height is not None:
            rows.append(width(where, own, "height", LEVELS, found.height))
        else:
            rows.append(unmeasured(where, own, "height", LEVELS, _why(room)))
        rows += [conformity(where, own, _walls(walls), test) for walls, test in found.tests]
        for name, face in (("floor", room.floor_face), ("ceiling", room.ceiling_face)):
            rows += [conformity(where, own, (name,), test) for test in (face.flatness if face else ())]
        rows += corner_rows(_bounded(where, own, room, origin))
    for k, wall in enumerate(storey.walls, start=1):
        for number, o in enumerate(wall.openings, start=1):
            where, (start, end, sill, head) = f"{storey.name}, wall {k}, {o.kind} {number}", o.edge_sigma
            own = ids.opening(k - 1, number - 1)
            rows.append(width(where, own, "width", (f"wall {k}",), Estimate(o.width, float(np.hypot(start, end)))))
            rows.append(width(where, own, "height", (f"wall {k}",), Estimate(o.height, float(np.hypot(sill, head)))))
    for k, hole in enumerate(storey.slab_holes, start=1):
        where, own = f"{storey.name}, floor opening {k}", ids.slab_openings[k - 1] if ids.slab_openings else ""
        for n, what in enumerate(("length", "width")):
            if hole.size is None:
                rows.append(unmeasured(where, own, what, ("slab",), "It is no rectangle."))
            else:
                rows.append(width(where, own, what, ("slab",), Estimate(hole.size[n], hole.size_sigma[n])))
    return rows


def _why(room: BuiltRoom) -> str:
    """Why a room's height was not measured."""
    faces = (("floor", room.floor_face), ("ceiling", room.ceiling_face))
    missing = " and ".join(name for name, face in faces if face is None)
    if room.height_source == ASSUMED:
        return "No ceiling was seen in the storey: the height is assumed, from what was seen highest or the next floor."
    return f"Too little was seen of its {missing} in one level."


def _bounded(where: str, global_id: str, room: BuiltRoom, origin: Array) -> Room:
    walls = [
        Bound(f"wall {f.wall + 1}", f.face.plane, f.face.unevenness, f.ends) for f in room.wall_faces
    ]
    floor, ceiling = (
        None if face is None else Bound(name, face.plane, face.unevenness)
        for name, face in (("floor", room.floor_face), ("ceiling", room.ceiling_face))
    )
    return Room(where, global_id, room.outline, walls, floor, ceiling, origin)


def _walls(rows: Sequence[int]) -> tuple[str, ...]:
    return tuple(f"wall {k + 1}" for k in rows)


def _length(sides: Array) -> float:
    return float(np.linalg.norm(sides[:, 1] - sides[:, 0], axis=1).sum())


def _between(first: Plane, first_sides: Array, second: Plane, second_sides: Array) -> Array | None:
    """(2,) the middle of where two faces look at each other, at the longest such stretch; None where they do not."""
    along = np.array([-first.normal[1], first.normal[0]])
    best, most = None, LEAST_OVERLAP_M
    for a in first_sides:
        for b in second_sides:
            if (b - a[0]).mean(axis=0) @ first.normal[:2] <= 0.0 or (a - b[0]).mean(axis=0) @ second.normal[:2] <= 0.0:
                continue
            low = max((a @ along).min(), (b @ along).min())
            high = min((a @ along).max(), (b @ along).max())
            if high - low > most:
                across = 0.5 * float((a.mean(axis=0) + b.mean(axis=0)) @ first.normal[:2])
                best, most = 0.5 * (low + high) * along + across * first.normal[:2], high - low
    return best


def dimensions_to_json(found: RoomDimensions) -> dict[str, Any]:
    """Plain values, metres; walls by number from 1."""
    return {
        "widths": [
            {"walls": _numbers(w.walls), "width": w.distance.value, "sigma": w.distance.sigma,
             "interval_95": list(w.distance.interval), "loa": w.level}
            for w in found.widths
        ],
        "height": None if found.height is None else {
            "height": found.height.value, "sigma": found.height.sigma, "interval_95": list(found.height.interval),
            "loa": level_of_accuracy(found.height.sigma),
        },
        "tests": [
            {"test": t.name, "walls": _numbers(walls), "offset": t.value, "sigma": t.sigma, "p_value": t.p_value,
             "limit": t.limit, "p_limit": t.p_limit, "exceeds": t.exceeds, "keeps": t.keeps}
            for walls, t in found.tests
        ],
    }  # fmt: skip


def _numbers(walls: Sequence[int]) -> list[int]:
    return [k + 1 for k in walls]
