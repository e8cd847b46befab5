"""A room with a window as an IFC file, and a scan of it as it was built: one wall stands off."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from bim_verify.core.model.load import load_model
from bim_verify.core.simulation.campaign import Campaign, scan_to_files, set_up
from bim_verify.core.simulation.scanner import PRESETS
from bim_verify.core.simulation.scene import Edit

from .model_files import ModelFile, at

OUT_M = 0.015
"""The north wall stands this far off."""
WIDE, DEEP, HIGH = 4.0, 3.0, 2.5


def write_room(folder: Path) -> None:
    """``room.ifc``, 1000 km away, in feet and turned, its space named ``=1+1``; ``room.e57``, scanned twice."""
    made = ModelFile("IFC4", "foot")
    base = at(800_000.0, 600_000.0, 90.0, 25.0)
    thick = 0.25
    made.product("IfcSlab", "floor", made.box(WIDE + 0.5, DEEP + 0.5, 0.2), base @ at(-0.25, -0.25, -0.2))
    made.product("IfcSlab", "slab", made.box(WIDE + 0.5, DEEP + 0.5, 0.2), base @ at(-0.25, -0.25, HIGH))
    walls = {
        "south": ((WIDE, thick), (0.0, -thick)), "north": ((WIDE, thick), (0.0, DEEP)),
        "west": ((thick, DEEP), (-thick, 0.0)), "east": ((thick, DEEP), (WIDE, 0.0)),
    }
    things = {
        name: made.product("IfcWall", name, made.box(*size, HIGH), base @ at(*place)) for name, (size, place) in walls.items()
    }
    made.opening(things["south"], made.box(1.2, thick + 0.2, 1.1), base @ at(1.5, -thick - 0.1, 0.9))
    made.product("IfcSpace", "=1+1", made.box(WIDE, DEEP, HIGH), base, into=False)
    made.file.write(str(folder / "room.ifc"))
    model = load_model(folder / "room.ifc", cache=False)
    off = base[:3, :3] @ np.array([0.0, 1.0, 0.0])
    row = [e.global_id for e in model.elements].index(things["north"].GlobalId)
    edits = {row: Edit("shift", OUT_M, tuple(off.tolist()))}
    stations = [base @ np.array([*p, 1.0]) for p in ((1.3, 1.4, 1.5), (2.8, 1.9, 1.4))]
    set_ups = tuple(set_up(f"S{k}", p[:3] - model.origin, 5, k) for k, p in enumerate(stations))
    scanner = replace(PRESETS["fast"], angular_step=float(np.radians(0.5)), sigma_range=0.001, sigma_signal=0.0)
    scan_to_files(Campaign(model, scanner, set_ups, edits, (), 5), folder / "room.e57", None)
