"""Scan campaigns with known truth: what was edited, where the scanner stood, and what its returns can prove."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..errors import BimVerifyError
from ..files import all_or_none, check_writable, whole_file
from ..model.elements import BuildingModel
from ..model.sample_surface import sample_surface
from ..model.samples import SurfaceSamples
from ..progress import Progress
from ..scans.campaign import ReturnBlock, Station
from ..scans.write_e57 import write_e57
from .cut import choose_cuts
from .return_truth import truth_columns
from .scanner import PRESETS, Scanner, scan_bands
from .scene import Edit, Glass, Prop, Scene, Unevenness, build_scene, face_axes, thinnest_axis
from .stand_points import choose_stations, find_stand_points, near_walls, pick_spread
from .witness import StationView, Witness, planned_area

SHIFTS_M = (0.003, 0.008, 0.012, 0.02, 0.035, 0.06, 0.12)
SAMPLE_SPACING_M = 0.25
MOST_SIGHT_POINTS = 40_000
"""Surface points that stations are chosen for."""
LEAST_EXPOSED_M2 = 0.02
"""Elements that show less are not edited: nobody could tell."""
FILE_RESOLUTION_M = 1e-5
"""Of the coordinates in the E57: far below any scanner's noise."""
ACQUIRED = "2024-05-14T09:00:00"
"""Date of a simulated campaign: fixed, so that the same seed writes the same file."""


@dataclass(frozen=True)
class SetUp:
    """One station of a campaign, in the model's local frame."""

    name: str
    position: NDArray[np.float64]
    """(3,) metres: where it truly stood."""
    rotation: NDArray[np.float64]
    """(3, 3) sensor to model, as it truly was."""
    recorded_position: NDArray[np.float64]
    recorded_rotation: NDArray[np.float64]
    """The pose that the scan file gives: wrong by the registration error."""


@dataclass(frozen=True)
class Campaign:
    """All that decides the returns. Geometry in metres, model's local frame."""

    model: BuildingModel
    scanner: Scanner
    set_ups: tuple[SetUp, ...]
    edits: dict[int, Edit]
    """Row of ``model.elements`` -> how it was built; elements that are not named were built as planned."""
    props: tuple[Prop, ...]
    seed: int
    pose_noise: tuple[float, float] = (0.0, 0.0)
    glass: Glass = "opaque"
    unevenness: Unevenness | None = None
    acquired: str = ACQUIRED
    """Date of the scans."""

    @cached_property
    def scene(self) -> Scene:
        """As built, with clutter."""
        return build_scene(
            self.model, self.edits, self.props, seed=self.seed, glass=self.glass, unevenness=self.unevenness
        )


@dataclass(frozen=True)
class WrittenCampaign:
    """What was written, and what is true of it."""

    scan_path: Path
    truth_path: Path | None
    returns: int
    truth: dict[str, Any]
    """The content of truth.json; empty when no truth was asked for."""


def make_campaign(
    model: BuildingModel,
    *,
    seed: int,
    stations: int | None = None,
    remove_share: float = 0.05,
    shift_share: float = 0.15,
    shifts_m: Sequence[float] = SHIFTS_M,
    clutter: int = 6,
    people: int = 0,
    scanner: Scanner | None = None,
    pose_noise: tuple[float, float] = (0.0, 0.0),
    glass: Glass = "opaque",
    unevenness: float = 0.0,
    any_face: bool = False,
    cut_share: float = 0.0,
) -> Campaign:
    """Choose edits, clutter and stations at random, everything from ``seed``.

    ``remove_share`` and ``shift_share`` are shares of the elements that a scanner could see at all; shifts go along the
    element's thinnest axis, both ways, or with ``any_face`` along any of its main faces' normals. ``clutter`` boxes stand on
    floors near walls, ``people`` anywhere on them.
    Of ``cut_share`` of the walls and slabs (of one at least, where it is not 0) an end or a stretch is cut away.
    ``stations`` None: as many as it takes to see most of what can be seen. ``pose_noise`` is (sigma_t [m], sigma_rot
    [rad]) per axis of the recorded poses. ``unevenness`` [m] is the standard deviation of smooth bumps of all surfaces.
    """
    samples = sample_surface(model, SAMPLE_SPACING_M)
    edits = choose_edits(
        model, samples, seed=seed, remove_share=remove_share, shift_share=shift_share, shifts_m=shifts_m,
        any_face=any_face,
    )
    if cut_share > 0:
        edits |= choose_cuts(model, samples, edits, seed=seed, share=cut_share)
    props = place_props(model, build_scene(model, edits, seed=seed), seed=seed, boxes=clutter, people=people)
    scene = build_scene(model, edits, props, seed=seed)
    stands = find_stand_points(model, scene, seed=seed)
    if not len(stands.position):
        raise BimVerifyError(f"{model.path} leaves no free place for a scanner; give the stations' positions instead.")
    shown = np.flatnonzero(samples.exposed)
    if len(shown) > MOST_SIGHT_POINTS:
        shown = np.random.default_rng((seed, 6)).choice(shown, MOST_SIGHT_POINTS, replace=False)
    chosen = choose_stations(
        scene, stands, samples.position[shown], samples.normal[shown], np.sqrt(samples.area[shown]), stations=stations
    )
    return Campaign(
        model=model,
        scanner=scanner or PRESETS["fast"],
        set_ups=tuple(
            set_up(f"station {i}", stands.position[row], seed, i, pose_noise) for i, row in enumerate(chosen)
        ),
        edits=edits,
        props=props,
        seed=seed,
        pose_noise=pose_noise,
        glass=glass,
        unevenness=Unevenness(unevenness, 0.6, seed) if unevenness > 0 else None,
    )


def set_up(
    name: str, position: NDArray[np.float64], seed: int, index: int, pose_noise: tuple[float, float] = (0.0, 0.0),
    rotation: NDArray[np.float64] | None = None,
) -> SetUp:
    """A levelled set-up with a random heading (unless ``rotation`` is given); its recorded pose off by the noise."""
    random = np.random.default_rng((seed, 2, index))
    heading = random.uniform(0, 2 * math.pi)
    if rotation is None:
        rotation = Rotation.from_euler("z", heading).as_matrix()
    shift = pose_noise[0] * random.standard_normal(3)
    turn = Rotation.from_rotvec(pose_noise[1] * random.standard_normal(3)).as_matrix()
    position = np.asarray(position, dtype=np.float64)
    return SetUp(name, position, rotation, position + shift, turn @ rotation)


def choose_edits(
    model: BuildingModel,
    samples: SurfaceSamples,
    *,
    seed: int,
    remove_share: float,
    shift_share: float,
    shifts_m: Sequence[float],
    any_face: bool = False,
) -> dict[int, Edit]:
    """Which elements were not built, and which were built elsewhere: among those that could be seen at all."""
    random = np.random.default_rng((seed, 3))
    exposed = np.bincount(samples.element, weights=samples.area * samples.exposed, minlength=len(model.elements))
    could_be_seen = random.permutation(np.flatnonzero(exposed > LEAST_EXPOSED_M2))
    removed = round(remove_share * len(could_be_seen))
    shifted = round(shift_share * len(could_be_seen))
    edits: dict[int, Edit] = {int(row): Edit("remove") for row in could_be_seen[:removed]}
    sizes = np.resize(np.asarray(shifts_m, dtype=np.float64), max(shifted, len(shifts_m)))
    sizes = random.permutation(sizes)[:shifted]
    start = model.triangle_start
    for row, size in zip(could_be_seen[removed : removed + shifted], sizes, strict=True):
        corners = model.vertices[model.triangles[start[row] : start[row + 1]]]
        if any_face:
            axes = face_axes(corners)
            axis = axes[int(random.integers(len(axes)))]
        else:
            axis, _ = thinnest_axis(corners)
        offset = float(size * random.choice([-1.0, 1.0]))
        edits[int(row)] = Edit("shift", offset, (float(axis[0]), float(axis[1]), float(axis[2])))
    return edits


def place_props(model: BuildingModel, scene: Scene, *, seed: int, boxes: int, people: int) -> tuple[Prop, ...]:
    """Boxes on floors near walls, and people-like figures, none of them in the model."""
    random = np.random.default_rng((seed, 4))
    stands = find_stand_points(model, scene, seed=seed + 7919)
    floor = np.column_stack([stands.position[:, :2], stands.floor])
    towards, distance = near_walls(scene, floor)
    order = random.permutation(len(floor))
    by_wall = order[distance[order] < 3.0]
    props: list[Prop] = []
    for row in by_wall[pick_spread(floor[by_wall], boxes, 0.8)]:
        size = random.uniform([0.2, 0.2, 0.3], [0.7, 0.7, 1.4])
        yaw = math.atan2(towards[row, 1], towards[row, 0]) + random.normal(0.0, 0.05)
        gap = random.uniform(0.02, 0.25)
        to_wall = max(distance[row] - size[0] / 2 - gap, 0.0)
        middle = floor[row] + to_wall * towards[row] + [0.0, 0.0, size[2] / 2 + 0.002]
        props.append(Prop(f"new{len(props)}", "box", _triple(middle), _triple(size), yaw))
    for row in order[pick_spread(floor[order], people, 1.2)]:
        tall = random.uniform(1.6, 1.9)
        size = np.array([random.uniform(0.28, 0.36), random.uniform(0.45, 0.55), tall])
        middle = floor[row] + [0.0, 0.0, tall / 2 + 0.002]
        props.append(Prop(f"new{len(props)}", "person", _triple(middle), _triple(size), random.uniform(0, 2 * math.pi)))
    return tuple(props)


def write_campaign(campaign: Campaign, folder: str | Path, *, progress: Progress | None = None) -> WrittenCampaign:
    """Scan, and write ``scan.e57`` and ``truth.json`` into ``folder`` (made if missing)."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    return scan_to_files(campaign, folder / "scan.e57", folder / "truth.json", progress=progress)


def scan_to_files(
    campaign: Campaign, scan_path: str | Path, truth_path: str | Path | None, *, progress: Progress | None = None
) -> WrittenCampaign:
    """Scan, write the E57 and (if a path is given) the truth. One station at a time is in memory.

    Raises BimVerifyError when nothing comes back to any station, or a file cannot be written.
    """
    recorder = _Recorder(campaign, progress or Progress(), with_truth=truth_path is not None)
    for path in (scan_path, truth_path):
        if path is not None:
            check_writable(path)
    with all_or_none():
        write_e57(scan_path, recorder.stations(), recorder.blocks(), scaled_integer_m=FILE_RESOLUTION_M)
        truth = recorder.truth()
        if truth_path is not None:
            with whole_file(truth_path) as temporary:
                temporary.write_text(json.dumps(truth, indent=1), encoding="utf-8")
    return WrittenCampaign(Path(scan_path), Path(truth_path) if truth_path else None, recorder.returns, truth)


class _Recorder:
    """Scans the stations one after the other and keeps what the truth needs of the returns."""

    def __init__(self, campaign: Campaign, progress: Progress, *, with_truth: bool) -> None:
        self.campaign = campaign
        self.progress = progress
        self.hits = np.zeros(len(campaign.scene.names), dtype=np.int64)
        self.mixed = 0
        self.witness = (
            Witness(campaign.model, campaign.scene, campaign.edits, campaign.scanner) if with_truth else None
        )

    @property
    def returns(self) -> int:
        return int(self.hits.sum())

    def stations(self) -> tuple[Station, ...]:
        campaign = self.campaign
        return tuple(
            Station(
                name=s.name,
                position=s.recorded_position + campaign.model.origin,
                rotation=s.recorded_rotation,
                grid=campaign.scanner.grid,
                sensor=f"bim_verify simulated scanner ({campaign.scanner.name})",
                acquired=campaign.acquired,
            )
            for s in campaign.set_ups
        )

    def blocks(self) -> Iterator[ReturnBlock]:
        campaign = self.campaign
        grid = campaign.scanner.grid
        for index, setup in enumerate(campaign.set_ups):
            view = StationView.empty(setup.position, setup.rotation, grid) if self.witness else None
            seed = int(np.random.default_rng((campaign.seed, 5, index)).integers(2**31))
            for band in scan_bands(campaign.scene, setup.position, setup.rotation, campaign.scanner, seed):
                if not len(band):
                    continue
                if view is not None:
                    view.record(band)
                self.hits += np.bincount(band.owner, minlength=len(self.hits))
                self.mixed += int(band.mixed.sum())
                done = (index + (int(band.row[-1]) + 1) / grid.rows) / len(campaign.set_ups)
                self.progress.update(done, f"Scanning from {setup.name}")
                yield ReturnBlock(
                    station=index,
                    offsets=band.offset @ setup.recorded_rotation.T,
                    intensity=band.intensity,
                    row=band.row,
                    column=band.column,
                    extra=truth_columns(band),
                )
            if self.witness is not None and view is not None:
                self.witness.add(view)
        if self.returns == 0:
            raise BimVerifyError(
                f"No station sees anything of {campaign.model.path}; positions are metres in the model's own frame."
            )

    def truth(self) -> dict[str, Any]:
        """The content of truth.json; positions in the model frame."""
        if self.witness is None:
            return {}
        campaign, witness = self.campaign, self.witness
        model, origin = campaign.model, campaign.model.origin
        visible, witnessed, area = witness.visible, witness.witnessed, planned_area(model)
        elements = {}
        for row, element in enumerate(model.elements):
            edit = campaign.edits.get(row)
            elements[element.global_id] = {
                "cls": element.ifc_class,
                "edit": edit.kind if edit else "none",
                "offset": edit.offset if edit else 0.0,
                "direction": list(edit.direction) if edit else [0, 0, 0],
                "visible": float(visible[row]),
                "witnessed": float(witnessed[row]),
                "hits": int(self.hits[row]),
                "area": float(area[row]),
            }
            if edit is not None and edit.kind == "cut":
                gone, left = witness.of_cut(row, edit)
                elements[element.global_id] |= {"witnessed_gone": gone, "witnessed_left": left}
        prop_hits = self.hits[len(model.elements) :]
        return {
            "model": Path(model.path).name,
            "points": self.returns,
            "mixed": self.mixed,
            "sigma": campaign.scanner.sigma_range,
            "step_deg": math.degrees(campaign.scanner.angular_step),
            "seed": campaign.seed,
            "scanner": campaign.scanner.name,
            "pose_noise": list(campaign.pose_noise),
            "glass": campaign.glass,
            "unevenness": campaign.unevenness.amplitude if campaign.unevenness else 0.0,
            "stations": [(s.position + origin).tolist() for s in campaign.set_ups],
            "rotations": [s.rotation.tolist() for s in campaign.set_ups],
            "recorded_stations": [(s.recorded_position + origin).tolist() for s in campaign.set_ups],
            "elements": elements,
            "new": [
                {
                    "name": p.name,
                    "kind": p.kind,
                    "center": (np.array(p.center) + origin).tolist(),
                    "size": list(p.size),
                    "yaw": p.yaw,
                }
                for p in campaign.props
            ],
            "new_hits": {p.name: int(n) for p, n in zip(campaign.props, prop_hits, strict=True) if n},
        }


def _triple(values: NDArray[np.float64]) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
