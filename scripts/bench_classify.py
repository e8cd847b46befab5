"""How right and how fast is ``classify``? Simulated campaigns with the truth of every return.

    python scripts/bench_classify.py [--seed 1] [--step-deg 0.2] [--as-built] [--keep DIR] [MODEL.ifc ...]

Default models: the demo house and a storey of boxes. Some elements are moved (3 to 120 mm), some are missing, and things stand
about that are not in the model. Returns that mix two surfaces are not scored. A return is near an edge when something else
(another element, a thing not in the model, or nothing) lies within two steps of the scanner's grid, or another owner's returns
within about 50 mm. Shares are of returns on the right element; for things not in the model: of returns left unassigned.
"""

from __future__ import annotations

import argparse
import json
import math
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from headless_entry import package
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

PACKAGE = package()

from bim_verify.core.classification.results import Classification  # noqa: E402
from bim_verify.core.classification.write import write_classified  # noqa: E402
from bim_verify.core.jobs import classify  # noqa: E402
from bim_verify.core.model.elements import BuildingModel  # noqa: E402
from bim_verify.core.model.load import load_model  # noqa: E402
from bim_verify.core.options import ClassifyOptions  # noqa: E402
from bim_verify.core.simulation.box_building import building_model, four_rooms  # noqa: E402
from bim_verify.core.simulation.campaign import make_campaign, write_campaign  # noqa: E402
from bim_verify.core.simulation.house import write_demo_house  # noqa: E402
from bim_verify.core.simulation.return_truth import MIXED, OWNER, read_truth  # noqa: E402
from bim_verify.core.simulation.scanner import PRESETS  # noqa: E402

VOXEL_M = 0.025
GRID_STEPS = 2
KINDS = ("all", "away from edges", "near edges", "moved elements", "not in the model")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("models", nargs="*", type=Path)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--step-deg", type=float, default=0.2)
    parser.add_argument("--stations", type=int, default=5)
    parser.add_argument("--pose-noise-mm", type=float, default=1.0, help="standard deviation of the recorded positions")
    parser.add_argument("--as-built", action="store_true", help="verify first")
    parser.add_argument("--keep", type=Path, help="folder for the campaigns, which are used again")
    arguments = parser.parse_args()
    print(f"{'model':<24} {'returns':>11}  " + "  ".join(f"{kind:>16}" for kind in KINDS)
          + f"  {'assigned in':>11}  {'E57 written in':>14}", flush=True)
    with tempfile.TemporaryDirectory() as scratch:
        for name, model in _models(arguments.models, Path(scratch)):
            folder = (arguments.keep or Path(scratch)) / f"{name}_{arguments.seed}"
            if not (folder / "truth.json").exists():
                scanner = replace(PRESETS["fast"], angular_step=math.radians(arguments.step_deg))
                write_campaign(
                    make_campaign(
                        model, seed=arguments.seed, stations=arguments.stations, scanner=scanner,
                        pose_noise=(arguments.pose_noise_mm / 1000, 5e-5), glass="lossy",
                    ),
                    folder,
                )
            scan = folder / "scan.e57"
            result = classify(model, [scan], ClassifyOptions(as_built=arguments.as_built))
            begin = time.perf_counter()
            write_classified(Path(scratch) / "out.e57", result, 3.0)
            wrote = time.perf_counter() - begin
            _print(name, result, scan, json.loads((folder / "truth.json").read_text(encoding="utf-8")), wrote)


def _models(paths: list[Path], scratch: Path) -> list[tuple[str, BuildingModel]]:
    if paths:
        return [(path.stem, load_model(path)) for path in paths]
    house = scratch / "house.ifc"
    write_demo_house(house)
    return [("demo house", load_model(house)), ("four rooms", building_model(four_rooms()))]


def _print(name: str, result: Classification, scan: Path, truth: dict, wrote: float) -> None:
    elements = len(result.model.elements)
    owner, mixed, near = _truth_of_returns(result, scan)
    want = np.where(owner < elements, owner, -1)
    right, clear = want == result.element, ~mixed
    built = np.array([truth["elements"][e.global_id]["edit"] == "shift" for e in result.model.elements] + [False])
    moved = built[want]
    planned = clear & (want >= 0) & ~moved
    groups = (clear, planned & ~near, planned & near, clear & moved, clear & (want < 0))
    shares = "  ".join(f"{right[g].mean() if g.any() else math.nan:16.4%}" for g in groups)
    seconds = result.timings["assignment"]
    print(
        f"{name:<24} {len(owner):>11,}  {shares}  {seconds:9.1f} s  {wrote:12.1f} s   ({len(owner) / seconds / 1e6:.2f} M/s)",
        flush=True,
    )


def _truth_of_returns(
    result: Classification, scan: Path
) -> tuple[NDArray[np.int64], NDArray[np.bool_], NDArray[np.bool_]]:
    """(N,) who owns each return, whether it mixes surfaces, whether it is near an edge."""
    owners, mixes, nears, points = [], [], [], []
    blocks = list(result.source.blocks(attributes=True))
    for number, station in enumerate(result.stations):
        truth = read_truth(scan, number)
        own = [b for b in blocks if b.station == number]
        owner = truth[OWNER].astype(np.int64)
        row, column = np.concatenate([b.row for b in own]), np.concatenate([b.column for b in own])
        grid = np.full((row.max() + 1, column.max() + 1), -1, np.int64)
        grid[row, column] = owner
        size = 2 * GRID_STEPS + 1
        lowest = minimum_filter(grid, size, mode=("nearest", "wrap"))
        highest = maximum_filter(grid, size, mode=("nearest", "wrap"))
        owners.append(owner)
        mixes.append(truth[MIXED] != 0)
        nears.append((lowest != highest)[row, column])
        points.append(np.concatenate([b.offsets for b in own]) + station.position - result.model.origin)
    owner = np.concatenate(owners)
    near = np.concatenate(nears) | _beside_others(np.concatenate(points), owner)
    return owner, np.concatenate(mixes), near


def _beside_others(point: NDArray[np.float64], owner: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(N,) whether another owner's returns lie in the voxel of a return or one of the 26 around it."""
    cell = np.floor((point - point.min(axis=0)) / VOXEL_M).astype(np.int64) + 1
    size = cell.max(axis=0) + 2
    key = (cell[:, 0] * size[1] + cell[:, 1]) * size[2] + cell[:, 2]
    used, inverse = np.unique(key, return_inverse=True)
    low, high = np.full(len(used), np.iinfo(np.int64).max), np.full(len(used), -1, np.int64)
    np.minimum.at(low, inverse, owner)
    np.maximum.at(high, inverse, owner)
    least, most = low.copy(), high.copy()
    for dx in (-1, 0, 1):
        for dy in (-1, 0, 1):
            for dz in (-1, 0, 1):
                beside = used + (dx * size[1] + dy) * size[2] + dz
                place = np.minimum(np.searchsorted(used, beside), len(used) - 1)
                there = used[place] == beside
                least[there] = np.minimum(least[there], low[place[there]])
                most[there] = np.maximum(most[there], high[place[there]])
    return np.asarray((least != most)[inverse])


if __name__ == "__main__":
    main()
