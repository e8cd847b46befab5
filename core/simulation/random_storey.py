"""Storeys drawn by chance: rooms by repeated division, doors between them, windows, furniture along the walls.

Reconstruction is scored on such plans, because no one has seen them while its methods were made.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .storey_plans import door, window
from .storeys import XY, Furniture, PlannedOpening, PlannedStorey, PlannedWall

NARROWEST_ROOM_M = 2.0
LARGEST_ROOM_M2 = 20.0
FROM_CORNER_M = 0.25
DOOR_CLEAR_M = 0.8
"""Furniture stays this far from the middle of a door's leaf, so that people can pass."""
HALF_THICKNESSES_M = (0.04, 0.05, 0.0575, 0.0875, 0.12)


@dataclass
class _Room:
    x0: float
    y0: float
    x1: float
    y1: float
    doors: list[tuple[float, float, float]] = field(default_factory=list)
    """x, y, width: of the doors in its sides."""
    fixed: bool = False
    """It was found that no wall divides it."""

    @property
    def size(self) -> tuple[float, float]:
        return self.x1 - self.x0, self.y1 - self.y0


def random_storey(seed: int) -> PlannedStorey:
    """A furnished storey; the same seed gives the same one."""
    rng = np.random.default_rng(seed)
    wide, deep = float(rng.uniform(8.5, 14.0)), float(rng.uniform(6.5, 10.0))
    height, thick = float(rng.uniform(2.4, 3.1)), float(rng.uniform(0.24, 0.42))
    rooms = [_Room(0.0, 0.0, wide, deep)]
    walls: list[PlannedWall] = []
    while True:
        large = [r for r in rooms if r.size[0] * r.size[1] > LARGEST_ROOM_M2 and not r.fixed]
        if not large:
            break
        room = max(large, key=lambda r: r.size[0] * r.size[1])
        divided = _divide(room, rng, len(walls))
        if divided is None:
            room.fixed = True
            continue
        rooms.remove(room)
        walls.append(divided[0])
        rooms += divided[1:]
    outline: tuple[XY, ...] = ((0.0, 0.0), (wide, 0.0), (wide, deep), (0.0, deep))
    openings = _outer_openings(rooms, wide, deep, height, rng)
    return PlannedStorey(
        f"Storey {seed}", height, outline, thick, openings, tuple(walls),
        tuple(((r.x0, r.y0), (r.x1, r.y0), (r.x1, r.y1), (r.x0, r.y1)) for r in rooms), (),
        tuple(f for r in rooms for f in _furniture(r, rng)),
        tuple(s for r in rooms for s in _stations(r, rng)),
    )  # fmt: skip


def _divide(room: _Room, rng: np.random.Generator, number: int) -> tuple[PlannedWall, _Room, _Room] | None:
    """A wall with a door across the longer side, clear of the doors that the room already has."""
    upright = room.size[0] >= room.size[1]
    half = float(rng.choice(HALF_THICKNESSES_M))
    low, high = (room.x0, room.x1) if upright else (room.y0, room.y1)
    start, end = (room.y0, room.y1) if upright else (room.x0, room.x1)
    for _ in range(40):
        at = float(rng.uniform(low + NARROWEST_ROOM_M + half, high - NARROWEST_ROOM_M - half)) if (
            high - low > 2 * (NARROWEST_ROOM_M + half)
        ) else None
        if at is None:
            return None
        if any(abs((d[0] if upright else d[1]) - at) < d[2] / 2 + half + 0.15 for d in room.doors):
            continue
        width = float(rng.choice((0.76, 0.885, 1.01)))
        place = float(rng.uniform(start + width / 2 + FROM_CORNER_M, end - width / 2 - FROM_CORNER_M))
        leaf = door(place - start, width, 2.1, rng.choice(("closed", "ajar", "none")))
        if upright:
            ends = (at, start), (at, end)
            one, other = (room.x0, room.y0, at - half, room.y1), (at + half, room.y0, room.x1, room.y1)
        else:
            ends = (start, at), (end, at)
            one, other = (room.x0, room.y0, room.x1, at - half), (room.x0, at + half, room.x1, room.y1)
        new = (at, place, width) if upright else (place, at, width)
        parts = [_Room(*one), _Room(*other)]
        for part in parts:
            part.doors = [
                d for d in (*room.doors, new) if part.x0 - 0.3 < d[0] < part.x1 + 0.3 and part.y0 - 0.3 < d[1] < part.y1 + 0.3
            ]
        return PlannedWall(f"Wall {number + 1}", *ends, half, half, (leaf,)), parts[0], parts[1]
    return None


def _outer_openings(
    rooms: list[_Room], wide: float, deep: float, height: float, rng: np.random.Generator
) -> dict[int, tuple[PlannedOpening, ...]]:
    """A window or two in the outer sides of the rooms, and one front door."""
    out: dict[int, list[PlannedOpening]] = {k: [] for k in range(4)}
    entrance = int(rng.integers(4))
    for room in rooms:
        sides = (
            (0, room.y0 == 0.0, room.x0, room.x1), (1, room.x1 == wide, room.y0, room.y1),
            (2, room.y1 == deep, wide - room.x1, wide - room.x0), (3, room.x0 == 0.0, deep - room.y1, deep - room.y0),
        )
        for side, outer, a, b in sides:
            if not outer or rng.uniform() < 0.25:
                continue
            if side == entrance and not any(o.filling == "closed" for o in out[side]):
                at = float(rng.uniform(a + 0.8, b - 0.8))
                out[side].append(door(at, 1.01, 2.1, "closed"))
                place = ((at, 0.0), (wide, at), (wide - at, deep), (0.0, deep - at))[side]
                room.doors.append((*place, 1.01))
                continue
            width = float(min(rng.uniform(0.7, 2.0), b - a - 2 * FROM_CORNER_M))
            sill = float(rng.uniform(0.4, 1.1))
            at = float(rng.uniform(a + FROM_CORNER_M + width / 2, b - FROM_CORNER_M - width / 2))
            out[side].append(window(at, width, sill, float(rng.uniform(1.0, height - sill - 0.2))))
    return {side: tuple(items) for side, items in out.items()}


def _furniture(room: _Room, rng: np.random.Generator) -> list[Furniture]:
    """Boxes against the walls and one in the room, clear of its doors."""
    out: list[Furniture] = []
    for _ in range(int(rng.integers(2, 5))):
        long, depth, tall = float(rng.uniform(0.6, 1.8)), float(rng.uniform(0.3, 0.7)), float(rng.uniform(0.5, 2.1))
        side = int(rng.integers(4))
        size = (long, depth) if side in (0, 2) else (depth, long)
        x = float(rng.uniform(room.x0 + size[0] / 2 + 0.05, room.x1 - size[0] / 2 - 0.05))
        y = float(rng.uniform(room.y0 + size[1] / 2 + 0.05, room.y1 - size[1] / 2 - 0.05))
        if side in (0, 2):
            y = room.y0 + depth / 2 + 0.02 if side == 0 else room.y1 - depth / 2 - 0.02
        else:
            x = room.x0 + depth / 2 + 0.02 if side == 3 else room.x1 - depth / 2 - 0.02
        boxes = [(f.middle, f.size) for f in out]
        clear = all(
            max(abs(x - dx) - size[0] / 2, abs(y - dy) - size[1] / 2) > DOOR_CLEAR_M for dx, dy, _ in room.doors
        ) and all(abs(x - m[0]) > (size[0] + s[0]) / 2 or abs(y - m[1]) > (size[1] + s[1]) / 2 for m, s in boxes)
        if clear:
            out.append(Furniture("Cupboard" if tall > 1.0 else "Table", (x, y), (*size, tall)))
    return out


def _stations(room: _Room, rng: np.random.Generator) -> list[tuple[float, float, float]]:
    """One near the middle, two in a long room."""
    w, d = room.size
    count = 2 if max(w, d) > 6.0 else 1
    shares = (0.5,) if count == 1 else (0.27, 0.73)
    out = []
    for share in shares:
        x = room.x0 + w * (share if w >= d else 0.5) + float(rng.uniform(-0.2, 0.2))
        y = room.y0 + d * (share if d > w else 0.5) + float(rng.uniform(-0.2, 0.2))
        out.append((x, y, float(rng.uniform(1.45, 1.7))))
    return out
