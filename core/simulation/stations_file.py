"""``stations.json``: where a scanner stands and which scanner it is; and the simulation that follows from it."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..errors import BimVerifyError
from ..files import whole_file
from ..json_in import read_json
from ..model.load import load_model
from ..model.sample_surface import sample_surface
from ..progress import Progress
from .campaign import (
    SAMPLE_SPACING_M,
    SHIFTS_M,
    Campaign,
    WrittenCampaign,
    choose_edits,
    place_props,
    scan_to_files,
    set_up,
)
from .scanner import PRESETS, Scanner
from .scene import Edit, Glass, Prop, Unevenness, build_scene

LARGEST_FILE = 16 * 2**20
MOST_STATIONS = 10_000
FARTHEST_COORDINATE_M = 1e8
LIMITS: dict[str, tuple[float, float]] = {
    "angular_step": (2e-5, 0.2),
    "sigma_range": (0.0, 1.0),
    "sigma_signal": (0.0, 1.0),
    "sigma_angle": (0.0, 0.1),
    "range_min": (0.0, 100.0),
    "range_max": (0.1, 1e4),
    "beam_exit_diameter": (0.0, 0.2),
    "beam_divergence": (0.0, 0.1),
    "range_resolution": (0.0, 100.0),
    "weakest_power": (0.0, 1e3),
    "elevation_min": (-math.pi / 2, math.pi / 2),
    "elevation_max": (-math.pi / 2, math.pi / 2),
}
"""Of what a file may ask for, in radians and metres: a finer step than 2e-5 would never end."""
UNITS = {"_deg": math.pi / 180.0, "_mm": 1e-3}


@dataclass(frozen=True)
class PlannedStation:
    """A set-up as planned: levelled, or with a full ``rotation``."""

    name: str
    position: NDArray[np.float64]
    """(3,) of the scanner's centre, metres, model frame."""
    rotation: NDArray[np.float64] | None = None
    """(3, 3) sensor to model; None: levelled, any heading."""


@dataclass(frozen=True)
class StationPlan:
    """The content of a stations file."""

    stations: tuple[PlannedStation, ...]
    scanner: Scanner | None = None
    """None: the file names no scanner."""


def read_stations(path: str | Path) -> StationPlan:
    """Read a stations file::

        {"scanner": {"preset": "medium", "angular_step_deg": 0.1, "sigma_range_mm": 1.5},
         "stations": [{"name": "hall", "position": [1.0, 2.5, 1.6], "heading_deg": 90.0}, [4.0, 2.5, 1.6]]}

    Positions are metres in the model's frame; a bare position will do. The scanner may be a preset's name, or fields
    of ``Scanner`` (radians, metres; with ``_deg`` or ``_mm`` behind the name, degrees or millimetres). Raises
    BimVerifyError.
    """
    source = Path(path)
    content = read_json(source, "a stations file", LARGEST_FILE)
    entries = content.get("stations") if isinstance(content, dict) else None
    if not isinstance(entries, list) or not entries:
        raise BimVerifyError(f'{source} holds no list of stations; write {{"stations": [{{"position": [x, y, z]}}]}}.')
    if len(entries) > MOST_STATIONS:
        raise BimVerifyError(f"{source} holds {len(entries)} stations; {MOST_STATIONS} is the most.")
    stations = tuple(_station(entry, index, source) for index, entry in enumerate(entries))
    return StationPlan(stations, _scanner(content.get("scanner"), source))


def write_stations(path: str | Path, plan: StationPlan) -> None:
    """Write a stations file that ``read_stations`` gives back unchanged."""
    content: dict[str, Any] = {}
    if plan.scanner is not None:
        content["scanner"] = dataclasses.asdict(plan.scanner)
    content["stations"] = [
        {"name": s.name, "position": s.position.tolist()}
        | ({} if s.rotation is None else {"rotation": s.rotation.tolist()})
        for s in plan.stations
    ]
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(content, indent=1), encoding="utf-8")


def simulate(
    model_path: str | Path,
    stations_path: str | Path,
    out: str | Path,
    truth: str | Path | None = None,
    *,
    scanner: str | None = None,
    seed: int = 0,
    clutter: int = 0,
    people: int = 0,
    remove_share: float = 0.0,
    shift_share: float = 0.0,
    shifts_m: Sequence[float] = SHIFTS_M,
    pose_noise: tuple[float, float] = (0.0, 0.0),
    glass: Glass = "opaque",
    unevenness: float = 0.0,
    threads: int = 0,
    cache: bool = True,
    progress: Progress | None = None,
) -> WrittenCampaign:
    """Scan a model from the stations of a file; write the E57 and, if asked for, the truth per element.

    The model is scanned as planned, unless shares of removed or shifted elements, or clutter, are asked for (see
    ``make_campaign``). ``scanner`` is a preset's name and goes over the file's; without either, "fast". Raises
    BimVerifyError.
    """
    progress = progress or Progress()
    plan = read_stations(stations_path)
    if scanner is not None and scanner not in PRESETS:
        raise BimVerifyError(f"There is no scanner preset {scanner!r}; choose one of {', '.join(PRESETS)}.")
    model = load_model(model_path, threads=threads, cache=cache, progress=progress.part(0.0, 0.2))
    edits: dict[int, Edit] = {}
    if remove_share > 0 or shift_share > 0:
        edits = choose_edits(
            model, sample_surface(model, SAMPLE_SPACING_M), seed=seed,
            remove_share=remove_share, shift_share=shift_share, shifts_m=shifts_m,
        )
    props: tuple[Prop, ...] = ()
    if clutter or people:
        props = place_props(model, build_scene(model, edits, seed=seed), seed=seed, boxes=clutter, people=people)
    campaign = Campaign(
        model=model,
        scanner=PRESETS[scanner] if scanner else plan.scanner or PRESETS["fast"],
        set_ups=tuple(
            set_up(s.name, s.position - model.origin, seed, index, pose_noise, s.rotation)
            for index, s in enumerate(plan.stations)
        ),
        edits=edits,
        props=props,
        seed=seed,
        pose_noise=pose_noise,
        glass=glass,
        unevenness=Unevenness(unevenness, 0.6, seed) if unevenness > 0 else None,
    )
    return scan_to_files(campaign, out, truth, progress=progress.part(0.2, 1.0))


def _station(entry: Any, index: int, source: Path) -> PlannedStation:
    if isinstance(entry, list):
        entry = {"position": entry}
    if not isinstance(entry, dict):
        raise BimVerifyError(f"Station {index + 1} of {source} is neither a position nor an object with one.")
    position = _numbers(entry.get("position"), (3,))
    if position is None or np.abs(position).max() > FARTHEST_COORDINATE_M:
        raise BimVerifyError(f"Station {index + 1} of {source} has no position [x, y, z] in metres.")
    rotation = None
    if "rotation" in entry:
        rotation = _numbers(entry["rotation"], (3, 3))
        if rotation is None or np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-6 or np.linalg.det(rotation) < 0:
            raise BimVerifyError(f"Station {index + 1} of {source} has a rotation that is no 3 x 3 rotation matrix.")
    elif "heading_deg" in entry:
        heading = _numbers([entry["heading_deg"]], (1,))
        if heading is None:
            raise BimVerifyError(f"Station {index + 1} of {source} has a heading_deg that is no number.")
        rotation = Rotation.from_euler("z", heading[0], degrees=True).as_matrix()
    return PlannedStation(str(entry.get("name") or f"station {index}")[:200], position, rotation)


def _numbers(value: Any, shape: tuple[int, ...]) -> NDArray[np.float64] | None:
    """The value as an array of that shape, or None if it is not one of finite numbers."""
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        return None
    return array if array.shape == shape and np.isfinite(array).all() else None


def _scanner(value: Any, source: Path) -> Scanner | None:
    if value is None:
        return None
    fields = {"preset": value} if isinstance(value, str) else value
    if not isinstance(fields, dict):
        raise BimVerifyError(f"The scanner of {source} is neither a preset's name nor an object of its properties.")
    preset = fields.get("preset", "fast")
    if not isinstance(preset, str) or preset not in PRESETS:
        raise BimVerifyError(f"{source} names the scanner preset {preset!r}; choose one of {', '.join(PRESETS)}.")
    changes: dict[str, Any] = {}
    for key, number in fields.items():
        if key == "preset":
            continue
        if key == "name":
            changes["name"] = str(number)[:200]
            continue
        suffix = next((s for s in UNITS if key.endswith(s)), "")
        name = key.removesuffix(suffix)
        if name not in LIMITS:
            known = ", ".join(LIMITS)
            raise BimVerifyError(f"{source} gives the scanner an unknown property {key!r}; known are {known}.")
        amount = _numbers([number], (1,))
        low, high = LIMITS[name]
        scaled = math.nan if amount is None else float(amount[0]) * UNITS.get(suffix, 1.0)
        if not low <= scaled <= high:
            raise BimVerifyError(
                f"{source} gives the scanner {key} = {str(number)[:40]}; it must be {low:g} to {high:g} in SI units."
            )
        changes[name] = scaled
    scanner = dataclasses.replace(PRESETS[preset], **changes)
    if scanner.elevation_max - scanner.elevation_min < scanner.angular_step or scanner.range_max <= scanner.range_min:
        raise BimVerifyError(
            f"The scanner of {source} can see nothing; elevation_max and range_max must exceed their least values."
        )
    return scanner
