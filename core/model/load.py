"""IFC in: every physical product with a body, as outward-oriented triangles in metres near a local origin."""

from __future__ import annotations

import hashlib
import math
import multiprocessing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..progress import Progress
from . import tessellation_cache
from .elements import BuildingModel, Element, MapConversion
from .orient import orient_outward

NOT_PHYSICAL = (
    "IfcSpatialElement",
    "IfcSpatialStructureElement",
    "IfcFeatureElement",
    "IfcAnnotation",
    "IfcGrid",
    "IfcVirtualElement",
    "IfcPort",
    "IfcPositioningElement",
    "IfcLinearElement",
    "IfcStructuralItem",
    "IfcStructuralActivity",
)
"""Products that no scanner can see, or that stand for a space; everything else with a body counts."""

LARGEST_SMALL_RADIUS_M = 0.5
"""The angular deflection is set so that round members up to this radius keep the chord error; beyond it the linear one acts."""

TAIL_BYTES = 65_536
"""At the end of a file, where its last line must be."""

SEE_THROUGH = 0.3
"""A surface style at least this transparent is glass."""


def load_model(
    path: str | Path,
    *,
    deflection: float = 0.001,
    threads: int = 0,
    cache: bool = True,
    progress: Progress | None = None,
) -> BuildingModel:
    """Read an IFC file (IFC2X3, IFC4, IFC4X3) and tessellate it, or take the tessellation from the cache.

    ``deflection`` is the largest distance of a chord from a curved surface, metres. Openings are cut. The cache is keyed
    by the file's content, so an unchanged file is never tessellated twice. Raises BimVerifyError when the file cannot be
    read, is no IFC, or holds no element with a body.
    """
    progress = progress or Progress()
    source = Path(path)
    content_hash = _hash_file(source)
    key = tessellation_cache.key(content_hash, deflection)
    if cache and (found := tessellation_cache.read(key, source)) is not None:
        progress.update(1.0, "Model read from the tessellation cache")
        return found
    model = _tessellate(source, content_hash, deflection, threads or multiprocessing.cpu_count(), progress)
    if cache:
        tessellation_cache.write(key, model)
    return model


def open_ifc(path: str | Path) -> Any:
    """Open an IFC file; one clear sentence when it is none."""
    import ifcopenshell

    source = Path(path)
    _check_is_ifc(source)
    try:
        file = ifcopenshell.open(str(source))
    except Exception as error:
        raise BimVerifyError(f"Cannot read {source} as IFC: {_first_line(error)}. Export it again.") from error
    if not file.schema.startswith(("IFC2X3", "IFC4")):
        raise BimVerifyError(f"{source} uses the schema {file.schema}; only IFC2X3, IFC4 and IFC4X3 are supported.")
    return file


def physical_products(file: Any) -> list[Any]:
    """All products of an open IFC file that have a shape and that a scanner could see, ordered by STEP id."""
    return sorted(
        (p for p in file.by_type("IfcProduct") if p.Representation and not _is_any(p, NOT_PHYSICAL)),
        key=lambda p: p.id(),
    )


def _is_any(product: Any, classes: tuple[str, ...]) -> bool:
    for name in classes:
        try:
            if product.is_a(name):
                return True
        except RuntimeError:  # the class does not exist in this schema
            continue
    return False


def _check_is_ifc(source: Path) -> None:
    try:
        with source.open("rb") as stream:
            head = stream.read(4096)
            stream.seek(max(source.stat().st_size - TAIL_BYTES, 0))
            tail = stream.read(TAIL_BYTES)
    except OSError as error:
        raise BimVerifyError(f"Cannot read {source}: {error.strerror}. Check the path.") from error
    if b"ISO-10303-21" not in head:
        raise BimVerifyError(f"{source} is not an IFC file (no ISO-10303-21 header). Give an .ifc file in STEP form.")
    if b"END-ISO-10303-21" not in tail:
        raise BimVerifyError(f"{source} is cut off (no END-ISO-10303-21 at its end). Copy or export it again.")


def _check_placements(source: Path, products: list[Any]) -> None:
    """A placement relative to itself, over others or at once, would end the geometry kernel without a word."""
    sound: set[int] = set()
    for product in products:
        chain: set[int] = set()
        placement = product.ObjectPlacement
        while placement is not None and placement.id() not in sound:
            if placement.id() in chain:
                raise BimVerifyError(
                    f"{source} is damaged: the placement #{placement.id()} of {product.is_a()} {product.GlobalId} is "
                    "relative to itself. Export it again."
                )
            chain.add(placement.id())
            placement = getattr(placement, "PlacementRelTo", None)
        sound |= chain


def _hash_file(source: Path) -> str:
    _check_is_ifc(source)
    digest = hashlib.sha256()
    with source.open("rb") as stream:
        while chunk := stream.read(1 << 20):
            digest.update(chunk)
    return digest.hexdigest()


def _first_line(error: Exception) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0]


def _tessellate(source: Path, content_hash: str, deflection: float, threads: int, progress: Progress) -> BuildingModel:
    import ifcopenshell.geom
    import ifcopenshell.util.unit

    progress.update(0.0, "Reading the model")
    file = open_ifc(source)
    products = physical_products(file)
    if not products:
        raise BimVerifyError(f"{source} has no physical element with a shape, so there is nothing to verify.")
    _check_placements(source, products)
    shapes = _run_iterator(file, products, deflection, threads, progress)
    skipped = tuple(
        f"{p.is_a()} {p.GlobalId} ({p.Name or 'unnamed'}) has a shape but no body that could be made into a surface."
        for p in products
        if p.id() not in shapes and not _shown_by_parts(p, shapes)
    )
    present = [p for p in products if p.id() in shapes]
    if not present:
        raise BimVerifyError(f"{source} has no element with a solid or surface body, so there is nothing to verify.")
    vertices, triangles, owner, transparent, origin = _join(present, shapes)
    triangles, owner, transparent, closed = orient_outward(vertices, triangles, owner, transparent, len(present))
    return BuildingModel(
        path=str(source),
        content_hash=content_hash,
        schema=_schema(file),
        length_unit_m=float(ifcopenshell.util.unit.calculate_unit_scale(file)),
        origin=origin,
        elements=tuple(_describe(p) for p in present),
        vertices=vertices,
        triangles=triangles,
        triangle_element=owner,
        closed=closed,
        transparent=transparent,
        map_conversion=_map_conversion(file),
        skipped=skipped,
        project_name=next((p.Name or "" for p in file.by_type("IfcProject")), ""),
        project_id=next((p.GlobalId or "" for p in file.by_type("IfcProject")), ""),
        partly=tuple(
            c for c in sorted({p.is_a() for p in present})
            if any(p.id() not in shapes for p in file.by_type(c, include_subtypes=False))
        ),
    )


def _shown_by_parts(product: Any, shapes: dict[int, list[_Shape]]) -> bool:
    """Whether a product without a body of its own (a layered wall, a stair, a roof) has parts that are verified."""
    import ifcopenshell.util.element

    return any(part.id() in shapes for part in ifcopenshell.util.element.get_decomposition(product))


@dataclass(frozen=True)
class _Shape:
    vertices: NDArray[np.float64]
    """(V, 3) metres, frame of the placement."""
    triangles: NDArray[np.int32]
    transparent: NDArray[np.bool_]
    placement: NDArray[np.float64]
    """(4, 4)"""

    @property
    def world(self) -> NDArray[np.float64]:
        return self.vertices @ self.placement[:3, :3].T + self.placement[:3, 3]


def _run_iterator(
    file: Any, products: list[Any], deflection: float, threads: int, progress: Progress
) -> dict[int, list[_Shape]]:
    """STEP id -> its shapes."""
    import ifcopenshell.geom

    settings = ifcopenshell.geom.settings()
    settings.set("mesher-linear-deflection", deflection)
    settings.set("mesher-angular-deflection", 2.0 * math.acos(1.0 - min(deflection / LARGEST_SMALL_RADIUS_M, 1.0)))
    iterator = ifcopenshell.geom.iterator(settings, file, threads, include=products)
    shapes: dict[int, list[_Shape]] = {}
    if not iterator.initialize():
        return shapes
    while True:
        shape = iterator.get()
        triangles = np.array(shape.geometry.faces, dtype=np.int32).reshape(-1, 3)
        if len(triangles):
            vertices = np.array(shape.geometry.verts, dtype=np.float64).reshape(-1, 3)
            placement = np.array(shape.transformation.matrix, dtype=np.float64).reshape(4, 4, order="F")
            see_through = np.array([m.transparency > SEE_THROUGH for m in shape.geometry.materials] + [False])
            material = np.array(shape.geometry.material_ids, dtype=np.int64)
            transparent = see_through[material] if len(material) == len(triangles) else np.zeros(len(triangles), bool)
            shapes.setdefault(shape.id, []).append(_Shape(vertices, triangles, transparent, placement))
        progress.update(iterator.progress() / 100.0, f"Making surfaces of {len(products)} elements")
        if not iterator.next():
            return shapes


def _join(
    products: list[Any], shapes: dict[int, list[_Shape]]
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.int32], NDArray[np.bool_], NDArray[np.float64]]:
    """All vertices, triangles, owners and transparencies as one array each, in the local frame, and its origin.

    The origin is the rounded middle of the elements' first corners.
    """
    own = [(index, shape) for index, product in enumerate(products) for shape in shapes[product.id()]]
    origin = np.round(np.median([shape.world[0] for _, shape in own], axis=0))
    base = np.cumsum([0] + [len(shape.vertices) for _, shape in own])
    return (
        np.concatenate(
            [s.vertices @ s.placement[:3, :3].T + (s.placement[:3, 3] - origin) for _, s in own]
        ),
        np.concatenate([s.triangles + np.int32(b) for (_, s), b in zip(own, base[:-1], strict=True)]),
        np.concatenate([np.full(len(s.triangles), index, dtype=np.int32) for index, s in own]),
        np.concatenate([s.transparent for _, s in own]),
        origin,
    )


def _describe(product: Any) -> Element:
    import ifcopenshell.util.element as util

    container = util.get_container(product)
    kind = util.get_type(product)
    return Element(
        global_id=product.GlobalId,
        step_id=product.id(),
        ifc_class=product.is_a(),
        name=product.Name or "",
        storey=(container.Name or container.is_a()) if container else "",
        type_name=(kind.Name or "") if kind else "",
    )


def _schema(file: Any) -> str:
    return "IFC4X3" if file.schema.startswith("IFC4X3") else str(file.schema)


def _map_conversion(file: Any) -> MapConversion | None:
    """IfcMapConversion (IFC4 and later), offsets in metres whatever the file's unit."""
    if file.schema.startswith("IFC2X3"):
        return None
    import ifcopenshell.util.unit

    unit = float(ifcopenshell.util.unit.calculate_unit_scale(file))
    for conversion in file.by_type("IfcMapConversion"):
        crs = conversion.TargetCRS
        map_unit_m = _map_unit(crs, unit)
        declared = conversion.Scale if conversion.Scale else map_scale_default(unit, map_unit_m)
        offset = np.array([conversion.Eastings, conversion.Northings, conversion.OrthogonalHeight or 0.0]) * map_unit_m
        angle = math.atan2(conversion.XAxisOrdinate or 0.0, conversion.XAxisAbscissa or 1.0)
        return MapConversion(offset, angle, declared * map_unit_m / unit, (crs.Name or "") if crs else "")
    return None


def map_scale_default(unit_m: float, map_unit_m: float) -> float:
    """The Scale that turns file units into map units when the file leaves it out."""
    return unit_m / map_unit_m


def _map_unit(crs: Any, unit: float) -> float:
    import ifcopenshell.util.unit

    map_unit = getattr(crs, "MapUnit", None)
    if map_unit is None:
        return unit
    prefix = ifcopenshell.util.unit.get_prefix_multiplier(getattr(map_unit, "Prefix", None))
    if map_unit.is_a("IfcConversionBasedUnit"):
        factor = map_unit.ConversionFactor
        return float(factor.ValueComponent.wrappedValue)
    return float(prefix)
