"""IFC files made in code, for the tests of the model's way in: any schema and unit, any placement, one thing at a time."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import ifcopenshell.api.aggregate
import ifcopenshell.api.context
import ifcopenshell.api.feature
import ifcopenshell.api.geometry
import ifcopenshell.api.owner
import ifcopenshell.api.project
import ifcopenshell.api.root
import ifcopenshell.api.spatial
import ifcopenshell.api.style
import ifcopenshell.api.unit
import numpy as np
from numpy.typing import NDArray

from bim_verify.core.model.elements import BuildingModel

Matrix = NDArray[np.float64]
UNITS_M = {"mm": 0.001, "m": 1.0, "foot": 0.3048}
SCHEMAS = ("IFC2X3", "IFC4", "IFC4X3")


def at(x: float = 0.0, y: float = 0.0, z: float = 0.0, turn_deg: float = 0.0) -> Matrix:
    """Placement in metres, turned about the vertical."""
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    matrix = np.eye(4)
    matrix[:2, :2] = [[c, -s], [s, c]]
    matrix[:3, 3] = x, y, z
    return matrix


@dataclass
class ModelFile:
    """A project with a site, a building and a storey, all at the origin. Lengths given in metres."""

    schema: str = "IFC4"
    unit: str = "mm"
    file: Any = field(init=False)

    def __post_init__(self) -> None:
        api: Any = ifcopenshell.api
        self.file = file = api.project.create_file("IFC4X3_ADD2" if self.schema == "IFC4X3" else self.schema)
        if self.schema == "IFC2X3":
            person = api.owner.add_person(file, identification="t", family_name="Tester")
            maker = api.owner.add_organisation(file, identification="t", name="Tests")
            api.owner.add_person_and_organisation(file, person=person, organisation=maker)
            api.owner.add_application(
                file, application_developer=maker, version="1", application_full_name="Tests", application_identifier="t"
            )
        project = api.root.create_entity(file, "IfcProject", name="Made in a test")
        length = (
            api.unit.add_conversion_based_unit(file, name="foot")
            if self.unit == "foot"
            else api.unit.add_si_unit(file, "LENGTHUNIT", prefix="MILLI" if self.unit == "mm" else None)
        )
        api.unit.assign_unit(file, units=[length, api.unit.add_si_unit(file, "PLANEANGLEUNIT")])
        model = api.context.add_context(file, context_type="Model")
        self.body = api.context.add_context(file, "Model", "Body", target_view="MODEL_VIEW", parent=model)
        self.site = self._spatial("IfcSite", "Site", project)
        self.building = self._spatial("IfcBuilding", "Building", self.site)
        self.storey = self._spatial("IfcBuildingStorey", "Ground", self.building)

    def _spatial(self, ifc_class: str, name: str, parent: Any) -> Any:
        found = ifcopenshell.api.root.create_entity(self.file, ifc_class, name=name)
        ifcopenshell.api.aggregate.assign_object(self.file, products=[found], relating_object=parent)
        return found

    @property
    def scale(self) -> float:
        """File units in a metre."""
        return 1.0 / UNITS_M[self.unit]

    def place(self, product: Any, matrix: Matrix) -> None:
        ifcopenshell.api.geometry.edit_object_placement(self.file, product=product, matrix=matrix.copy(), is_si=True)

    def product(self, ifc_class: str, name: str, item: Any, matrix: Matrix | None = None, into: Any = None) -> Any:
        """A product with one body item, in the storey unless ``into`` names another container (False: in none)."""
        made = ifcopenshell.api.root.create_entity(self.file, ifc_class, name=name)
        if into is not False and hasattr(made, "ContainedInStructure"):
            container = into or self.storey
            ifcopenshell.api.spatial.assign_container(self.file, products=[made], relating_structure=container)
        self.place(made, at() if matrix is None else matrix)
        kind = "SweptSolid" if item.is_a("IfcExtrudedAreaSolid") else "SurfaceModel"
        shape = self.file.create_entity("IfcShapeRepresentation", self.body, "Body", kind, [item])
        ifcopenshell.api.geometry.assign_representation(self.file, product=made, representation=shape)
        return made

    def box(self, dx: float, dy: float, dz: float) -> Any:
        """From the placement's origin to (dx, dy, dz)."""
        middle = self.file.create_entity("IfcCartesianPoint", [dx / 2 * self.scale, dy / 2 * self.scale])
        place = self.file.create_entity("IfcAxis2Placement2D", middle)
        profile = self.file.create_entity("IfcRectangleProfileDef", "AREA", None, place, dx * self.scale, dy * self.scale)
        return self._extrude(profile, dz)

    def round_column(self, radius: float, height: float) -> Any:
        """About the placement's z axis."""
        place = self.file.create_entity(
            "IfcAxis2Placement2D", self.file.create_entity("IfcCartesianPoint", [0.0, 0.0])
        )
        profile = self.file.create_entity("IfcCircleProfileDef", "AREA", None, place, radius * self.scale)
        return self._extrude(profile, height)

    def _extrude(self, profile: Any, depth: float) -> Any:
        zero = self.file.create_entity("IfcCartesianPoint", [0.0, 0.0, 0.0])
        axes = self.file.create_entity("IfcAxis2Placement3D", zero)
        up = self.file.create_entity("IfcDirection", [0.0, 0.0, 1.0])
        return self.file.create_entity("IfcExtrudedAreaSolid", profile, axes, up, depth * self.scale)

    def sheet(self, *corners: tuple[float, float, float]) -> Any:
        """One face through the corners: an open surface."""
        points = [self.file.create_entity("IfcCartesianPoint", [v * self.scale for v in p]) for p in corners]
        bound = self.file.create_entity("IfcFaceOuterBound", self.file.create_entity("IfcPolyLoop", points), True)
        face = self.file.create_entity("IfcFace", [bound])
        shell = self.file.create_entity("IfcOpenShell", [face])
        return self.file.create_entity("IfcShellBasedSurfaceModel", [shell])

    def opening(self, host: Any, item: Any, matrix: Matrix) -> Any:
        hole = ifcopenshell.api.root.create_entity(self.file, "IfcOpeningElement", name="Opening")
        ifcopenshell.api.feature.add_feature(self.file, feature=hole, element=host)
        self.place(hole, matrix)
        shape = self.file.create_entity("IfcShapeRepresentation", self.body, "Body", "SweptSolid", [item])
        ifcopenshell.api.geometry.assign_representation(self.file, product=hole, representation=shape)
        return hole

    def see_through(self, item: Any, transparency: float) -> None:
        """Style a body item."""
        style = ifcopenshell.api.style.add_style(self.file, name=f"Transparent {transparency}")
        attributes = {
            "SurfaceColour": {"Name": None, "Red": 0.5, "Green": 0.6, "Blue": 0.7}, "Transparency": transparency,
        }  # fmt: skip
        rendering = self.schema == "IFC2X3"
        if rendering:
            attributes["ReflectanceMethod"] = "NOTDEFINED"
        ifcopenshell.api.style.add_surface_style(
            self.file, style=style, ifc_class="IfcSurfaceStyleRendering" if rendering else "IfcSurfaceStyleShading",
            attributes=attributes,
        )
        if self.schema == "IFC2X3":
            assigned = self.file.create_entity("IfcPresentationStyleAssignment", [style])
            self.file.create_entity("IfcStyledItem", item, [assigned])
        else:
            self.file.create_entity("IfcStyledItem", item, [style])

    def map_conversion(self, **attributes: Any) -> None:
        """An IfcMapConversion with a target in metres; needs IFC4 or later."""
        metre = self.file.create_entity("IfcSIUnit", None, "LENGTHUNIT", None, "METRE")
        target = self.file.create_entity("IfcProjectedCRS", Name="EPSG:25832", MapUnit=metre)
        context = next(c for c in self.file.by_type("IfcGeometricRepresentationContext") if c.ContextType == "Model")
        self.file.create_entity("IfcMapConversion", SourceCRS=context, TargetCRS=target, **attributes)

    def write(self, path: Path) -> Path:
        self.file.write(str(path))
        return path


def corners_of(model: BuildingModel, name: str) -> Matrix:
    """(T, 3, 3) triangles of an element, metres, model frame."""
    row = [e.name for e in model.elements].index(name)
    return model.vertices[model.triangles[model.triangle_element == row]] + model.origin


def bounds_of(model: BuildingModel, name: str) -> Matrix:
    """(2, 3) metres, model frame."""
    corners = corners_of(model, name).reshape(-1, 3)
    return np.stack([corners.min(axis=0), corners.max(axis=0)])


def area_of(corners: Matrix) -> float:
    """m2"""
    return float(0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum())


def volume_of(corners: Matrix) -> float:
    """m3, positive when the triangles face outward; about their middle, so that far-away coordinates cost no digits."""
    local = corners - corners.reshape(-1, 3).mean(axis=0)
    return float(np.einsum("ij,ij->i", local[:, 0], np.cross(local[:, 1], local[:, 2])).sum() / 6)
