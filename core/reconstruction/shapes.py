"""Elements of an IFC file as upright boxes: middle, direction, length, width, height."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..model.load import open_ifc

Array = NDArray[np.float64]

CLASSES = {
    "walls": ("IfcWall",), "columns": ("IfcColumn",), "openings": ("IfcOpeningElement",), "doors": ("IfcDoor",),
    "windows": ("IfcWindow",), "spaces": ("IfcSpace",), "slabs": ("IfcSlab",),
}
UPRIGHT = 0.1
ROUND = 0.05
PSET_NAME = "BimVerify_Reconstruction"
HIDDEN_EDGES = "HiddenEdges"
"""Property of openings, doors and windows: names of the edges that were not seen."""
HIDDEN_FACES = "HiddenFaces"
"""Property of columns: names of the sides that were not seen."""
HEIGHT_SOURCE = "HeightSource"
"""Property of walls, columns and spaces: whether their height was measured."""
EDGE_SIGMAS = ("StartEdgeSigma", "EndEdgeSigma", "SillSigma", "HeadSigma")
"""Properties of the same: standard deviation of each edge, in the file's unit of length."""


@dataclass(frozen=True)
class Shape:
    """One element; metres, model frame."""

    global_id: str
    name: str
    middle: Array
    """(3,) of its box."""
    along: Array
    """(2,) unit vector of its length in plan."""
    length: float
    width: float
    height: float
    storey: str = ""
    round: bool = False
    """Its plan has no direction of its own: ``along`` says nothing, length and width are its diameter."""
    host: str = ""
    """GlobalId of the wall that an opening is in."""
    hidden: tuple[str, ...] = ()
    """Edges that its reconstruction did not see: start, end, sill, head."""
    edge_sigma: tuple[float, ...] = ()
    """Standard deviation of each of these edges [m], where its reconstruction says so."""

    @property
    def across(self) -> Array:
        """(2,) unit vector."""
        return np.array([-self.along[1], self.along[0]])


class Shapes(dict[str, list[Shape]]):
    """Elements by class, and what is not among them."""

    def __init__(self) -> None:
        super().__init__()
        self.left_out: dict[str, int] = {}
        """How many elements are not compared, by what they are."""

    def leave_out(self, what: str) -> None:
        """Count one more."""
        self.left_out[what] = self.left_out.get(what, 0) + 1


def read_shapes(path: str | Path) -> Shapes:
    """All elements of the classes compared. Raises BimVerifyError when the file cannot be read."""
    return shapes_of(open_ifc(Path(path)), str(path))


def shapes_of(file: Any, name: str = "") -> Shapes:
    """The same of an open file."""
    import ifcopenshell.util.element
    import ifcopenshell.util.unit

    metre = float(ifcopenshell.util.unit.calculate_unit_scale(file))
    out = Shapes()
    walls: dict[str, Shape] = {}
    # layers, studs, walls: what an element without a body of its own is made of is compared as that element
    parts = {
        e.GlobalId: ifcopenshell.util.element.get_parts(e) for classes in CLASSES.values() for c in classes
        for e in file.by_type(c) if e.Representation is None and c != "IfcSpace"
    }  # fmt: skip
    inner = {p.GlobalId for own in parts.values() for p in own}
    for kind, classes in CLASSES.items():
        out[kind] = []
        for product in (p for c in classes for p in file.by_type(c)):
            host = ""
            if kind == "openings":
                if not product.VoidsElements or not product.VoidsElements[0].RelatingBuildingElement.is_a("IfcWall"):
                    out.leave_out("openings that are in no wall")
                    continue
                host = product.VoidsElements[0].RelatingBuildingElement.GlobalId
            body = product
            if kind in ("doors", "windows") and product.FillsVoids:
                # a leaf may stand open: the opening says where the door is
                body = product.FillsVoids[0].RelatingOpeningElement
                host = body.VoidsElements[0].RelatingBuildingElement.GlobalId if body.VoidsElements else ""
            if product.GlobalId in inner:
                continue
            vertices, triangles = _joined([_mesh(p) for p in parts.get(body.GlobalId, [body])])
            if not len(triangles):
                out.leave_out(f"{kind} without a shape")
                continue
            found = _box(product, vertices, triangles, walls.get(host), metre)
            out[kind].append(found)
            if kind == "walls":
                walls[product.GlobalId] = found
    for _ in file.by_type("IfcCurtainWall"):
        out.leave_out("curtain walls")
    if not any(out.values()):
        raise BimVerifyError(f"{name} holds no wall, opening, column, slab or space with a shape, to compare.")
    return out


def _mesh(product: Any) -> tuple[Array, NDArray[np.int64]]:
    """(V, 3) vertices [m] and (T, 3) triangles in the world; none without a body."""
    import ifcopenshell.geom

    settings = ifcopenshell.geom.settings()
    settings.set("use-world-coords", True)
    try:
        shape: Any = ifcopenshell.geom.create_shape(settings, product)
    except RuntimeError:
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    vertices = np.array(shape.geometry.verts, dtype=np.float64).reshape(-1, 3)
    return vertices, np.array(shape.geometry.faces, dtype=np.int64).reshape(-1, 3)


def _joined(bodies: list[tuple[Array, NDArray[np.int64]]]) -> tuple[Array, NDArray[np.int64]]:
    first = np.cumsum([0] + [len(vertices) for vertices, _ in bodies])
    if not bodies:
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    triangles = [t + k for (_, t), k in zip(bodies, first, strict=False)]
    return np.concatenate([v for v, _ in bodies]), np.concatenate(triangles)


def _box(product: Any, vertices: Array, triangles: NDArray[np.int64], host: Shape | None, metre: float) -> Shape:
    corner = vertices[triangles]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    area = np.linalg.norm(normal, axis=1) / 2
    normal /= np.maximum(2 * area[:, None], 1e-15)
    side = (np.abs(normal[:, 2]) < UPRIGHT) & (area > 1e-9)
    if host is not None:
        along = host.along
    elif side.any():
        angle = np.arctan2(normal[side, 1], normal[side, 0])
        # most of the area faces across the length
        bins = np.round((angle % np.pi) / np.radians(0.5)).astype(np.int64) % 360
        weight = np.bincount(bins, area[side], 360)
        best = int(np.argmax(weight + np.roll(weight, 1) + np.roll(weight, -1)))
        own = np.minimum((bins - best) % 360, (best - bins) % 360) <= 1
        doubled = (np.exp(2j * angle[own]) * area[side][own]).sum()
        turn = float(np.angle(doubled) / 2)
        along = np.array([-np.sin(turn), np.cos(turn)])
        along = along if float(along @ _axis(product)) >= 0 else -along
    else:
        along = np.array([1.0, 0.0])
    across = np.array([-along[1], along[0]])
    used = vertices[np.unique(triangles)]
    if host is None and side.any() and _is_round(normal[side, :2], area[side]):
        middle = used[:, :2].mean(axis=0)
        wide = 2 * float(np.linalg.norm(used[:, :2] - middle, axis=1).max())
        return Shape(
            product.GlobalId, product.Name or "", np.append(middle, 0.5 * (used[:, 2].max() + used[:, 2].min())),
            np.array([1.0, 0.0]), wide, wide, float(np.ptp(used[:, 2])), _storey(product), True,
        )
    u, v = used[:, :2] @ along, used[:, :2] @ across
    length, width = float(np.ptp(u)), float(np.ptp(v))
    middle = 0.5 * (u.max() + u.min()) * along + 0.5 * (v.max() + v.min()) * across
    if host is not None:
        # an opening's body may reach out of its wall: only what lies in the wall counts
        middle = middle + ((host.middle[:2] - middle) @ across) * across
        width = min(width, host.width)
    z = used[:, 2]
    return Shape(
        product.GlobalId, product.Name or "", np.append(middle, 0.5 * (z.max() + z.min())), along, length, width,
        float(np.ptp(z)), _storey(product), False, host.global_id if host else "", *_edges(product, metre),
    )


def _is_round(normal: Array, area: Array) -> bool:
    """Whether an outline faces all directions alike, by the second and fourth harmonic of where it faces."""
    angle = np.arctan2(normal[:, 1], normal[:, 0])
    return all(abs((area * np.exp(1j * k * angle)).sum()) < ROUND * area.sum() for k in (2, 4))


def _storey(product: Any) -> str:
    """Name of the storey that it stands in; empty in none."""
    import ifcopenshell.util.element

    storey = ifcopenshell.util.element.get_container(product, ifc_class="IfcBuildingStorey")
    return str(storey.Name or "") if storey is not None else ""


def _axis(product: Any) -> Array:
    """(2,) x axis of the product in plan: a wall's start and end are named along it."""
    import ifcopenshell.util.placement

    return np.asarray(ifcopenshell.util.placement.get_local_placement(product.ObjectPlacement)[:2, 0], dtype=np.float64)


def _edges(product: Any, metre: float) -> tuple[tuple[str, ...], tuple[float, ...]]:
    """Names of the hidden edges, and the standard deviations of all [m]."""
    import ifcopenshell.util.element

    said = ifcopenshell.util.element.get_pset(product, PSET_NAME) or {}
    text = said.get(HIDDEN_EDGES)
    sigmas = tuple(float(said[name]) * metre for name in EDGE_SIGMAS if said.get(name) is not None)
    hidden = tuple(text.split(", ")) if isinstance(text, str) and text != "none" else ()
    return hidden, sigmas if len(sigmas) == len(EDGE_SIGMAS) else ()
