"""Makes IFC products out of extruded shapes, for the built-in demo house. Lengths in millimetres, as in the file."""

from __future__ import annotations

import math
import uuid
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ..errors import BimVerifyError
from ..files import whole_file

Axis = Literal["x", "y", "z"]
Point = tuple[float, float]
Place = tuple[float, float, float]
Matrix = Any
"""(4, 4) placement."""

NAMESPACE = uuid.UUID("6ba7b814-9dad-11d1-80b4-00c04fd430c8")
TIME_STAMP = "2024-03-01T12:00:00"
"""Fixed, so that the house is the same file every time."""

SCHEMAS = ("IFC2X3", "IFC4", "IFC4X3")
IFC2X3_CLASSES = {
    "IfcGeographicElement": "IfcBuildingElementProxy",
    "IfcFurniture": "IfcFurnishingElement",
    "IfcDuctSegment": "IfcFlowSegment",
    "IfcDuctFitting": "IfcFlowFitting",
    "IfcAirTerminal": "IfcFlowTerminal",
    "IfcSolarDevice": "IfcEnergyConversionDevice",
    "IfcWindowType": "IfcWindowStyle",
    "IfcDoorType": "IfcDoorStyle",
    "IfcSolarDeviceType": "IfcUnitaryEquipmentType",
}
TYPE_ATTRIBUTES: Mapping[str, Mapping[str, Any]] = {
    "IfcWindowType": {"PartitioningType": "SINGLE_PANEL"},
    "IfcDoorType": {"OperationType": "SINGLE_SWING_LEFT"},
    "IfcWindowStyle": {
        "ConstructionType": "WOOD", "OperationType": "SINGLE_PANEL", "ParameterTakesPrecedence": False,
        "Sizeable": False,
    },
    "IfcDoorStyle": {
        "ConstructionType": "WOOD", "OperationType": "SINGLE_SWING_LEFT", "ParameterTakesPrecedence": False,
        "Sizeable": False,
    },
}
TYPE_KINDS = {
    "IfcWallType": "SOLIDWALL", "IfcWindowType": "WINDOW", "IfcDoorType": "DOOR", "IfcSlabType": "FLOOR",
    "IfcColumnType": "COLUMN", "IfcBeamType": "BEAM", "IfcSolarDeviceType": "SOLARPANEL",
    "IfcUnitaryEquipmentType": "NOTDEFINED",
}

STYLES: dict[str, tuple[float, float, float, float]] = {
    "render": (0.90, 0.88, 0.83, 0.0),
    "plaster": (0.94, 0.94, 0.92, 0.0),
    "concrete": (0.62, 0.62, 0.60, 0.0),
    "tile": (0.32, 0.20, 0.17, 0.0),
    "timber": (0.62, 0.43, 0.26, 0.0),
    "oak": (0.72, 0.55, 0.36, 0.0),
    "anthracite": (0.20, 0.22, 0.24, 0.0),
    "glass": (0.62, 0.78, 0.85, 0.7),
    "steel": (0.55, 0.57, 0.60, 0.0),
    "zinc": (0.70, 0.73, 0.75, 0.0),
    "grass": (0.42, 0.53, 0.28, 0.0),
    "paving": (0.74, 0.70, 0.64, 0.0),
    "fabric": (0.35, 0.43, 0.52, 0.0),
    "white": (0.92, 0.92, 0.92, 0.0),
    "solar": (0.08, 0.11, 0.22, 0.0),
}
"""Name -> red, green, blue, transparency."""


@dataclass(frozen=True)
class Solid:
    """A polygon (or circle) pushed along an axis. ``outline`` lies across it: z: (x, y), x: (y, z), y: (x, z)."""

    outline: tuple[Point, ...]
    axis: Axis
    start: float
    depth: float
    style: str
    radius: float = 0.0
    """Above 0: a circle about the only point of ``outline``."""
    holes: tuple[tuple[Point, ...], ...] = ()

    def moved(self, x: float, y: float, z: float) -> Solid:
        """The same solid elsewhere."""
        along = {"x": x, "y": y, "z": z}[self.axis]
        a, b = {"x": (y, z), "y": (x, z), "z": (x, y)}[self.axis]

        def shift(points: tuple[Point, ...]) -> tuple[Point, ...]:
            return tuple((p + a, q + b) for p, q in points)

        return Solid(
            shift(self.outline), self.axis, self.start + along, self.depth, self.style, self.radius,
            tuple(shift(hole) for hole in self.holes),
        )


def box(x: float, y: float, z: float, dx: float, dy: float, dz: float, style: str) -> Solid:
    """A box from its lowest corner and its edges."""
    return Solid(((x, y), (x + dx, y), (x + dx, y + dy), (x, y + dy)), "z", z, dz, style)


def prism(outline: Sequence[Point], axis: Axis, start: float, depth: float, style: str) -> Solid:
    """Any polygon, pushed along an axis."""
    return Solid(tuple(outline), axis, start, depth, style)


def tube(a: float, b: float, axis: Axis, start: float, depth: float, radius: float, style: str) -> Solid:
    """A round bar."""
    return Solid(((a, b),), axis, start, depth, style, radius)


def at(x: float, y: float, z: float, turn_deg: float = 0.0, tilt_deg: float = 0.0) -> Matrix:
    """Placement: tilted about its own x axis, then turned about z, then moved to (x, y, z)."""
    c, s = math.cos(math.radians(turn_deg)), math.sin(math.radians(turn_deg))
    ct, st = math.cos(math.radians(tilt_deg)), math.sin(math.radians(tilt_deg))
    matrix = np.eye(4)
    matrix[:3, :3] = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, ct, -st], [0, st, ct]])
    matrix[:3, 3] = x, y, z
    return matrix


@dataclass
class HouseBuilder:
    """One IFC file in the making."""

    schema: str
    file: Any = None
    body: Any = None
    site: Any = None
    building: Any = None
    _styles: dict[str, Any] = field(default_factory=dict)
    _materials: dict[str, Any] = field(default_factory=dict)
    _types: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        import ifcopenshell.api.aggregate
        import ifcopenshell.api.context
        import ifcopenshell.api.owner
        import ifcopenshell.api.project
        import ifcopenshell.api.root
        import ifcopenshell.api.unit

        if self.schema not in SCHEMAS:
            known = ", ".join(SCHEMAS)
            raise BimVerifyError(f"The demo house cannot be written as {self.schema}; choose one of {known}.")
        api: Any = ifcopenshell.api
        self.file = api.project.create_file(self.schema)
        person = api.owner.add_person(self.file, identification="demo", family_name="Demo", given_name="House")
        maker = api.owner.add_organisation(self.file, identification="bim_verify", name="bim_verify")
        api.owner.add_person_and_organisation(self.file, person=person, organisation=maker)
        api.owner.add_application(
            self.file, application_developer=maker, version="1", application_full_name="bim_verify demo house",
            application_identifier="bim_verify",
        )
        project = api.root.create_entity(self.file, "IfcProject", name="Demo house")
        units = [
            api.unit.add_si_unit(self.file, "LENGTHUNIT", prefix="MILLI"),
            api.unit.add_si_unit(self.file, "AREAUNIT"),
            api.unit.add_si_unit(self.file, "VOLUMEUNIT"),
            api.unit.add_si_unit(self.file, "PLANEANGLEUNIT"),
        ]
        api.unit.assign_unit(self.file, units=units).Units = units  # the call itself leaves them in an order of chance
        model = api.context.add_context(self.file, context_type="Model")
        self.body = api.context.add_context(
            self.file, context_type="Model", context_identifier="Body", target_view="MODEL_VIEW", parent=model
        )
        self.site = api.root.create_entity(self.file, "IfcSite", name="Garden plot")
        self.building = api.root.create_entity(self.file, "IfcBuilding", name="House")
        api.aggregate.assign_object(self.file, products=[self.site], relating_object=project)
        api.aggregate.assign_object(self.file, products=[self.building], relating_object=self.site)
        self.place(self.site, at(0, 0, 0))
        self.place(self.building, at(0, 0, 0))

    def storey(self, name: str, elevation: float) -> Any:
        """A new storey of the building."""
        import ifcopenshell.api.aggregate
        import ifcopenshell.api.root

        storey = ifcopenshell.api.root.create_entity(self.file, "IfcBuildingStorey", name=name)
        storey.Elevation = float(elevation)
        ifcopenshell.api.aggregate.assign_object(self.file, products=[storey], relating_object=self.building)
        self.place(storey, at(0, 0, elevation))
        return storey

    def add(
        self,
        ifc_class: str,
        name: str,
        solids: Sequence[Solid],
        container: Any,
        *,
        place: Matrix = None,
        predefined: str | None = None,
        type_class: str | None = None,
        type_name: str = "",
        material: str = "",
        common: Mapping[str, Any] | None = None,
    ) -> Any:
        """A product with its own body, in a storey (or part of another product). ``solids`` are in house coordinates.

        With ``type_class`` the shape belongs to the type, occurrences share it, and ``solids`` are in its own
        coordinates, put in place by ``place``. ``common`` are the properties of its Pset_*Common.
        """
        product = self._entity(ifc_class, name, predefined)
        self._contain(product, container)
        if type_class and place is not None:
            self.place(product, place)
            self._assign_type(product, self._type(type_class, type_name, solids))
        else:
            base = place if place is not None else self._corner(solids)
            self.place(product, base)
            x, y, z = (-float(v) for v in base[:3, 3])
            self._give_body(product, [s.moved(x, y, z) for s in solids])
            if type_class:
                self._assign_type(product, self._type(type_class, type_name, ()))
        if material:
            self._assign_material(product, material)
        if common:
            self._set_common(product, ifc_class, common)
        return product

    def opening(self, host: Any, solid: Solid, filling: Any | None = None) -> None:
        """Cut ``solid`` out of ``host``; ``filling`` is the window or door that stands in the hole."""
        import ifcopenshell.api.feature
        import ifcopenshell.api.root

        hole = ifcopenshell.api.root.create_entity(self.file, "IfcOpeningElement", name=f"Opening in {host.Name}")
        if hasattr(hole, "PredefinedType"):
            hole.PredefinedType = "OPENING"
        ifcopenshell.api.feature.add_feature(self.file, feature=hole, element=host)
        base = self._corner([solid])
        self.place(hole, base)
        x, y, z = (-float(v) for v in base[:3, 3])
        self._give_body(hole, [solid.moved(x, y, z)], styled=False)
        if filling is not None:
            fills = ifcopenshell.api.feature.add_filling(self.file, opening=hole, element=filling)
            fills.OwnerHistory = hole.OwnerHistory

    def whole(self, name: str, ifc_class: str, container: Any, predefined: str, common: Mapping[str, Any]) -> Any:
        """A product without a body of its own, whose parts carry the shape."""
        whole = self._entity(ifc_class, name, predefined)
        if hasattr(whole, "ShapeType"):
            whole.ShapeType = predefined
        self._contain(whole, container)
        self.place(whole, at(0, 0, 0))
        self._set_common(whole, ifc_class, common)
        return whole

    def place(self, product: Any, matrix: Matrix) -> None:
        """Put a product at a placement in house coordinates."""
        import ifcopenshell.api.geometry

        # the call scales the matrix it is given in place
        ifcopenshell.api.geometry.edit_object_placement(self.file, product=product, matrix=matrix.copy(), is_si=False)

    def write(self, path: str | Path) -> None:
        """Give stable GlobalIds, and write the file whole."""
        import ifcopenshell.guid

        for number, root in enumerate(sorted(self.file.by_type("IfcRoot"), key=lambda e: e.id())):
            root.GlobalId = ifcopenshell.guid.compress(uuid.uuid5(NAMESPACE, f"{self.schema} {number}").hex)
        for entity in (*self.file.by_type("IfcRelationship"), *self.file.by_type("IfcUnitAssignment")):
            for index, value in enumerate(entity):
                if isinstance(value, tuple) and value and hasattr(value[0], "id"):
                    entity[index] = tuple(sorted(value, key=lambda e: e.id()))
        for history in self.file.by_type("IfcOwnerHistory"):
            history.CreationDate = 1709294400
            history.LastModifiedDate = 1709294400
            history.ChangeAction = "ADDED"
        header = self.file.header
        header.file_name.name = Path(path).name
        header.file_name.time_stamp = TIME_STAMP
        header.file_name.author = ("Demo House",)
        header.file_name.organization = ("bim_verify",)
        with whole_file(path) as temporary:
            self.file.write(str(temporary))

    def _entity(self, ifc_class: str, name: str, predefined: str | None) -> Any:
        import ifcopenshell.api.root

        wanted = IFC2X3_CLASSES.get(ifc_class, ifc_class) if self.schema == "IFC2X3" else ifc_class
        product = ifcopenshell.api.root.create_entity(self.file, wanted, name=name)
        if predefined and hasattr(product, "PredefinedType"):
            self._set_kind(product, predefined)
        if hasattr(product, "CompositionType") and self.schema == "IFC2X3" and wanted == "IfcBuildingElementProxy":
            product.CompositionType = "ELEMENT"
        return product

    @staticmethod
    def _set_kind(entity: Any, kind: str) -> None:
        try:
            entity.PredefinedType = kind
        except RuntimeError:  # an older schema does not have this one
            entity.PredefinedType = "NOTDEFINED"

    def _contain(self, product: Any, container: Any) -> None:
        import ifcopenshell.api.aggregate
        import ifcopenshell.api.spatial

        if container.is_a("IfcSpatialStructureElement"):
            ifcopenshell.api.spatial.assign_container(self.file, products=[product], relating_structure=container)
        else:
            ifcopenshell.api.aggregate.assign_object(self.file, products=[product], relating_object=container)

    @staticmethod
    def _corner(solids: Sequence[Solid]) -> Matrix:
        low = np.full(3, np.inf)
        for solid in solids:
            outline = np.array(solid.outline, dtype=np.float64)
            a, b = outline.min(axis=0) - solid.radius
            corner = {"x": (solid.start, a, b), "y": (a, solid.start, b), "z": (a, b, solid.start)}[solid.axis]
            low = np.minimum(low, corner)
        return at(*low)

    def _give_body(self, product: Any, solids: Sequence[Solid], *, styled: bool = True) -> None:
        import ifcopenshell.api.geometry

        ifcopenshell.api.geometry.assign_representation(
            self.file, product=product, representation=self._shape(solids, styled)
        )

    def _shape(self, solids: Sequence[Solid], styled: bool) -> Any:
        items = [self._item(solid, styled) for solid in solids]
        return self.file.create_entity(
            "IfcShapeRepresentation", ContextOfItems=self.body, RepresentationIdentifier="Body",
            RepresentationType="SweptSolid", Items=items,
        )

    def _item(self, solid: Solid, styled: bool) -> Any:
        import ifcopenshell.api.style

        f = self.file
        flip = solid.axis == "y"  # right-handed: the profile's plane across y is (z, x)
        if solid.radius > 0:
            (a, b) = solid.outline[0]
            centre = f.create_entity("IfcCartesianPoint", (float(b), float(a)) if flip else (float(a), float(b)))
            direction = f.create_entity("IfcDirection", (1.0, 0.0))
            profile = f.create_entity(
                "IfcCircleProfileDef", ProfileType="AREA",
                Position=f.create_entity("IfcAxis2Placement2D", centre, direction), Radius=float(solid.radius),
            )
        else:
            outer = self._polyline(solid.outline, flip)
            if solid.holes:
                inner = [self._polyline(hole, flip) for hole in solid.holes]
                profile = f.create_entity("IfcArbitraryProfileDefWithVoids", "AREA", None, outer, inner)
            else:
                profile = f.create_entity("IfcArbitraryClosedProfileDef", "AREA", None, outer)
        ahead = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
        side = {"x": (0.0, 1.0, 0.0), "y": (0.0, 0.0, 1.0), "z": (1.0, 0.0, 0.0)}
        start = tuple(float(solid.start * v) for v in ahead[solid.axis])
        position = f.create_entity(
            "IfcAxis2Placement3D",
            f.create_entity("IfcCartesianPoint", start),
            f.create_entity("IfcDirection", ahead[solid.axis]),
            f.create_entity("IfcDirection", side[solid.axis]),
        )
        item = f.create_entity(
            "IfcExtrudedAreaSolid", profile, position, f.create_entity("IfcDirection", (0.0, 0.0, 1.0)),
            float(solid.depth),
        )
        if styled:
            ifcopenshell.api.style.assign_item_style(
                f, item=item, style=self._style(solid.style),
                should_use_presentation_style_assignment=self.schema == "IFC2X3",
            )
        return item

    def _polyline(self, outline: Sequence[Point], flip: bool) -> Any:
        points = [(float(b), float(a)) if flip else (float(a), float(b)) for a, b in outline]
        area = sum(p[0] * q[1] - q[0] * p[1] for p, q in zip(points, [*points[1:], points[0]], strict=True))
        if area < 0:
            points.reverse()
        corners = [self.file.create_entity("IfcCartesianPoint", p) for p in points]
        return self.file.create_entity("IfcPolyline", [*corners, corners[0]])

    def _style(self, name: str) -> Any:
        import ifcopenshell.api.style

        if name not in self._styles:
            red, green, blue, clear = STYLES[name]
            style = ifcopenshell.api.style.add_style(self.file, name=name)
            attributes: dict[str, Any] = {
                "SurfaceColour": {"Name": None, "Red": red, "Green": green, "Blue": blue},
                "Transparency": clear,
                "ReflectanceMethod": "NOTDEFINED",
            }
            ifcopenshell.api.style.add_surface_style(
                self.file, style=style, ifc_class="IfcSurfaceStyleRendering", attributes=attributes
            )
            self._styles[name] = style
        return self._styles[name]

    def _type(self, type_class: str, name: str, solids: Sequence[Solid]) -> Any:
        import ifcopenshell.api.geometry
        import ifcopenshell.api.root

        if name not in self._types:
            wanted = IFC2X3_CLASSES.get(type_class, type_class) if self.schema == "IFC2X3" else type_class
            kind = ifcopenshell.api.root.create_entity(self.file, wanted, name=name)
            for attribute, value in TYPE_ATTRIBUTES.get(wanted, {}).items():
                setattr(kind, attribute, value)
            if hasattr(kind, "PredefinedType"):
                self._set_kind(kind, TYPE_KINDS.get(wanted, "NOTDEFINED"))
            if solids:
                ifcopenshell.api.geometry.assign_representation(
                    self.file, product=kind, representation=self._shape(solids, True)
                )
            self._types[name] = kind
        return self._types[name]

    def _assign_type(self, product: Any, kind: Any) -> None:
        import ifcopenshell.api.type

        ifcopenshell.api.type.assign_type(self.file, related_objects=[product], relating_type=kind)

    def _assign_material(self, product: Any, name: str) -> None:
        import ifcopenshell.api.material

        if name not in self._materials:
            self._materials[name] = ifcopenshell.api.material.add_material(self.file, name=name)
        ifcopenshell.api.material.assign_material(self.file, products=[product], material=self._materials[name])

    def _set_common(self, product: Any, ifc_class: str, properties: Mapping[str, Any]) -> None:
        import ifcopenshell.api.pset

        pset = ifcopenshell.api.pset.add_pset(self.file, product=product, name=f"Pset_{ifc_class[3:]}Common")
        ifcopenshell.api.pset.edit_pset(self.file, pset=pset, properties=dict(properties))
