"""A small model in memory: a room of slabs and walls with a cupboard, for tests of the simulation."""

from __future__ import annotations

import numpy as np

from bim_verify.core.model.elements import BuildingModel, Element
from bim_verify.core.simulation.scene import Prop

BOXES: tuple[tuple[str, str, tuple[float, float, float], tuple[float, float, float]], ...] = (
    ("floor", "IfcSlab", (0.0, 0.0, -0.1), (6.0, 5.0, 0.2)),
    ("roof", "IfcSlab", (0.0, 0.0, 2.8), (6.0, 5.0, 0.2)),
    ("west", "IfcWall", (-2.9, 0.0, 1.35), (0.2, 5.0, 2.7)),
    ("east", "IfcWall", (2.9, 0.0, 1.35), (0.2, 5.0, 2.7)),
    ("south", "IfcWall", (0.0, -2.4, 1.35), (5.6, 0.2, 2.7)),
    ("north", "IfcWall", (0.0, 2.4, 1.35), (5.6, 0.2, 2.7)),
    ("cupboard", "IfcFurniture", (2.4, 1.0, 0.9), (0.5, 1.2, 1.8)),
    ("buried", "IfcFooting", (0.0, 0.0, -0.6), (1.0, 1.0, 0.4)),
)
ORIGIN = np.array([100.0, 200.0, 10.0])


def room() -> BuildingModel:
    """Closed boxes; the model frame is the local frame moved by ORIGIN."""
    shapes = [Prop("", "box", center, size).corners() for _, _, center, size in BOXES]
    corners = np.concatenate(shapes)
    count = len(corners)
    return BuildingModel(
        path="room.ifc",
        content_hash="",
        schema="IFC4",
        length_unit_m=1.0,
        origin=ORIGIN,
        elements=tuple(Element(f"{name:_<22}", i, kind, name, "Ground") for i, (name, kind, _, _) in enumerate(BOXES)),
        vertices=corners.reshape(-1, 3),
        triangles=np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        triangle_element=np.repeat(np.arange(len(shapes), dtype=np.int32), [len(s) for s in shapes]),
        closed=np.ones(len(shapes), dtype=np.bool_),
        transparent=np.zeros(count, dtype=np.bool_),
    )


def row_of(name: str) -> int:
    """Row of an element by name."""
    return [box[0] for box in BOXES].index(name)
