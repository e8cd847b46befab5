"""Two scans of a panelled wall that moved between them, and its IFC model: what docs/displacement.md walks through.

Five columns of four panels. Each epoch has two stations, in other places in the later one. Column 2 has settled 12 mm,
column 3 leans, column 4 moved 8 mm out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import ifcopenshell.api.context
import ifcopenshell.api.geometry
import ifcopenshell.api.project
import ifcopenshell.api.root
import ifcopenshell.api.spatial
import ifcopenshell.api.unit
import numpy as np

from ..files import make_folder, whole_file
from ..scans.campaign import ReturnBlock, Station
from ..scans.write_e57 import write_e57
from .panel_wall import PanelMove, WallDesign, build_wall, leaning, uniform
from .scanner import PRESETS
from .wall_scan import scan_window

DESIGN = WallDesign(columns=5)
SCANNER = replace(PRESETS["fine"], angular_step=float(np.radians(0.06)), sigma_range=0.001)
STATIONS = {"base": ((-2.0, 7.0, 1.75), (2.5, 8.0, 1.75)), "later": ((-3.0, 8.0, 1.7), (1.5, 6.5, 1.8))}
GUID = "0bVerifyWa11Examp1e000"


def write_wall_example(folder: str | Path) -> Path:
    """``base.e57``, ``later.e57`` and ``wall.ifc`` (its wall has the GlobalId ``GUID``) in ``folder``, made if missing."""
    folder = make_folder(folder)
    _write_scans(folder)
    _write_model(folder / "wall.ifc")
    return folder


def _moves() -> dict[int, Sequence[PanelMove]]:
    """What each column did."""
    return {
        2: uniform(DESIGN, vertical=-0.012), 3: leaning(DESIGN, np.radians([0.3, 0.3, 0.15, 0.0]).tolist()),
        4: uniform(DESIGN, lateral=0.008),
    }


def _write_scans(folder: Path) -> None:
    half, top = 0.5 * DESIGN.columns * (DESIGN.panel_width + DESIGN.joint), DESIGN.rows * (DESIGN.panel_height + DESIGN.joint)
    low, high = np.array([-half, -0.2, 0.0]), np.array([half, 0.0, top])
    for seed, (name, places) in enumerate(STATIONS.items()):
        scene = build_wall(DESIGN, _moves() if name == "later" else None)
        stations = [Station(f"{name} {k + 1}", np.array(place)) for k, place in enumerate(places)]
        blocks = [
            ReturnBlock(k, scan_window(scene, s.position, low, high, SCANNER, seed=10 * seed + k))
            for k, s in enumerate(stations)
        ]
        write_e57(str(folder / f"{name}.e57"), stations, blocks)


def _write_model(path: Path) -> None:
    """The wall as one IfcWall with a box for a body."""
    api = ifcopenshell.api
    file = api.project.create_file(version="IFC4")
    project = api.root.create_entity(file, ifc_class="IfcProject", name="Wall example")
    api.unit.assign_unit(file, length={"is_metric": True, "raw": "METERS"})
    model = api.context.add_context(file, context_type="Model")
    body = api.context.add_context(
        file, context_type="Model", context_identifier="Body", target_view="MODEL_VIEW", parent=model
    )
    site = api.root.create_entity(file, ifc_class="IfcSite", name="Site")
    wall = api.root.create_entity(file, ifc_class="IfcWall", name="Retaining wall")
    wall.GlobalId = GUID
    api.spatial.assign_container(file, products=[wall], relating_structure=site)
    file.create_entity("IfcRelAggregates", ifcopenshell.guid.new(), None, None, None, project, [site])
    length, height = DESIGN.columns * (DESIGN.panel_width + DESIGN.joint), DESIGN.rows * (DESIGN.panel_height + DESIGN.joint)
    shape = api.geometry.add_wall_representation(file, context=body, length=length, height=height, thickness=DESIGN.thickness)
    api.geometry.assign_representation(file, product=wall, representation=shape)
    matrix = np.eye(4)
    matrix[:3, 3] = (-length / 2, -DESIGN.thickness, 0.0)
    api.geometry.edit_object_placement(file, product=wall, matrix=matrix)
    with whole_file(path) as temporary:
        file.write(str(temporary))
