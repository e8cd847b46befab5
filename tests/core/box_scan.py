"""Boxes as a building, scanned and reconstructed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from bim_verify.core.jobs import reconstruct
from bim_verify.core.model.load import load_model
from bim_verify.core.reconstruction.building import Reconstruction
from bim_verify.core.simulation.campaign import Campaign, scan_to_files, set_up
from bim_verify.core.simulation.house_builder import HouseBuilder, prism
from bim_verify.core.simulation.scanner import PRESETS

Box = tuple[float, float, float, float, float, float]
"""Low x, y, z and high x, y, z [m]."""
WALL_M = 0.3


def walls_around(wide: float, deep: float, low: float, high: float) -> list[Box]:
    """Four walls WALL_M thick about a room from 0, 0 [m]."""
    t = WALL_M
    return [
        (-t, -t, low, wide + t, 0.0, high), (-t, deep, low, wide + t, deep + t, high), (-t, 0.0, low, 0.0, deep, high),
        (wide, 0.0, low, wide + t, deep, high),
    ]


def scanned(
    folder: Path, walls: Sequence[Box], slabs: Sequence[Box], stations: Sequence[tuple[float, float, float]],
    step_deg: float = 0.5,
) -> Reconstruction:
    """What is found in scans of a building of walls and slabs, 2 mm noise, exact poses."""
    builder = HouseBuilder("IFC4")
    storey = builder.storey("All", 0.0)
    for kind, boxes in (("IfcWall", walls), ("IfcSlab", slabs)):
        for k, (x0, y0, z0, x1, y1, z1) in enumerate(boxes):
            corners = [(1000 * x, 1000 * y) for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))]
            builder.add(kind, f"{kind} {k}", [prism(corners, "z", 1000 * z0, 1000 * (z1 - z0), "concrete")], storey)
    builder.write(folder / "boxes.ifc")
    model = load_model(folder / "boxes.ifc", cache=False)
    scanner = replace(PRESETS["fast"], angular_step=float(np.radians(step_deg)), sigma_range=0.002, sigma_signal=0.0)
    set_ups = tuple(set_up(f"S{k}", np.array(p) - model.origin, 3, k) for k, p in enumerate(stations))
    scan_to_files(Campaign(model, scanner, set_ups, {}, (), 3), folder / "boxes.e57", None)
    return reconstruct([folder / "boxes.e57"])
