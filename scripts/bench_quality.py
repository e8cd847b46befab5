"""How right and how fast is ``quality``?

    python scripts/bench_quality.py [--causes] [--errors] [--speed] [--model MODEL.ifc ...] [--million-returns 20]

Causes: simulated campaigns with known occluders, ranges, fields of view and absorbing surfaces; prints the share of the
missing area whose cause is right, and of the hidden area whose occluder is right. Errors: predicted against actual error
of components modelled again from held-out simulated scans. Speed: a campaign on 300 elements. Without a choice all run.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from headless_entry import package

PACKAGE = package()

from bim_verify.core.jobs import quality  # noqa: E402
from bim_verify.core.model.elements import BuildingModel  # noqa: E402
from bim_verify.core.model.load import load_model  # noqa: E402
from bim_verify.core.quality.heldout import compare_errors, predicted_and_actual  # noqa: E402
from bim_verify.core.quality.options import QualityOptions  # noqa: E402
from bim_verify.core.quality.score import score_causes  # noqa: E402
from bim_verify.core.scans.open import open_scans  # noqa: E402
from bim_verify.core.scans.write_e57 import write_e57  # noqa: E402
from bim_verify.core.simulation.box_building import (  # noqa: E402
    Box,
    building_model,
    four_room_stations,
    four_rooms,
    scan,
)
from bim_verify.core.simulation.campaign import Campaign, make_campaign, scan_to_files, set_up  # noqa: E402
from bim_verify.core.simulation.demo import demo_campaign  # noqa: E402
from bim_verify.core.simulation.house import write_demo_house  # noqa: E402
from bim_verify.core.simulation.scanner import PRESETS, Scanner  # noqa: E402

STEP_DEG = 0.2
STOREYS = 6
DENSE_M = 0.025
"""Spacing up to which predictions are held against T3's figures: its scans had 3 to 22 mm."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for part in ("causes", "errors", "speed"):
        parser.add_argument(f"--{part}", action="store_true")
    parser.add_argument("--model", nargs="*", default=[], help="more models for the causes and the errors")
    parser.add_argument("--million-returns", type=float, default=20.0)
    parser.add_argument("--one", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one:
        once(arguments.one)
        return
    every = not (arguments.causes or arguments.errors or arguments.speed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if arguments.causes or every:
            causes(folder, arguments.model)
        if arguments.errors or every:
            errors(folder, arguments.model)
        if arguments.speed or every:
            speed(folder, arguments.million_returns)


def scanner(**changes: float) -> Scanner:
    """The bench's scanner: usual noise, a step that simulates fast."""
    values: dict[str, float] = {"angular_step": math.radians(STEP_DEG), **changes}
    return dataclasses.replace(PRESETS["medium"], **values)  # type: ignore[arg-type]


def cause_campaigns(folder: Path, models: list[str]) -> dict[str, Callable[[], Campaign]]:
    """Name -> campaign."""
    house = folder / "house.ifc"
    write_demo_house(house)
    rooms = building_model(four_rooms())
    chosen: dict[str, Callable[[], Campaign]] = {
        "rooms, clutter and people": lambda: crowded(rooms, 1, scanner()),
        "rooms, short range": lambda: crowded(rooms, 2, scanner(range_max=4.0)),
        "rooms, narrow field of view": lambda: crowded(
            rooms, 3, scanner(elevation_min=math.radians(-35.0), elevation_max=math.radians(25.0))
        ),
        "rooms, black surfaces": lambda: darkened(crowded(rooms, 4, scanner())),
        "demo house": lambda: dataclasses.replace(
            demo_campaign(load_model(house), 5), edits={}, scanner=scanner(), glass="opaque"
        ),
        "long hall, weak scanner": lambda: long_hall(scanner(weakest_power=0.15, range_max=60.0), 0.5),
        "the same, bright and dull": lambda: long_hall(scanner(weakest_power=0.15, range_max=60.0), None),
    }
    for path in models:
        chosen[Path(path).name] = lambda path=path: crowded(load_model(path), 6, scanner())  # type: ignore[misc]
    return chosen


def crowded(model: BuildingModel, seed: int, instrument: Scanner) -> Campaign:
    """A model as planned with clutter and people before it, from a few stations that leave much unseen."""
    return make_campaign(
        model, seed=seed, stations=4, remove_share=0.0, shift_share=0.0, clutter=12, people=3, scanner=instrument,
        pose_noise=(0.0005, 1e-5),
    )


def darkened(campaign: Campaign) -> Campaign:
    """Every fifth element swallows the light."""
    campaign.scene.reflectance[: len(campaign.model.elements) : 5] = 1e-5
    return campaign


def long_hall(instrument: Scanner, reflectance: float | None) -> Campaign:
    """A hall of 60 m with a scanner that reaches a part of it; all of one brightness, or each element of its own."""
    model = building_model([
        Box("floor", np.array([0.0, 0, -0.2]), np.array([60.0, 12, 0])),
        Box("roof", np.array([0.0, 0, 6.0]), np.array([60.0, 12, 6.3])),
        Box("south", np.array([0.0, -0.3, 0]), np.array([60.0, 0, 6])),
        Box("north", np.array([0.0, 12, 0]), np.array([60.0, 12.3, 6])),
        Box("west", np.array([-0.3, 0, 0]), np.array([0.0, 12, 6])),
        Box("east", np.array([60.0, 0, 0]), np.array([60.3, 12, 6])),
        *(Box(f"column {k}", np.array([6.0 * k, 5.8, 0]), np.array([6.0 * k + 0.4, 6.2, 6])) for k in range(1, 10)),
    ])
    places = np.array([[5.0, 4.0, 1.6], [14.0, 8.0, 1.6]]) - model.origin
    campaign = Campaign(
        model=model, scanner=instrument, set_ups=tuple(set_up(f"S{k}", p, 1, k) for k, p in enumerate(places)), edits={},
        props=(), seed=1,
    )
    if reflectance is not None:
        campaign.scene.reflectance[:] = reflectance
    return campaign


def causes(folder: Path, models: list[str]) -> None:
    """Print the share of the missing area with the right cause."""
    print("Causes of missing area")
    right = missing = 0.0
    for name, make in cause_campaigns(folder, models).items():
        campaign = make()
        found = scan_to_files(campaign, folder / "scan.e57", None)
        result = quality(campaign.model, [found.scan_path], QualityOptions())
        score = score_causes(result, campaign)
        right, missing = right + score.right, missing + score.missing
        print(
            f"  {name:30s} {found.returns / 1e6:5.2f} M returns  {score.missing:7.1f} m2 missing  cause right "
            f"{score.right / max(score.missing, 1e-9):6.1%}  occluder right {score.named / max(score.hidden, 1e-9):6.1%} of "
            f"{score.hidden:.1f} m2  seen or not right {score.agreed:6.1%}", flush=True,
        )
        for truth, told, area in score.confusion[:4]:
            print(f"      {area:6.1f} m2 {truth}, told {told}")
    print(f"  all: cause right for {right / missing:.1%} of {missing:.0f} m2 missing (wanted: 95 %)")


def errors(folder: Path, models: list[str]) -> None:
    """Print predicted against actual errors of components."""
    print("Predicted against actual error of as-built components (held-out simulations)")
    house = folder / "house.ifc"
    write_demo_house(house)
    pairs = []
    chosen = [building_model(four_rooms()), load_model(house), *(load_model(path) for path in models)]
    for number, model in enumerate(chosen):
        for step, noise, unevenness in ((0.1, 0.001, 0.0), (0.15, 0.002, 0.0005), (0.25, 0.004, 0.001)):
            campaign = make_campaign(
                model, seed=100 + number, stations=8, remove_share=0.0, shift_share=0.0, clutter=4,
                scanner=scanner(angular_step=math.radians(step), sigma_range=noise), pose_noise=(0.001, 2e-5),
                unevenness=unevenness,
            )
            found = scan_to_files(campaign, folder / "scan.e57", None)
            result = quality(model, [found.scan_path], QualityOptions())
            pairs += predicted_and_actual(result, open_scans([found.scan_path]))
    dense = [p for p in pairs if p.spacing <= DENSE_M]
    for kind in ("surface", "outline"):
        print(f"  {kind:8s} {compare_errors([p for p in dense if p.kind == kind])}")
    print(f"  both, returns up to {1000 * DENSE_M:.0f} mm apart: {compare_errors(dense)} (wanted: 3 mm at most)")
    print(f"  sparser outlines: {compare_errors([p for p in pairs if p.spacing > DENSE_M and p.kind == 'outline'])}")
    print(f"  sparser planes: {compare_errors([p for p in pairs if p.spacing > DENSE_M and p.kind == 'surface'])}")


def speed(folder: Path, million: float) -> None:
    """Print the time of a campaign on 300 elements."""
    model = tower()
    stations = np.concatenate([four_room_stations() + up(k) for k in range(STOREYS)])
    beams = 360.0 * 150.0 * len(stations)
    for count in (0.5, million):  # the first compiles the kernels and fills the caches
        source = scan(model, stations, step_deg=math.sqrt(beams / (count * 1e6)))
        write_e57(folder / "tower.e57", source.stations, source.blocks(), scaled_integer_m=1e-5)
        points = source.point_count
        del source
        start = time.perf_counter()
        done = subprocess.run(
            [sys.executable, str(Path(__file__).resolve()), "--one", str(folder / "tower.e57")], capture_output=True,
            text=True, check=True,
        )
        wall = time.perf_counter() - start
    told = json.loads(done.stdout)
    print(
        f"Speed: {points:,} returns, {len(stations)} stations, {len(model.elements)} elements: {wall:.1f} s for the whole "
        f"process (load {os.getloadavg()[0]:.1f}; wanted: 60 s); {told['queries']:,} query positions, {told['memory']:.2f} GB"
    )
    print("    " + ", ".join(f"{stage} {seconds:.1f}" for stage, seconds in told["timings"].items()))


def tower() -> BuildingModel:
    """Storeys of four rooms, one on the other."""
    boxes = [
        dataclasses.replace(b, name=f"{b.name} {k}", low=b.low + up(k), high=b.high + up(k))
        for k in range(STOREYS) for b in four_rooms()
    ]
    return building_model(boxes)


def up(storey: int) -> np.ndarray:
    """From the ground floor to a storey, metres."""
    return np.array([0.0, 0.0, 3.0 * storey])


def once(path: Path) -> None:
    """What the measured process does."""
    import resource

    result = quality(tower(), [path], QualityOptions())
    print(json.dumps({
        "timings": result.timings, "queries": len(result.samples),
        "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9,
    }))


if __name__ == "__main__":
    main()
