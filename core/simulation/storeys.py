"""Buildings of several rooms as IFC files, with furniture, for the benchmarks of reconstruction. Plans in metres."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon, union_all

from .house_builder import HouseBuilder, Solid, prism

XY = tuple[float, float]
Filling = Literal["closed", "ajar", "none", "window"]


@dataclass(frozen=True)
class PlannedOpening:
    """A hole in a wall: ``at`` metres from the wall's start to the hole's middle."""

    at: float
    width: float
    sill: float
    height: float
    filling: Filling
    depth: float = 0.0
    """Above 0: a recess so deep into the wall's left side."""


@dataclass(frozen=True)
class PlannedWall:
    """A wall between two points of its reference line; ``left`` and ``right`` are its extents across it [m]."""

    name: str
    start: XY
    end: XY
    left: float
    right: float
    openings: tuple[PlannedOpening, ...] = ()
    corners: tuple[XY, XY, XY, XY] | None = None
    """The footprint where it is mitred; else the rectangle along the line."""

    @property
    def along(self) -> NDArray[np.float64]:
        """(2,) unit vector."""
        step = np.subtract(self.end, self.start)
        return np.asarray(step / np.linalg.norm(step))

    def point(self, u: float, across: float) -> XY:
        """Place ``u`` metres along and ``across`` metres to the left of the reference line."""
        a = self.along
        x, y = np.asarray(self.start) + u * a + across * np.array([-a[1], a[0]])
        return float(x), float(y)

    def outline(self, u0: float, u1: float, grow: float = 0.0) -> list[XY]:
        """Corners of the wall's plan between two places along it, ``grow`` metres thicker on both sides."""
        left, right = self.left + grow, -self.right - grow
        return [self.point(u0, right), self.point(u1, right), self.point(u1, left), self.point(u0, left)]


@dataclass(frozen=True)
class Furniture:
    """A box that stands (or hangs) in a room: middle, size and turn."""

    name: str
    middle: XY
    size: tuple[float, float, float]
    bottom: float = 0.0
    turn_deg: float = 0.0


@dataclass(frozen=True)
class PlannedStorey:
    """One storey: rooms by their outlines, walls, columns, furniture, and scanner positions above its floor."""

    name: str
    height: float
    """Clear height, metres."""
    outline: tuple[XY, ...]
    """Inner face of the outer walls, counter-clockwise."""
    outer_thickness: float
    outer_openings: dict[int, tuple[PlannedOpening, ...]] = field(default_factory=dict)
    """Edge of the outline -> its openings."""
    walls: tuple[PlannedWall, ...] = ()
    rooms: tuple[tuple[XY, ...], ...] = ()
    columns: tuple[tuple[float, float, float, float], ...] = ()
    """x, y, width, depth."""
    furniture: tuple[Furniture, ...] = ()
    stations: tuple[tuple[float, float, float], ...] = ()
    slab: float = 0.25

    def outer_walls(self) -> list[PlannedWall]:
        """Mitred walls around the outline; their left side is the room's."""
        points = [np.array(p) for p in self.outline]
        n = len(points)
        outer = [_offset_corner(points[i - 1], points[i], points[(i + 1) % n], self.outer_thickness) for i in range(n)]
        out = []
        for i in range(n):
            j = (i + 1) % n
            corners = tuple((float(p[0]), float(p[1])) for p in (outer[i], outer[j], points[j], points[i]))
            out.append(
                PlannedWall(
                    f"Outer wall {i + 1}", self.outline[i], self.outline[j], 0.0, self.outer_thickness,
                    self.outer_openings.get(i, ()), corners,  # type: ignore[arg-type]
                )
            )
        return out

    def footprint(self) -> list[XY]:
        """Corners of the outer face."""
        return [w.corners[0] for w in self.outer_walls() if w.corners]


def write_building(path: str | Path, storeys: Sequence[PlannedStorey], *, turn_deg: float = 0.0, shift: XY = (0, 0),
                   elevation: float = 0.0, furniture: bool = True) -> NDArray[np.float64]:
    """Write the building turned about the vertical and shifted [m]; gives the scanner positions (S, 3) [m, model frame].

    Without ``furniture`` the file is the truth that a reconstruction is compared with.
    """
    c, s = math.cos(math.radians(turn_deg)), math.sin(math.radians(turn_deg))

    def to_mm(points: Sequence[XY]) -> list[XY]:
        return [(1000 * (c * x - s * y + shift[0]), 1000 * (s * x + c * y + shift[1])) for x, y in points]

    builder = HouseBuilder("IFC4")
    stations = []
    level = elevation
    for k, storey in enumerate(storeys):
        above = storeys[k + 1].footprint() if k + 1 < len(storeys) else []
        maker = _StoreyMaker(builder, builder.storey(storey.name, 1000 * level), level, storey, to_mm)
        maker.build(furniture, above)
        if k == 0:
            maker.slab("Floor", storey.footprint(), -storey.slab, "FLOOR")
        for x, y, z in storey.stations:
            (px, py), = to_mm([(x, y)])
            stations.append((px / 1000, py / 1000, level + z))
        level += storey.height + storey.slab
    builder.write(path)
    return np.array(stations)


@dataclass
class _StoreyMaker:
    builder: HouseBuilder
    container: Any
    level: float
    storey: PlannedStorey
    to_mm: Any

    def slab(self, name: str, outline: Sequence[XY], bottom: float, predefined: str) -> None:
        """A slab ``bottom`` metres above the floor."""
        self._solid("IfcSlab", name, outline, bottom, self.storey.slab, "concrete", predefined=predefined)

    def build(self, furniture: bool, above: Sequence[XY]) -> None:
        """All but the floor. ``above`` is the footprint of the storey that stands on this one's ceiling."""
        s = self.storey
        whole = union_all([Polygon(s.footprint()), Polygon(above)]).normalize()
        assert isinstance(whole, Polygon), "a storey must stand on the one below"
        self.slab("Ceiling", list(whole.reverse().exterior.coords)[:-1], s.height, "FLOOR" if above else "ROOF")
        for wall in (*s.outer_walls(), *s.walls):
            self._wall(wall)
        for k, (x, y, w, d) in enumerate(s.columns):
            corners = [(x, y), (x + w, y), (x + w, y + d), (x, y + d)]
            self._solid("IfcColumn", f"Column {k + 1}", corners, 0.0, s.height, "concrete")
        for k, room in enumerate(s.rooms):
            self._space(f"Room {k + 1}", room)
        for item in s.furniture if furniture else ():
            c, t = math.cos(math.radians(item.turn_deg)), math.sin(math.radians(item.turn_deg))
            half = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
            corners = [
                (item.middle[0] + c * a * item.size[0] / 2 - t * b * item.size[1] / 2,
                 item.middle[1] + t * a * item.size[0] / 2 + c * b * item.size[1] / 2)
                for a, b in half
            ]
            self._solid("IfcFurniture", item.name, corners, item.bottom, item.size[2], "timber")

    def _prism(self, outline: Sequence[XY], bottom: float, height: float, style: str) -> Solid:
        return prism(self.to_mm(outline), "z", 1000 * (self.level + bottom), 1000 * height, style)

    def _solid(
        self, ifc_class: str, name: str, outline: Sequence[XY], bottom: float, height: float, style: str,
        predefined: str | None = None,
    ) -> Any:
        return self.builder.add(
            ifc_class, name, [self._prism(outline, bottom, height, style)], self.container, predefined=predefined
        )

    def _space(self, name: str, outline: Sequence[XY]) -> None:
        import ifcopenshell.api.aggregate
        import ifcopenshell.api.root

        space = ifcopenshell.api.root.create_entity(self.builder.file, "IfcSpace", name=name)
        ifcopenshell.api.aggregate.assign_object(self.builder.file, products=[space], relating_object=self.container)
        solid = self._prism(outline, 0.0, self.storey.height, "white")
        self.builder.place(space, self.builder._corner([solid]))
        x, y, z = (-float(v) for v in self.builder._corner([solid])[:3, 3])
        self.builder._give_body(space, [solid.moved(x, y, z)])

    def _wall(self, wall: PlannedWall) -> None:
        length = float(np.linalg.norm(np.subtract(wall.end, wall.start)))
        outline = wall.corners or wall.outline(0.0, length)
        host = self._solid("IfcWall", wall.name, outline, 0.0, self.storey.height, "plaster", predefined="SOLIDWALL")
        for k, o in enumerate(wall.openings):
            filling = self._filling(wall, o, f"{wall.name} {'Window' if o.filling == 'window' else 'Door'} {k + 1}")
            u0, u1, through = o.at - o.width / 2, o.at + o.width / 2, 0.05
            outline = wall.outline(u0, u1, through)
            if o.depth:
                outline = [
                    wall.point(u, wall.left + across) for u, across in
                    ((u0, -o.depth), (u1, -o.depth), (u1, through), (u0, through))
                ]  # fmt: skip
            hole = self._prism(outline, o.sill, o.height, "white")
            self.builder.opening(host, hole, filling)

    def _filling(self, wall: PlannedWall, o: PlannedOpening, name: str) -> Any | None:
        u0, u1 = o.at - o.width / 2, o.at + o.width / 2
        middle = 0.5 * (wall.left - wall.right)

        def bar(a: float, b: float, depth: float, z: float, h: float, style: str) -> Solid:
            low, high = middle - depth / 2, middle + depth / 2
            corners = [wall.point(a, low), wall.point(b, low), wall.point(b, high), wall.point(a, high)]
            return self._prism(corners, z, h, style)

        if o.filling == "none":
            return None
        if o.filling == "window":
            f, top = 0.06, o.sill + o.height
            parts = [
                bar(u0, u0 + f, 0.07, o.sill, o.height, "white"), bar(u1 - f, u1, 0.07, o.sill, o.height, "white"),
                bar(u0 + f, u1 - f, 0.07, o.sill, f, "white"), bar(u0 + f, u1 - f, 0.07, top - f, f, "white"),
                bar(u0 + f, u1 - f, 0.02, o.sill + f, o.height - 2 * f, "glass"),
            ]
            return self.builder.add("IfcWindow", name, parts, self.container)
        f, depth = 0.05, min(0.08, wall.left + wall.right - 0.04)
        parts = [
            bar(u0, u0 + f, depth, 0.0, o.height, "oak"), bar(u1 - f, u1, depth, 0.0, o.height, "oak"),
            bar(u0 + f, u1 - f, depth, o.height - f, f, "oak"),
        ]
        if o.filling == "closed":
            parts.append(bar(u0 + f, u1 - f, min(0.04, depth), 0.01, o.height - f - 0.01, "oak"))
        else:
            hinge = u0 + f
            side = wall.left + 0.01
            leaf = [wall.point(hinge, side), wall.point(hinge + 0.04, side),
                    wall.point(hinge + 0.04, side + o.width - 2 * f), wall.point(hinge, side + o.width - 2 * f)]
            parts.append(self._prism(leaf, 0.01, o.height - f - 0.01, "oak"))
        return self.builder.add("IfcDoor", name, parts, self.container)


def _offset_corner(
    before: NDArray[np.float64], corner: NDArray[np.float64], after: NDArray[np.float64], distance: float
) -> NDArray[np.float64]:
    """The corner of the outline pushed ``distance`` outward (right of counter-clockwise edges), mitred."""
    d0, d1 = corner - before, after - corner
    n0 = np.array([d0[1], -d0[0]]) / np.linalg.norm(d0)
    n1 = np.array([d1[1], -d1[0]]) / np.linalg.norm(d1)
    return np.asarray(np.linalg.solve(np.stack([n0, n1]), [n0 @ corner + distance, n1 @ corner + distance]))
