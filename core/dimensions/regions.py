"""Where the rooms and the openings of an IFC file are: their outline in plan and their heights."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely import MultiPolygon, Polygon, contains_xy, union_all

from ..model.load import open_ifc

Array = NDArray[np.float64]

LEAST_AREA_M2 = 1e-6


@dataclass(frozen=True)
class Region:
    """An upright body. Metres, local frame of the model."""

    global_id: str
    name: str
    outline: Polygon | MultiPolygon
    low: float
    high: float
    host: str = ""
    """GlobalId of the element that an opening is in."""
    fillings: tuple[str, ...] = ()
    """GlobalIds of the doors and windows in an opening."""
    volume: float = 0.0
    """m3; less than that of the outline between the two heights where the body is no prism, as of a round window."""

    def holds(self, points: Array, by: float = 0.0) -> NDArray[np.bool_]:
        """(N,) whether (N, 3) points lie in it, or nearer than ``by`` metres."""
        shape = self.outline.buffer(by, join_style="mitre") if by else self.outline
        z = points[:, 2]
        inside = np.asarray((z > self.low - by) & (z < self.high + by))
        inside[inside] = contains_xy(shape, points[inside, 0], points[inside, 1])
        return inside


def read_regions(path: str | Path, origin: Array) -> tuple[list[Region], list[Region]]:
    """(spaces, openings) of an IFC file in the frame model - ``origin``; products without a body are left out."""
    file = open_ifc(path)
    openings = []
    for product in file.by_type("IfcOpeningElement"):
        voids = product.VoidsElements
        host = voids[0].RelatingBuildingElement.GlobalId if voids else ""
        openings.append((product, host, tuple(r.RelatedBuildingElement.GlobalId for r in product.HasFillings)))
    return (
        [r for p in file.by_type("IfcSpace") if (r := region_of(p, origin)) is not None],
        [r for p, host, fill in openings if host and (r := region_of(p, origin, host, fill)) is not None],
    )


def region_of(product: Any, origin: Array, host: str = "", fillings: tuple[str, ...] = ()) -> Region | None:
    """Of one product; None without a body."""
    import ifcopenshell.geom

    settings = ifcopenshell.geom.settings()
    settings.set("use-world-coords", True)
    if not product.Representation:
        return None
    try:
        shape: Any = ifcopenshell.geom.create_shape(settings, product)
    except RuntimeError:
        return None
    vertices = np.array(shape.geometry.verts, dtype=np.float64).reshape(-1, 3) - origin
    triangles = np.array(shape.geometry.faces, dtype=np.int64).reshape(-1, 3)
    flat = [Polygon(vertices[t, :2]) for t in triangles]
    outline = union_all([p for p in flat if p.area > LEAST_AREA_M2])
    if not isinstance(outline, Polygon | MultiPolygon) or outline.is_empty:
        return None
    name = " ".join(str(v) for v in (product.Name, getattr(product, "LongName", None)) if v)
    return Region(
        product.GlobalId, name or "(no name)", outline, float(vertices[:, 2].min()),
        float(vertices[:, 2].max()), host, fillings, abs(float(np.linalg.det(vertices[triangles]).sum())) / 6.0,
    )
