"""Facades to a building of walls and openings, and its IFC4 file with types and the uncertainty of the scale."""

from __future__ import annotations

import math
import uuid
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon

from ... import __version__
from ..files import whole_file
from ..reconstruction.building import ASSUMED, BuiltSlab, BuiltStorey, BuiltWall, FitRecord, Reconstruction
from ..reconstruction.openings import Opening
from ..reconstruction.write_ifc import LEAF_M, NAMESPACE, THROUGH_M, TIME_STAMP, building_file
from .classify import group_types
from .footprint import MapPlace
from .grammar import grammar_of
from .records import Facade, FacadeBox

Array = NDArray[np.float64]
PSET_NAME = "BimVerify_Facade"
THICKNESS_M, SLAB_M = 0.30, 0.20
"""Of walls and slabs: a photo shows none."""
LEAST_M = 0.1
ARCH_STEPS = 16
SIZE_SIGMA_M = (0.10, 0.14)
"""Of widths and heights, whose edges may be those of a frame, a sill or a surround: 19 of 20 lie within 1.96 times it."""


@dataclass
class Mockup:
    """The building that the facades make; ``facades[k]`` is on the wall ``edges[k]``."""

    facades: list[Facade]
    building: Reconstruction
    filled: dict[tuple[str, str], tuple[Facade, FacadeBox]]
    """(storey, number of the wall and of its opening) to what was found."""
    walls: dict[str, Facade]
    """Name of a wall, the same on all storeys, to the facade on it."""
    footprint: Array | None = None
    """(N, 2) outer corners, counter-clockwise from above; None: one wall along x from the origin."""
    place: MapPlace | None = None
    """Where the model's zero lies on the map, if that is known."""

    def base(self, index: int) -> tuple[Array, Array]:
        """Left lower end (2,) of a facade seen from outside, and the unit vector (2,) along it."""
        return wall_base(self.footprint, index)


def wall_base(footprint: Array | None, index: int) -> tuple[Array, Array]:
    """Left lower end (2,) of a wall seen from outside, and the unit vector (2,) along it; see ``Mockup.footprint``."""
    if footprint is None:
        return np.zeros(2), np.array([1.0, 0.0])
    a, b = footprint[index], footprint[(index + 1) % len(footprint)]
    return a, (b - a) / np.linalg.norm(b - a)


def mockup(
    facades: list[Facade], footprint: Array | None = None, place: MapPlace | None = None, thickness: float = THICKNESS_M
) -> Mockup:
    """Walls of all edges of the footprint, the first of them with the facades; a single wall where there is none."""
    facades = alike(facades)
    if footprint is None:
        corners = np.array([[0.0, 0.0], [facades[0].scale.width, 0.0]])
        edges, inner = 1, corners + np.array([0.0, thickness])
        outline = None
    else:
        corners, edges, outline = footprint, len(footprint), Polygon(footprint)
        inner = _inside(outline, thickness)
    leading = max(facades, key=lambda f: (len(f.levels), len(f.boxes)))
    height = float(np.median([f.scale.height for f in facades]))
    levels = [v for v in leading.levels if v < height - LEAST_M] or [0.0]
    tops = [*levels[1:], height]
    storeys, filled = [], {}
    for number, (base, top) in enumerate(zip(levels, tops, strict=True)):
        name = f"Storey {number}"
        walls = []
        for k in range(edges):
            own = facades[k] if k < len(facades) else None
            a, b = corners[k], corners[(k + 1) % len(corners)]
            ring = Polygon([a, b, inner[(k + 1) % len(corners)], inner[k]])
            upper = own.scale.height if own is not None and number == len(levels) - 1 and own.scale.height > base + 1 else top
            length = float(np.linalg.norm(b - a))
            openings = []
            for box in own.boxes if own else ():
                middle = 0.5 * (box.z0 + box.z1)
                if not (base <= middle < top or (number == len(levels) - 1 and middle >= top)):
                    continue
                # what a person corrected, or a footprint that is longer, moves no opening beyond its wall
                u0, u1, z0, z1 = max(box.x0, 0.0), min(box.x1, length), max(box.z0, base), min(box.z1, upper)
                if u1 - u0 < LEAST_M or z1 - z0 < LEAST_M:
                    continue
                openings.append(Opening(u0, u1, z0, z1, box.kind, True, 0.0 if box.inferred else 1.0))
                assert own is not None
                clipped = replace(box, x0=u0, x1=u1, z0=z0, z1=z1, rise=min(box.rise, z1 - z0 - LEAST_M, (u1 - u0) / 2))
                filled[name, f"{k + 1}.{len(openings)}"] = (own, clipped)
            along = (b - a) / length
            inward = np.array([-along[1], along[0]])
            middle_line = 0.5 * thickness * inward
            sigma = None if own is None else own.scale.relative_sigma * length
            fit = FitRecord(None, None, 1.0 if own else 0.0, sigma, ASSUMED)
            walls.append(BuiltWall(
                a + middle_line, b + middle_line, thickness, ring, base, upper, tuple(openings), (None, None), (), True, fit,
            ))  # fmt: skip
        slabs = []
        if outline is not None:
            fit = FitRecord(None, None, 0.0, None, ASSUMED)
            inside = Polygon(inner)
            slabs.append(BuiltSlab(inside, base, SLAB_M, "FLOOR" if number else "BASESLAB", fit))
            if number == len(levels) - 1:
                slabs.append(BuiltSlab(inside, top, SLAB_M, "ROOF", fit))
        storeys.append(BuiltStorey(name, base, top, tuple(walls), (), tuple(slabs), ()))
    building = Reconstruction(np.zeros(3), tuple(storeys), 0, 0, tuple(f.image for f in facades))
    walls_of = {f"Wall {k + 1}": f for k, f in enumerate(facades[:edges])}
    return Mockup(facades, building, filled, walls_of, footprint, place)


def alike(facades: list[Facade]) -> list[Facade]:
    """The same facades with types numbered over all of them."""
    boxes = [b for f in facades for b in f.boxes]
    numbers = iter(group_types(boxes))
    return [replace(f, boxes=tuple(replace(b, type=next(numbers)) for b in f.boxes)) for f in facades]


def _inside(outline: Polygon, thickness: float) -> Array:
    """The inner corners, one for each of the outer ones."""
    ring = np.array(outline.exterior.coords)[:-1]
    before, after = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    a = before / np.linalg.norm(before, axis=1, keepdims=True)
    b = after / np.linalg.norm(after, axis=1, keepdims=True)
    na, nb = np.column_stack([-a[:, 1], a[:, 0]]), np.column_stack([-b[:, 1], b[:, 0]])
    both = na + nb
    return np.asarray(ring + thickness * both / np.maximum((both * nb).sum(axis=1, keepdims=True), 0.2))


def write_mockup(path: str | Path, made: Mockup, name: str = "") -> None:
    """Write the IFC4 file. Raises BimVerifyError when the place cannot be written."""
    file = mockup_file(made)
    with whole_file(path) as temporary:
        file.header.file_name.name = name or Path(path).name
        file.header.file_name.time_stamp = TIME_STAMP
        file.write(str(temporary))


def mockup_file(made: Mockup) -> Any:
    """The ``ifcopenshell.file`` in memory."""
    file = building_file(made.building)
    _Enrich(file, made).run()
    return file


class _Enrich:
    """Adds what a photo says and a scan does not: types, shapes of arches, where the scale is from."""

    def __init__(self, file: Any, made: Mockup) -> None:
        self.file, self.made, self.count = file, made, 0

    def run(self) -> None:
        f, made = self.file, self.made
        f.by_type("IfcProject")[0].Name = "Facade mock-up"
        f.by_type("IfcBuilding")[0].Name = "Mock-up building"
        members: dict[int, list[Any]] = {}
        for filling in [*f.by_type("IfcWindow"), *f.by_type("IfcDoor")]:
            storey = filling.ContainedInStructure[0].RelatingStructure.Name
            owner, box = made.filled[storey, filling.Name.split("Wall ")[1]]
            members.setdefault(box.type, []).append(filling)
            self._set(filling, {
                "Shape": ("IfcLabel", "ARCHED" if box.rise > 0 else "RECTANGULAR"),
                "WidthSigma": ("IfcLengthMeasure", size_sigma(owner, box.width, 0)),
                "HeightSigma": ("IfcLengthMeasure", size_sigma(owner, box.height, 1)),
                "Inferred": ("IfcBoolean", box.inferred),
            })  # fmt: skip
            if box.rise > 0:
                self._arch(filling, box)
        for number, group in sorted(members.items()):
            self._type(number, group)
        if made.place is not None:
            self._on_map(made.place)
        grammars = {name: grammar_of(facade).text() for name, facade in made.walls.items()}
        for wall in f.by_type("IfcWall"):
            if (facade := made.walls.get(wall.Name)) is not None:
                scale = facade.scale
                self._set(wall, {
                    "Image": ("IfcLabel", Path(facade.image).name), "ScaleSource": ("IfcLabel", scale.source),
                    "CornerSource": ("IfcLabel", facade.corner_source),
                    "ScaleSigma": ("IfcNormalisedRatioMeasure", min(scale.relative_sigma, 1.0)),
                    "AspectSigma": ("IfcNormalisedRatioMeasure", min(scale.aspect_sigma, 1.0)),
                    "FacadeWidth": ("IfcLengthMeasure", scale.width), "FacadeHeight": ("IfcLengthMeasure", scale.height),
                    "Arrangement": ("IfcLabel", f"x {facade.arrangement_x}, z {facade.arrangement_z}"),
                    "Grammar": ("IfcText", grammars[wall.Name]),
                    "Method": ("IfcLabel", f"bim_verify {__version__}"),
                })  # fmt: skip

    def _on_map(self, place: MapPlace) -> None:
        f = self.file
        (model,) = (
            c for c in f.by_type("IfcGeometricRepresentationContext", include_subtypes=False) if c.ContextType == "Model"
        )
        f.create_entity(
            "IfcMapConversion", SourceCRS=model, TargetCRS=f.create_entity("IfcProjectedCRS", Name=place.crs),
            Eastings=place.easting, Northings=place.northing, OrthogonalHeight=0.0, XAxisAbscissa=1.0, XAxisOrdinate=0.0,
            Scale=1.0,
        )  # fmt: skip

    def _id(self) -> str:
        import ifcopenshell.guid

        self.count += 1
        return str(
            ifcopenshell.guid.compress(uuid.uuid5(NAMESPACE, f"facade {self.count} {self.made.building.scan_paths}").hex)
        )

    def _type(self, number: int, members: list[Any]) -> None:
        f, first = self.file, members[0]
        door = first.is_a("IfcDoor")
        wide, high = (float(np.median([getattr(m, n) for m in members])) for n in ("OverallWidth", "OverallHeight"))
        name = f"{'Door' if door else 'Window'} type {number + 1}: {wide:.2f} x {high:.2f} m"
        if door:
            made = f.create_entity(
                "IfcDoorType", GlobalId=self._id(), Name=name, PredefinedType="DOOR", OperationType="NOTDEFINED"
            )
        else:
            made = f.create_entity(
                "IfcWindowType", GlobalId=self._id(), Name=name, PredefinedType="WINDOW", PartitioningType="NOTDEFINED"
            )
        f.create_entity("IfcRelDefinesByType", GlobalId=self._id(), RelatedObjects=members, RelatingType=made)

    def _set(self, product: Any, values: dict[str, tuple[str, Any]]) -> None:
        f = self.file
        rows = [f.create_entity("IfcPropertySingleValue", k, None, f.create_entity(t, v), None) for k, (t, v) in values.items()]
        made = f.create_entity("IfcPropertySet", GlobalId=self._id(), Name=PSET_NAME, HasProperties=rows)
        f.create_entity(
            "IfcRelDefinesByProperties", GlobalId=self._id(), RelatedObjects=[product], RelatingPropertyDefinition=made
        )

    def _arch(self, filling: Any, box: FacadeBox) -> None:
        """The hole and what fills it as outlines drawn on the wall, pushed through it."""
        hole = filling.FillsVoids[0].RelatingOpeningElement
        deep = THICKNESS_M + 2 * THROUGH_M
        outline = arch_outline(box.width, box.height, box.rise)
        for product, thick in ((hole, deep), (filling, LEAF_M)):
            for shape in product.Representation.Representations:
                shape.Items = [self._through(outline, thick)]

    def _through(self, outline: list[tuple[float, float]], deep: float) -> Any:
        f = self.file
        points = [f.create_entity("IfcCartesianPoint", (float(x), float(z))) for x, z in outline]
        line = f.create_entity("IfcPolyline", [*points, points[0]])
        profile = f.create_entity("IfcArbitraryClosedProfileDef", "AREA", None, line)
        place = f.create_entity(
            "IfcAxis2Placement3D",
            f.create_entity("IfcCartesianPoint", (0.0, float(deep), 0.0)),
            f.create_entity("IfcDirection", (0.0, -1.0, 0.0)),
            f.create_entity("IfcDirection", (1.0, 0.0, 0.0)),
        )
        return f.create_entity(
            "IfcExtrudedAreaSolid", profile, place, f.create_entity("IfcDirection", (0.0, 0.0, 1.0)), float(deep)
        )


def arch_outline(width: float, height: float, rise: float) -> list[tuple[float, float]]:
    """An arched opening from its left lower corner, counter-clockwise; metres."""
    radius = (width * width / 4 + rise * rise) / (2 * rise)
    half = math.atan2(width / 2, radius - rise)
    turns = np.linspace(half, -half, ARCH_STEPS)
    top = [(width / 2 + radius * math.sin(a), height - radius + radius * math.cos(a)) for a in turns]
    return [(0.0, 0.0), (width, 0.0), *top]


def size_sigma(facade: Facade, length: float, axis: int) -> float:
    """Of a width (axis 0) or a height (1) [m]: its two edges, a pixel each and what they may be mistaken for, and the scale."""
    edges = math.hypot(math.sqrt(2.0) / facade.pixels_per_metre[axis], SIZE_SIGMA_M[axis])
    share = math.hypot(
        facade.scale.relative_sigma, facade.scale.aspect_sigma if axis != (facade.scale.source == "HEIGHT") else 0.0
    )
    return math.hypot(edges, share * length)
