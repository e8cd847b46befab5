"""The built-in demo: a small house, a scan of it as it was built, and the truth about the differences."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..files import make_folder
from ..model.elements import BuildingModel
from ..model.load import load_model
from ..progress import Progress
from .campaign import Campaign, scan_to_files, set_up
from .house import write_demo_house
from .scanner import PRESETS
from .scene import Edit, Glass, Prop, Unevenness

STEP_DEG = 0.3
MISSING = ("Balcony railing west", "Canopy post west", "Hall ceiling", "Chair 3", "Single bed")
MOVED: dict[str, tuple[float, tuple[float, float, float]]] = {
    "Living room wall": (0.035, (1.0, 0.0, 0.0)),
    "Kitchen wall": (0.005, (0.0, 1.0, 0.0)),
    "Bathroom wall": (-0.025, (1.0, 0.0, 0.0)),
    "Terrace column 2": (0.06, (1.0, 0.0, 0.0)),
    "Living room beam": (-0.02, (0.0, 0.0, 1.0)),
    "Kitchen ceiling": (-0.03, (0.0, 0.0, 1.0)),
    "Duct 2": (-0.045, (0.0, 0.0, 1.0)),
    "Balcony door": (0.022, (0.0, 1.0, 0.0)),
    "Wardrobe": (0.12, (0.0, -1.0, 0.0)),
    "Heat pump": (0.05, (1.0, 0.0, 0.0)),
}
"""Name -> offset [m] and direction. The footings and what stands behind furniture are hidden: nobody can say."""
NEW: tuple[Prop, ...] = (
    Prop("Removal box", "box", (1.35, 3.3, 0.21), (0.6, 0.4, 0.4), 0.1),
    Prop("Pallet of tiles", "box", (-2.2, 4.0, 0.39), (1.2, 0.8, 0.9), 0.3),
    Prop("Tool chest", "box", (8.3, 4.62, 0.26), (0.7, 0.4, 0.5)),
    Prop("Crate", "box", (9.2, 2.0, 3.25), (0.6, 0.6, 0.58), 0.2),
    Prop("Site manager", "person", (3.0, -4.6, 0.83), (0.32, 0.5, 1.76), 0.7),
)
"""Things that are not in the model; model frame, metres."""
STATIONS: tuple[tuple[str, tuple[float, float, float]], ...] = (
    ("Garden south", (5.6, -6.9, 1.55)),
    ("Garden east", (13.6, -0.5, 1.55)),
    ("Garden north", (9.5, 11.9, 1.55)),
    ("Garden west", (-4.4, 9.0, 1.55)),
    ("Living room", (3.1, 3.1, 1.5)),
    ("Kitchen", (7.9, 1.9, 1.5)),
    ("Hall", (7.6, 5.9, 1.5)),
    ("Upper corridor", (5.6, 5.3, 4.45)),
    ("Bedroom west", (3.3, 2.3, 4.45)),
    ("Bedroom east", (6.6, 2.2, 4.45)),
    ("Balcony", (2.6, -1.4, 4.35)),
)
"""Name and position of the scanner's centre; model frame, metres."""


LATER_ACQUIRED = "2024-06-25T08:30:00"
"""Six weeks after the first epoch."""
LATER_STATIONS = ("Living room", "Kitchen", "Hall", "Upper corridor", "Bedroom west", "Garden west", "Balcony")
"""The second epoch is scanned from these."""
LATER_BUILT = ("Hall ceiling", "Single bed", "Balcony railing west")
LATER_GONE = ("Wardrobe", "Living room beam", "Chair 1")
"""Between the epochs some of what was missing was built, other things were taken away, and the clutter was cleared."""


@dataclass(frozen=True)
class DemoFiles:
    """What ``make_demo`` wrote."""

    model: Path
    scan: Path
    truth: Path
    returns: int


def make_demo(
    folder: str | Path, seed: int = 1, *, glass: Glass = "lossy", progress: Progress | None = None
) -> DemoFiles:
    """Write ``house.ifc``, ``scan.e57`` and ``truth.json`` into ``folder`` (made if missing).

    The house and its changes are always the same; ``seed`` decides noise, headings and registration errors.
    """
    folder = make_folder(folder)
    progress = progress or Progress()
    ifc = folder / "house.ifc"
    write_demo_house(ifc)
    model = load_model(ifc, progress=progress.part(0.0, 0.15))
    found = scan_to_files(
        demo_campaign(model, seed, glass=glass), folder / "scan.e57", folder / "truth.json",
        progress=progress.part(0.15, 1.0),
    )
    return DemoFiles(ifc, found.scan_path, folder / "truth.json", found.returns)


def make_later_epoch(folder: str | Path, seed: int = 1, *, progress: Progress | None = None) -> Path:
    """Write ``scan_later.e57`` and ``truth_later.json`` beside the files of ``make_demo``; returns the scan's path."""
    folder = Path(folder)
    model = load_model(folder / "house.ifc")
    first = demo_campaign(model, seed)
    row = {element.name: index for index, element in enumerate(model.elements)}
    edits = {k: v for k, v in first.edits.items() if model.elements[k].name not in LATER_BUILT}
    edits |= {row[name]: Edit("remove") for name in LATER_GONE if name in row}
    later = dataclasses.replace(
        first, edits=edits, props=(), seed=seed + 1, acquired=LATER_ACQUIRED,
        set_ups=tuple(
            dataclasses.replace(s, name=f"{s.name}, later") for s in first.set_ups if s.name in LATER_STATIONS
        ),
    )
    found = scan_to_files(
        later, folder / "scan_later.e57", folder / "truth_later.json", progress=progress or Progress()
    )
    return found.scan_path


def demo_campaign(model: BuildingModel, seed: int, *, glass: Glass = "lossy") -> Campaign:
    """The demo's stations and changes for the demo house."""
    row = {element.name: index for index, element in enumerate(model.elements)}
    edits = {row[name]: Edit("remove") for name in MISSING}
    edits |= {row[name]: Edit("shift", offset, direction) for name, (offset, direction) in MOVED.items()}
    x, y, z = (float(v) for v in model.origin)
    pose_noise = (0.0008, 3e-5)
    return Campaign(
        model=model,
        scanner=dataclasses.replace(PRESETS["fast"], name="demo", angular_step=math.radians(STEP_DEG)),
        set_ups=tuple(
            set_up(name, np.array(position) - model.origin, seed, index, pose_noise)
            for index, (name, position) in enumerate(STATIONS)
        ),
        edits=edits,
        props=tuple(
            dataclasses.replace(p, center=(p.center[0] - x, p.center[1] - y, p.center[2] - z)) for p in NEW
        ),
        seed=seed,
        pose_noise=pose_noise,
        glass=glass,
        unevenness=Unevenness(0.0005, 0.6, seed),
    )
