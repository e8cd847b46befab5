"""A building of boxes and scans of it, made in memory: for checks and benchmarks that need to know the truth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..model.elements import BuildingModel, Element
from ..model.raycast import RayScene
from ..scans.campaign import DropCount, ReturnBlock, Station

Array = NDArray[np.float64]

_CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=np.float64)
_FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
     [1, 5, 7], [1, 7, 3]],
    dtype=np.int32,
)  # fmt: skip


@dataclass(frozen=True)
class Box:
    """One element: an axis-parallel box, turned about the vertical through the origin of the building."""

    name: str
    low: Array
    """(3,) metres"""
    high: Array
    """(3,) metres"""
    shift: Array = field(default_factory=lambda: np.zeros(3))
    """(3,) metres: how far it is built from its planned place, along the axes of the box."""

    def moved(self, shift: Array) -> Box:
        """The same box, built ``shift`` further off."""
        return replace(self, shift=self.shift + shift)

    @property
    def thin_axis(self) -> int:
        """The axis along which the box is thinnest: the normal of a wall or slab."""
        return int(np.argmin(self.high - self.low))


def box(name: str, low: Sequence[float], high: Sequence[float]) -> Box:
    """A box from two corners [m]."""
    return Box(name, np.array(low, dtype=np.float64), np.array(high, dtype=np.float64))


def building_model(
    boxes: Sequence[Box], *, turn: float = 0.0, origin: Sequence[float] = (0.0, 0.0, 0.0)
) -> BuildingModel:
    """The boxes as a model; ``turn`` [rad] about the vertical, ``origin`` (3,) [m] of the local frame in the model
    frame."""
    c, s = np.cos(turn), np.sin(turn)
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    corners = np.concatenate([b.low + _CORNERS * (b.high - b.low) + b.shift for b in boxes])
    count = len(boxes)
    return BuildingModel(
        path="boxes",
        content_hash="",
        schema="IFC4",
        length_unit_m=1.0,
        origin=np.array(origin, dtype=np.float64),
        elements=tuple(Element(f"box{i:018d}", i, "IfcBuildingElementProxy", b.name, "") for i, b in enumerate(boxes)),
        vertices=corners @ rotation.T,
        triangles=(_FACES[None] + 8 * np.arange(count, dtype=np.int32)[:, None, None]).reshape(-1, 3),
        triangle_element=np.repeat(np.arange(count, dtype=np.int32), len(_FACES)),
        closed=np.ones(count, dtype=np.bool_),
        transparent=np.zeros(count * len(_FACES), dtype=np.bool_),
    )


def four_rooms() -> list[Box]:
    """A storey of 12 m x 9 m: four rooms off each other through doors, slabs, walls, columns and furniture."""
    wall, height = 0.15, 2.7
    out: list[Box] = []
    rooms = [(0.0, 0.0, 7.0, 4.0), (7.15, 0.0, 12.0, 4.0), (0.0, 4.15, 5.0, 9.0), (5.15, 4.15, 12.0, 9.0)]
    for i, (x0, y0, x1, y1) in enumerate(rooms):
        out.append(box(f"floor {i}", (x0 - 0.07, y0 - 0.07, -0.25), (x1 + 0.07, y1 + 0.07, 0.0)))
        out.append(box(f"ceiling {i}", (x0 - 0.07, y0 - 0.07, height), (x1 + 0.07, y1 + 0.07, height + 0.2)))
        out.append(box(f"cabinet {i}", (x0 + 0.05, y1 - 1.6, 0.0), (x0 + 0.5, y1 - 0.4, 1.1 + 0.3 * i)))
        out.append(box(f"table {i}", (x1 - 2.2, y0 + 1.1, 0.7), (x1 - 0.9, y0 + 1.9, 0.74)))
        out.append(box(f"column {i}", (x1 - 0.9, y1 - 0.8, 0.0), (x1 - 0.6, y1 - 0.5, height)))
        out.append(box(f"beam {i}", (x0 + 1.2, y0, height - 0.35), (x0 + 1.4, y1, height)))
    for name, x0, x1, y0, y1 in (("south", -wall, 12.15, -wall, 0.0), ("north", -wall, 12.15, 9.0, 9.15)):
        out += [
            box(f"{name} wall {k}", (a, y0, 0.0), (b, y1, height)) for k, (a, b) in enumerate(_thirds(x0, x1))
        ]
    for name, x0, x1 in (("west", -wall, 0.0), ("east", 12.0, 12.15)):
        out += [box(f"{name} wall {k}", (x0, a, 0.0), (x1, b, height)) for k, (a, b) in enumerate(_thirds(0.0, 9.0))]
    out += _wall_with_door("partition south", 0, 7.0, 0.0, 4.0, 1.2, wall, height)
    out += _wall_with_door("partition north", 0, 5.0, 4.15, 9.0, 5.6, wall, height)
    out += _wall_with_door("spine west", 1, 4.0, 0.0, 5.0, 2.9, wall, height)
    out += _wall_with_door("spine east", 1, 4.0, 5.0, 12.0, 9.2, wall, height)
    return out


def four_room_stations() -> Array:
    """(5, 3) scanner positions in ``four_rooms``, metres."""
    return np.array([[3.1, 1.9, 1.5], [9.3, 2.6, 1.6], [2.4, 6.3, 1.4], [8.6, 6.6, 1.55], [6.2, 2.9, 1.7]])


def corridor(*, ends: bool) -> list[Box]:
    """A plain corridor 30 m long along x; without its end walls nothing fixes a shift along it."""
    out = [
        box("floor", (0, 0, -0.2), (30, 2.4, 0)),
        box("ceiling", (0, 0, 2.6), (30, 2.4, 2.8)),
        box("left wall", (0, 2.4, -0.2), (30, 2.6, 2.8)),
        box("right wall", (0, -0.2, -0.2), (30, 0, 2.8)),
    ]
    if ends:
        out += [box("west end", (-0.2, 0, 0), (0, 2.4, 2.6)), box("east end", (30, 0, 0), (30.2, 2.4, 2.6))]
    return out


def _thirds(low: float, high: float) -> list[tuple[float, float]]:
    edges = np.linspace(low, high, 4)
    return list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))


def _wall_with_door(
    name: str, normal_axis: int, at: float, start: float, end: float, door: float, wall: float, height: float
) -> list[Box]:
    """A partition with a door of 0.95 m x 2.1 m: a piece on each side and a lintel."""
    pieces = [
        (f"{name} a", start, door, 0.0, height),
        (f"{name} b", door + 0.95, end, 0.0, height),
        (f"{name} lintel", door, door + 0.95, 2.1, height),
    ]
    out = []
    for label, a, b, z0, z1 in pieces:
        low, high = [a, a, z0], [b, b, z1]
        low[normal_axis], high[normal_axis] = at, at + wall
        out.append(box(label, low, high))
    return out


@dataclass
class ArraySource:
    """A scan source of arrays in memory."""

    stations: tuple[Station, ...]
    offsets: tuple[Array, ...]
    """Per station (N, 3) returns minus station position, metres."""
    paths: tuple[str, ...] = ("memory",)
    dropped: DropCount = field(default_factory=DropCount)

    @property
    def point_count(self) -> int:
        return sum(len(o) for o in self.offsets)

    def blocks(self, block_size: int = 262_144, *, attributes: bool = False) -> Iterator[ReturnBlock]:
        """Stream the returns station by station."""
        for station, offsets in enumerate(self.offsets):
            for begin in range(0, len(offsets), block_size):
                yield ReturnBlock(station, offsets[begin : begin + block_size])


def scan(
    built: BuildingModel, stations: Array, *, step_deg: float = 0.5, noise: float = 0.002, seed: int = 0
) -> ArraySource:
    """A levelled scanner at each of ``stations`` (S, 3) [m, local frame]; normal range ``noise`` [m] along the ray.

    Directions are a regular grid of ``step_deg``, from 60 degrees below the horizon to the zenith. The source's
    frame is the local frame of ``built``.
    """
    scene = RayScene(built)
    rng = np.random.default_rng(seed)
    azimuth, elevation = np.meshgrid(
        np.radians(np.arange(0.0, 360.0, step_deg)), np.radians(np.arange(-60.0, 90.0, step_deg)), indexing="ij"
    )
    ray = np.stack(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=-1
    ).reshape(-1, 3)
    offsets = []
    for position in stations:
        distance, triangle = scene.first_hit(np.broadcast_to(position, ray.shape), ray)
        hit = triangle >= 0
        offsets.append(ray[hit] * (distance[hit] + rng.normal(0.0, noise, int(hit.sum())))[:, None])
    return ArraySource(tuple(Station(f"S{i}", p) for i, p in enumerate(stations)), tuple(offsets))


def build_inaccurately(
    planned: Sequence[Box], *, moved_share: float, largest_move: float, deviation: float, seed: int
) -> tuple[list[Box], NDArray[np.int64]]:
    """The building as built: every element off by normal ``deviation`` [m] per axis, some moved further.

    A share of the elements is moved along its thin axis by 2 cm to ``largest_move`` [m], either way. Returns the boxes
    and the rows of those moved.
    """
    rng = np.random.default_rng(seed)
    moved = np.sort(rng.choice(len(planned), round(moved_share * len(planned)), replace=False))
    built = [b.moved(rng.normal(0.0, 1.0, 3) * deviation) for b in planned]
    for i in moved:
        shift = np.zeros(3)
        shift[planned[i].thin_axis] = rng.uniform(0.02, largest_move) * rng.choice([-1.0, 1.0])
        built[i] = built[i].moved(shift)
    return built, moved
