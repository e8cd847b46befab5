"""A small house of boxes and scans of it as it was built: for tests of the whole way from returns to verdicts.

Two rooms side by side, 6 m x 4 m each, under one ceiling slab; a suspended ceiling hangs in the first one. Everything is
given as boxes in metres; what is built otherwise than planned is named by ``Edit``s.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from bim_verify.core.jobs import verify
from bim_verify.core.model.elements import BuildingModel, Element
from bim_verify.core.options import VerifyOptions
from bim_verify.core.results import ElementVerdict, VerificationResult
from bim_verify.core.scans.campaign import Station
from bim_verify.core.simulation.box_building import ArraySource
from bim_verify.core.simulation.scanner import Scanner, scan_station
from bim_verify.core.simulation.scene import Edit, Prop, Scene

PLAN: dict[str, tuple[str, tuple[float, float, float], tuple[float, float, float]]] = {
    "floor": ("IfcSlab", (-0.2, -0.2, -0.3), (12.4, 4.2, 0.0)),
    "slab": ("IfcSlab", (-0.2, -0.2, 3.0), (12.4, 4.2, 3.25)),
    "ceiling": ("IfcCovering", (0.0, 0.0, 2.7), (6.0, 4.0, 2.72)),
    "west": ("IfcWall", (-0.2, -0.2, 0.0), (0.0, 4.2, 3.0)),
    "east": ("IfcWall", (12.2, -0.2, 0.0), (12.4, 4.2, 3.0)),
    "south": ("IfcWall", (0.0, -0.2, 0.0), (12.2, 0.0, 3.0)),
    "north": ("IfcWall", (0.0, 4.0, 0.0), (12.2, 4.2, 3.0)),
    "partition": ("IfcWall", (6.0, 0.0, 0.0), (6.2, 4.0, 3.0)),
    "column": ("IfcColumn", (4.2, 2.6, 0.0), (4.5, 2.9, 2.7)),
    "cupboard": ("IfcFurniture", (1.0, 3.4, 0.0), (2.2, 4.0, 2.0)),
    "plate": ("IfcPlate", (0.8, 0.6, 0.9), (2.0, 1.2, 0.93)),
    "post": ("IfcColumn", (9.4, 2.2, 0.0), (9.6, 2.4, 3.0)),
    "valve": ("IfcValve", (10.9, 3.7, 0.3), (11.1, 3.9, 0.5)),
    "buried": ("IfcFooting", (2.0, 1.0, -1.0), (3.0, 2.0, -0.5)),
}
"""Name -> class, lowest and highest corner [m]."""

STATIONS = np.array([[2.4, 1.9, 1.5], [4.9, 1.2, 1.35], [3.4, 3.3, 1.6], [8.0, 1.4, 1.5], [11.0, 2.8, 1.4]])
SCANNER = Scanner(
    "test", math.radians(1.0), sigma_range=0.0012, sigma_signal=0.0002, sigma_angle=2e-5, beam_exit_diameter=0.003
)
OPTIONS = VerifyOptions(sigma=0.0013, sample_spacing=0.2)


def house(origin: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> BuildingModel:
    """As planned; local frame as in PLAN, ``origin`` its place in the model frame."""
    shapes = [_box(low, high) for _, low, high in PLAN.values()]
    corners = np.concatenate(shapes)
    return BuildingModel(
        path="house.ifc", content_hash="", schema="IFC4", length_unit_m=1.0, origin=np.array(origin),
        elements=tuple(Element(f"{name:_<22}", k, kind, name, "Ground") for k, (name, (kind, *_)) in enumerate(PLAN.items())),
        vertices=corners.reshape(-1, 3),
        triangles=np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3),
        triangle_element=np.repeat(np.arange(len(shapes), dtype=np.int32), [len(s) for s in shapes]),
        closed=np.ones(len(shapes), dtype=np.bool_),
        transparent=np.zeros(len(corners), dtype=np.bool_),
    )  # fmt: skip


def _box(low: tuple[float, float, float], high: tuple[float, float, float]) -> np.ndarray:
    """(12, 3, 3) outward triangles."""
    a, b = np.array(low), np.array(high)
    middle, size = (a + b) / 2, b - a
    return Prop("", "box", tuple(middle.tolist()), tuple(size.tolist())).corners()


def shifted(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Edit:
    length = math.hypot(x, y, z)
    return Edit("shift", length, (x / length, y / length, z / length))


REMOVED = Edit("remove")


def built(
    edits: Mapping[str, Edit], props: tuple[Prop, ...] = (), shapes: Mapping[str, tuple[Any, ...]] | None = None
) -> Scene:
    """As built. ``shapes`` replaces an element by other boxes (low, high)."""
    corners, owner = [], []
    for row, (name, (_, low, high)) in enumerate(PLAN.items()):
        edit = edits.get(name)
        if edit is not None and edit.kind == "remove":
            continue
        for a, b in (shapes or {}).get(name, ((low, high),)):
            corners.append(_box(a, b) + (edit.vector if edit else 0.0))
            owner.append(np.full(len(corners[-1]), row, dtype=np.int32))
    for k, prop in enumerate(props):
        corners.append(prop.corners())
        owner.append(np.full(len(corners[-1]), len(PLAN) + k, dtype=np.int32))
    return Scene(np.concatenate(corners), np.concatenate(owner), [*PLAN, *(p.name for p in props)])


def scan(
    scene: Scene, *, stations: np.ndarray = STATIONS, pose_noise: float = 0.0, seed: int = 1, scanner: Scanner = SCANNER,
    origin: np.ndarray | None = None,
) -> ArraySource:
    """Returns in the frame of ``origin`` (3,); recorded positions are off by ``pose_noise`` [m] per axis."""
    random = np.random.default_rng((seed, 77))
    origin = np.zeros(3) if origin is None else origin
    found, offsets = [], []
    for k, position in enumerate(stations):
        off = random.normal(0.0, 1.0, 3) * pose_noise
        returns = scan_station(scene, position, np.eye(3), scanner, seed * 1000 + k)
        found.append(Station(f"S{k}", position + off + origin, acquired="2024-05-14T09:00:00"))
        offsets.append(np.round(returns.offset, 5))
    return ArraySource(tuple(found), tuple(offsets))


def verified(source: Any, model: BuildingModel | None = None, **options: Any) -> VerificationResult:
    return verify(model or house(), source, dataclasses.replace(OPTIONS, **options))


def by_name(result: VerificationResult) -> dict[str, ElementVerdict]:
    return {v.name: v for v in result.verdicts}


