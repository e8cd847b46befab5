"""A reconstruction as IFC4: swept solids with their relations, metres."""

from __future__ import annotations

import math
import uuid
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry.polygon import orient

from ... import __version__
from ..files import whole_file
from .building import ASSUMED, BuiltColumn, BuiltRoom, BuiltSlab, BuiltStorey, BuiltWall, FitRecord, Reconstruction, StoreyIds
from .openings import Opening
from .shapes import HEIGHT_SOURCE, HIDDEN_EDGES, HIDDEN_FACES, PSET_NAME
from .slab_holes import SlabHole

Array = NDArray[np.float64]

NAMESPACE = uuid.UUID("1c6a4b0e-6a0a-5d8e-9f0e-2f6f1f0f7b11")
THROUGH_M = 0.05
"""An opening's body reaches this far out of its wall on both sides."""
LEAF_M = 0.05
FRAME_M = 0.05
TIME_STAMP = "2024-01-01T00:00:00"
"""Fixed, so that the same scans write the same file."""


def write_reconstruction(path: str | Path, result: Reconstruction, name: str = "") -> None:
    """Write the model in the scans' own frame. Raises BimVerifyError when the place cannot be written.

    ``name``: of the file in its header, where ``path`` is not the last place of it.
    """
    write_building_file(path, building_file(result), name)


def write_building_file(path: str | Path, file: Any, name: str = "") -> None:
    """The same for what ``building_file`` made."""
    with whole_file(path) as temporary:
        file.header.file_name.name = name or Path(path).name
        file.header.file_name.time_stamp = TIME_STAMP
        file.write(str(temporary))


def building_file(result: Reconstruction) -> Any:
    """The ``ifcopenshell.file`` in memory."""
    return written_building(result)[0]


def written_building(result: Reconstruction) -> tuple[Any, list[StoreyIds]]:
    """The same, and the GlobalIds that were given to what each storey holds."""
    writer = _Writer(result)
    writer.build()
    return writer.file, [writer.ids(storey, made) for storey, made in zip(result.storeys, writer.made, strict=True)]


class _Writer:
    def __init__(self, result: Reconstruction) -> None:
        import ifcopenshell.api.context
        import ifcopenshell.api.project
        import ifcopenshell.api.root
        import ifcopenshell.api.unit

        self.api: Any = ifcopenshell.api
        self.result = result
        self.made: list[dict[str, list[Any]]] = []
        """Of each storey its products: rooms, walls, openings (of all walls, in their order), columns, openings of slabs."""
        self.file: Any = self.api.project.create_file("IFC4")
        f = self.file
        self.project = self.api.root.create_entity(f, "IfcProject", name="Reconstruction")
        units = [
            self.api.unit.add_si_unit(f, unit_type=kind) for kind in ("LENGTHUNIT", "AREAUNIT", "VOLUMEUNIT", "PLANEANGLEUNIT")
        ]
        self.api.unit.assign_unit(f, units=units).Units = units  # the call itself leaves them in an order of chance
        model = self.api.context.add_context(f, context_type="Model")
        plan = self.api.context.add_context(f, context_type="Plan")
        self.body = self.api.context.add_context(
            f, context_type="Model", context_identifier="Body", target_view="MODEL_VIEW", parent=model
        )
        self.axis = self.api.context.add_context(
            f, context_type="Plan", context_identifier="Axis", target_view="GRAPH_VIEW", parent=plan
        )
        site = self.api.root.create_entity(f, "IfcSite", name="Site")
        self.building = self.api.root.create_entity(f, "IfcBuilding", name="Scanned building")
        self._aggregate(self.project, [site])
        self._aggregate(site, [self.building])
        self.site_place = self._place(site, None, np.append(result.origin[:2], 0.0))
        self.building_place = self._place(self.building, self.site_place, np.zeros(3))

    def build(self) -> None:
        """All storeys, then stable GlobalIds."""
        import ifcopenshell.guid

        self._aggregate(self.building, [self._storey(storey) for storey in self.result.storeys])

        for number, root in enumerate(sorted(self.file.by_type("IfcRoot"), key=lambda e: e.id())):
            name = f"{number} {self.result.returns} {self.result.origin.tolist()}"
            root.GlobalId = ifcopenshell.guid.compress(uuid.uuid5(NAMESPACE, name).hex)

    @staticmethod
    def ids(built: BuiltStorey, made: dict[str, list[Any]]) -> StoreyIds:
        """GlobalIds of a storey's products."""
        rooms, walls, holes, columns = ([p.GlobalId for p in made[k]] for k in ("rooms", "walls", "openings", "columns"))
        rest = iter(holes)
        openings = tuple(tuple(next(rest) for _ in wall.openings) for wall in built.walls)
        return StoreyIds(tuple(rooms), tuple(walls), openings, tuple(columns), tuple(p.GlobalId for p in made["slab_openings"]))

    def _storey(self, built: BuiltStorey) -> Any:
        f = self.file
        storey = self.api.root.create_entity(f, "IfcBuildingStorey", name=built.name)
        storey.Elevation = float(built.floor + self.result.origin[2])
        elevation = float(built.floor + self.result.origin[2])
        place = self._place(storey, self.building_place, np.array([0.0, 0.0, elevation]))
        contained = []
        made: dict[str, list[Any]] = {"rooms": [], "walls": [], "openings": [], "columns": [], "slab_openings": []}
        self.made.append(made)
        walls, spaces = made["walls"], made["rooms"]
        for number, wall in enumerate(built.walls, start=1):
            product, parts = self._wall(wall, f"Wall {number}", place, built.floor)
            walls.append(product)
            contained += [product, *parts]
        for number, column in enumerate(built.columns, start=1):
            product = self._element("IfcColumn", f"Column {number}", place, "COLUMN")
            centre = column.footprint.centroid
            profile = self._circle(centre.x, centre.y, column.radius) if column.radius else self._profile(column.footprint)
            self._body(product, self._extrude(profile, column.base - built.floor, column.top - column.base))
            hidden = {} if column.radius else {HIDDEN_FACES: f.create_entity("IfcLabel", ", ".join(column.hidden) or "none")}
            self._pset(product, column.fit, self._height_source(column) | hidden)
            made["columns"].append(product)
            contained.append(product)
        for slab in built.slabs:
            contained.append(self._slab(slab, place, built.floor))
        for number, room in enumerate(built.rooms, start=1):
            space = self._element("IfcSpace", f"Room {number}", place, "INTERNAL")
            space.CompositionType = "ELEMENT"
            self._body(space, self._extrude(self._profile(room.outline), room.floor - built.floor, room.ceiling - room.floor))
            self._set(space, PSET_NAME, self._height_source(room) | self._method())
            self._quantities(space, room.outline, None if room.height_source == ASSUMED else room.ceiling - room.floor)
            spaces.append(space)
        self._aggregate(storey, spaces)
        if contained:
            f.create_entity(
                "IfcRelContainedInSpatialStructure", GlobalId=_new(), RelatedElements=contained, RelatingStructure=storey
            )
        self._connect(built, walls)
        return storey

    def _aggregate(self, whole: Any, parts: list[Any]) -> None:
        """The parts, in this order; ifcopenshell's own call relates and places them in an order of chance."""
        if parts:
            self.file.create_entity("IfcRelAggregates", GlobalId=_new(), RelatingObject=whole, RelatedObjects=parts)

    def _wall(self, wall: BuiltWall, name: str, storey_place: Any, floor: float) -> tuple[Any, list[Any]]:
        f = self.file
        product = self.api.root.create_entity(f, "IfcWall", name=name)
        product.PredefinedType = "SOLIDWALL"
        along = wall.along
        base = np.append(wall.start, wall.base - floor)
        place = self._place(product, storey_place, base, along)
        turn = np.stack([along, [-along[1], along[0]]])
        local = Polygon((np.array(wall.footprint.exterior.coords)[:-1] - wall.start) @ turn.T)
        self._body(product, self._extrude(self._profile(local), 0.0, wall.top - wall.base))
        line = f.create_entity("IfcPolyline", [self._point((0.0, 0.0)), self._point((wall.length, 0.0))])
        axis = f.create_entity("IfcShapeRepresentation", self.axis, "Axis", "Curve2D", [line])
        product.Representation.Representations = [*product.Representation.Representations, axis]
        self._pset(product, wall.fit, self._height_source(wall))
        external = {} if wall.external is None else {"IsExternal": wall.external}
        self._common(product, "Pset_WallCommon", external)
        parts = []
        for number, opening in enumerate(wall.openings, start=1):
            filling = self._opening(product, place, wall, opening, f"{name}.{number}", storey_place)
            if filling is not None:
                self._common(filling, f"Pset_{filling.is_a()[3:]}Common", external)
                parts.append(filling)
        return product, parts

    def _opening(
        self, host: Any, host_place: Any, wall: BuiltWall, opening: Opening, name: str, storey_place: Any
    ) -> Any | None:
        f = self.file
        hole = self.api.root.create_entity(f, "IfcOpeningElement", name=f"Opening {name}")
        recess = opening.kind == "recess"
        hole.PredefinedType = "RECESS" if recess else "OPENING"
        if opening.foot_hidden:
            hole.Description = "A door or a window: its foot is hidden"
        elif recess:
            hole.Description = "A recess with a solid back; a closed leaf without a frame would look alike"
        # the wall was seen from its left
        back = wall.thickness / 2 - opening.recess if recess else -wall.thickness / 2 - THROUGH_M
        deep = wall.thickness / 2 + THROUGH_M - back
        self._place(hole, host_place, np.array([opening.u0, back, opening.z0 - wall.base]))
        self._body(hole, self._extrude(self._rectangle(0.0, opening.width, 0.0, deep), 0.0, opening.height))
        f.create_entity("IfcRelVoidsElement", GlobalId=_new(), RelatingBuildingElement=host, RelatedOpeningElement=hole)
        self._opening_pset(hole, wall, opening)
        self.made[-1]["openings"].append(hole)
        if opening.kind in ("opening", "recess"):
            return None
        door = opening.kind == "door"
        filling = self.api.root.create_entity(f, "IfcDoor" if door else "IfcWindow", name=f"{opening.kind.title()} {name}")
        filling.PredefinedType = "DOOR" if door else "WINDOW"
        filling.OverallWidth, filling.OverallHeight = float(opening.width), float(opening.height)
        if door:
            filling.OperationType = "NOTDEFINED"
        else:
            filling.PartitioningType = "NOTDEFINED"
        deep = min(LEAF_M, wall.thickness)
        self._place(filling, hole.ObjectPlacement, np.array([0.0, THROUGH_M + (wall.thickness - deep) / 2, 0.0]))
        self._body(filling, *self._leaf(opening, deep, door))
        f.create_entity("IfcRelFillsElement", GlobalId=_new(), RelatingOpeningElement=hole, RelatedBuildingElement=filling)
        self._opening_pset(filling, wall, opening)
        return filling

    def _opening_pset(self, product: Any, wall: BuiltWall, opening: Opening) -> None:
        """The set with what is known of the edges: what hid one makes its sigma large, and its name is said."""
        start, end, *_ = opening.edge_sigma
        fit = FitRecord(None, None, opening.quality, math.hypot(start, end) / 2, wall.fit.thickness_source)
        names = ("StartEdgeSigma", "EndEdgeSigma", "SillSigma", "HeadSigma")
        edges = {
            name: self.file.create_entity("IfcLengthMeasure", float(sigma))
            for name, sigma in zip(names, opening.edge_sigma, strict=True)
        }
        edges[HIDDEN_EDGES] = self.file.create_entity("IfcLabel", ", ".join(opening.hidden) or "none")
        self._pset(product, fit, edges)

    def _leaf(self, opening: Opening, deep: float, door: bool) -> list[Any]:
        w, h, t = opening.width, opening.height, FRAME_M
        foot = 0.0 if door else t
        bars = [(0.0, t, 0.0, h), (w - t, w, 0.0, h), (t, w - t, h - t, t)] + ([] if door else [(t, w - t, 0.0, t)])
        solids = [self._extrude(self._rectangle(a, b, 0.0, deep), z, high) for a, b, z, high in bars]
        panel = deep * (0.8 if door else 0.4)
        solids.append(
            self._extrude(self._rectangle(t, w - t, (deep - panel) / 2, (deep + panel) / 2), foot, h - t - foot)
        )
        return solids

    def _slab(self, slab: BuiltSlab, place: Any, floor: float) -> Any:
        product = self._element("IfcSlab", {"ROOF": "Roof slab"}.get(slab.kind, "Floor slab"), place, slab.kind)
        self._body(product, self._extrude(self._profile(slab.footprint), slab.top - floor - slab.thickness, slab.thickness))
        self._pset(product, slab.fit)
        for number, hole in enumerate(slab.holes, start=1):
            self._slab_opening(product, slab, hole, f"Opening {product.Name} {number}", floor)
        return product

    def _slab_opening(self, host: Any, slab: BuiltSlab, hole: SlabHole, name: str, floor: float) -> None:
        opening = self._element("IfcOpeningElement", name, host.ObjectPlacement, "OPENING")
        bottom = slab.top - floor - slab.thickness - THROUGH_M
        self._body(opening, self._extrude(self._profile(hole.outline), bottom, slab.thickness + 2 * THROUGH_M))
        self.file.create_entity(
            "IfcRelVoidsElement", GlobalId=_new(), RelatingBuildingElement=host, RelatedOpeningElement=opening
        )
        self._pset(opening, FitRecord(None, None, hole.seen, hole.edge_sigma, slab.fit.thickness_source))
        self.made[-1]["slab_openings"].append(opening)

    def _connect(self, built: BuiltStorey, walls: list[Any]) -> None:
        done = set()
        for k, wall in enumerate(built.walls):
            for at_end, join in enumerate(wall.joins):
                if join is None or join.other >= len(walls):
                    continue
                other = built.walls[join.other]
                related = "ATPATH"
                if join.kind == "CORNER":
                    back = [j for j, q in enumerate(other.joins) if q is not None and q.other == k and q.kind == "CORNER"]
                    if not back or (join.other, k) in done:
                        continue
                    related = ("ATSTART", "ATEND")[back[0]]
                done.add((k, join.other))
                self.file.create_entity(
                    "IfcRelConnectsPathElements", GlobalId=_new(), RelatingElement=walls[k], RelatedElement=walls[join.other],
                    RelatingPriorities=[], RelatedPriorities=[], RelatedConnectionType=related,
                    RelatingConnectionType=("ATSTART", "ATEND")[at_end],
                )

    def _element(self, ifc_class: str, name: str, place: Any, kind: str) -> Any:
        product = self.api.root.create_entity(self.file, ifc_class, name=name)
        product.PredefinedType = kind
        self._place(product, place, np.zeros(3))
        return product

    def _place(self, product: Any, relative: Any, position: Array, along: Array | None = None) -> Any:
        f = self.file
        direction = None if along is None else f.create_entity("IfcDirection", (float(along[0]), float(along[1]), 0.0))
        up = None if along is None else f.create_entity("IfcDirection", (0.0, 0.0, 1.0))
        axes = f.create_entity("IfcAxis2Placement3D", self._point(position), up, direction)
        product.ObjectPlacement = f.create_entity("IfcLocalPlacement", relative, axes)
        return product.ObjectPlacement

    def _point(self, values: Any) -> Any:
        return self.file.create_entity("IfcCartesianPoint", tuple(float(v) for v in values))

    def _body(self, product: Any, *solids: Any) -> None:
        f = self.file
        shape = f.create_entity("IfcShapeRepresentation", self.body, "Body", "SweptSolid", list(solids))
        product.Representation = f.create_entity("IfcProductDefinitionShape", None, None, [shape])

    def _extrude(self, profile: Any, bottom: float, height: float) -> Any:
        f = self.file
        position = f.create_entity("IfcAxis2Placement3D", self._point((0.0, 0.0, bottom)), None, None)
        up = f.create_entity("IfcDirection", (0.0, 0.0, 1.0))
        return f.create_entity("IfcExtrudedAreaSolid", profile, position, up, float(max(height, 1e-3)))

    def _profile(self, outline: Polygon) -> Any:
        f = self.file
        outer, *inner = [self._ring(r) for r in (orient(outline).exterior, *orient(outline).interiors)]
        if inner:
            return f.create_entity("IfcArbitraryProfileDefWithVoids", "AREA", None, outer, inner)
        return f.create_entity("IfcArbitraryClosedProfileDef", "AREA", None, outer)

    def _ring(self, ring: Any) -> Any:
        points = [self._point(p[:2]) for p in list(ring.coords)[:-1]]
        return self.file.create_entity("IfcPolyline", [*points, points[0]])

    def _rectangle(self, x0: float, x1: float, y0: float, y1: float) -> Any:
        return self._profile(Polygon([(x0, y0), (x1, y0), (x1, y1), (x0, y1)]))

    def _circle(self, x: float, y: float, radius: float) -> Any:
        position = self.file.create_entity("IfcAxis2Placement2D", self._point((x, y)), None)
        return self.file.create_entity("IfcCircleProfileDef", "AREA", None, position, float(radius))

    def _pset(self, product: Any, fit: FitRecord, more: dict[str, Any] | None = None) -> None:
        f = self.file
        values = (
            ("FitMean", "IfcLengthMeasure", fit.fit_mean), ("FitSigma", "IfcLengthMeasure", fit.fit_sigma),
            ("Quality", "IfcNormalisedRatioMeasure", min(max(fit.quality, 0.0), 1.0)),
            ("PositionSigma", "IfcLengthMeasure", fit.position_sigma), ("ThicknessSource", "IfcLabel", fit.thickness_source),
        )
        self._set(product, PSET_NAME, {
            name: f.create_entity(kind, value if isinstance(value, str) else float(value))
            for name, kind, value in values if value is not None and (isinstance(value, str) or math.isfinite(value))
        } | (more or {}) | self._method())

    def _method(self) -> dict[str, Any]:
        return {"Method": self.file.create_entity("IfcLabel", f"bim_verify {__version__}")}

    def _height_source(self, built: BuiltWall | BuiltColumn | BuiltRoom) -> dict[str, Any]:
        return {HEIGHT_SOURCE: self.file.create_entity("IfcLabel", built.height_source)} if built.height_source else {}

    def _common(self, product: Any, name: str, values: dict[str, bool]) -> None:
        if values:
            self._set(product, name, {k: self.file.create_entity("IfcBoolean", v) for k, v in values.items()})

    def _set(self, product: Any, name: str, values: dict[str, Any]) -> None:
        f = self.file
        properties = [f.create_entity("IfcPropertySingleValue", key, None, value, None) for key, value in values.items()]
        pset = f.create_entity("IfcPropertySet", GlobalId=_new(), Name=name, HasProperties=properties)
        f.create_entity("IfcRelDefinesByProperties", GlobalId=_new(), RelatedObjects=[product], RelatingPropertyDefinition=pset)

    def _quantities(self, space: Any, outline: Polygon, height: float | None) -> None:
        f = self.file
        quantities = [
            f.create_entity("IfcQuantityArea", Name="NetFloorArea", AreaValue=float(outline.area)),
            f.create_entity("IfcQuantityLength", Name="GrossPerimeter", LengthValue=float(outline.exterior.length)),
        ]
        if height is not None:
            quantities.append(f.create_entity("IfcQuantityLength", Name="Height", LengthValue=float(height)))
        own = f.create_entity("IfcElementQuantity", GlobalId=_new(), Name="Qto_SpaceBaseQuantities", Quantities=quantities)
        f.create_entity("IfcRelDefinesByProperties", GlobalId=_new(), RelatedObjects=[space], RelatingPropertyDefinition=own)


def _new() -> str:
    import ifcopenshell.guid

    return str(ifcopenshell.guid.new())
