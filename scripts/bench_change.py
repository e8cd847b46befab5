"""States of elements on simulated campaigns with known demolition, new walls, moved elements, clutter and occlusion.

    python scripts/bench_change.py [MODEL.ifc ...] [--seeds 1 2] [--scanner fast] [--voxel-mm 10] [--threads N]

Without files, the box building and the demo house made in code are used. For each model and seed there are three campaigns from
stations of their own: a reference in which some elements are not built yet; an epoch in which these are built, others are
gone, some moved, and boxes stand about; and an epoch as planned. Printed are precision and recall of the states among decided
elements, hidden elements called disappeared, and volumes of elements that were seen through from (nearly) everywhere.
"""

from __future__ import annotations

import argparse
import dataclasses
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from bim_verify.core.change.results import ChangeResult
from bim_verify.core.jobs import change
from bim_verify.core.model.elements import BuildingModel
from bim_verify.core.model.load import load_model
from bim_verify.core.options import ChangeOptions
from bim_verify.core.simulation.campaign import Campaign, make_campaign, write_campaign
from bim_verify.core.simulation.scanner import PRESETS
from bim_verify.core.simulation.scene import Edit

LEAST_WITNESSED = 0.25
"""Elements of which the returns prove less are not scored, except that none of them may be called disappeared."""
FULLY = 0.9
SHIFTS_M = (0.004, 0.06, 0.12, 0.2)


def made_in_code(folder: Path) -> list[Path]:
    """Models for those who give none."""
    from bim_verify.core.simulation.house import write_demo_house

    path = folder / "demo_house.ifc"
    write_demo_house(path)
    return [path]


def campaigns(model: BuildingModel, seed: int, scanner: str) -> tuple[Campaign, Campaign, set[int]]:
    """(reference, epoch, rows built in between)."""
    epoch = make_campaign(
        model, seed=seed, remove_share=0.12, shift_share=0.12, shifts_m=SHIFTS_M, clutter=6, people=1,
        scanner=PRESETS[scanner], pose_noise=(0.0008, 2e-5),
    )
    before = make_campaign(
        model, seed=seed + 1000, remove_share=0.12, shift_share=0.0, clutter=2, scanner=PRESETS[scanner],
        pose_noise=(0.0008, 2e-5),
    )
    built = {row for row in before.edits if row not in epoch.edits}
    before = dataclasses.replace(before, edits={row: Edit("remove") for row in built})
    return before, epoch, built


def expected(model: BuildingModel, row: int, edit: Edit | None, built: bool, tolerance: float) -> set[str]:
    """States that are right for an element."""
    from bim_verify.core.change.decide import overlap

    if built:
        return {"NEW"}
    if edit is None:
        return {"CONFIRMED"}
    if edit.kind == "remove":
        return {"DISAPPEARED"}
    if abs(edit.offset) <= 0.6 * tolerance:
        return {"CONFIRMED"}
    if abs(edit.offset) < 1.5 * tolerance:
        return {"CONFIRMED", "PARTIAL", "DISAPPEARED"}
    share = overlap(model, row, edit.vector)
    return {"DISAPPEARED"} if share <= 0.05 else ({"PARTIAL", "DISAPPEARED"} if share < 0.45 else {"PARTIAL"})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("models", nargs="*", type=Path)
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2])
    parser.add_argument("--scanner", default="fast", choices=sorted(PRESETS))
    parser.add_argument("--voxel-mm", type=float, default=10.0)
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--misses", type=int, default=12)
    options = parser.parse_args()
    settings = ChangeOptions(voxel=options.voxel_mm / 1000, threads=options.threads)
    table: Counter[tuple[str, str]] = Counter()
    volumes: list[float] = []
    false_gone: list[str] = []
    misses: list[str] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for path in options.models or made_in_code(folder):
            model = load_model(path)
            for seed in options.seeds:
                before, epoch, built = campaigns(model, seed, options.scanner)
                then = write_campaign(before, folder / "before")
                now = write_campaign(epoch, folder / "now")
                for reference in (None, [then.scan_path]):
                    result = change(model, [[now.scan_path]], reference, settings)
                    print(f"{path.name} seed {seed} against {'a reference' if reference else 'the model'}: "
                          + ", ".join(f"{k} {v:.0f} s" for k, v in result.timings.items()), flush=True)
                    score(result, model, epoch, built if reference else set(), now.truth, then.truth if reference else None,
                          table, volumes, false_gone, misses, f"{path.name} seed {seed}")
    report(table, volumes, false_gone, misses[: options.misses])


def score(
    result: ChangeResult, model: BuildingModel, epoch: Campaign, built: set[int], truth: dict[str, Any],
    before: dict[str, Any] | None, table: Counter[tuple[str, str]], volumes: list[float], false_gone: list[str],
    misses: list[str], where: str,
) -> None:
    """Enter one comparison."""
    for row, found in enumerate(result.elements):
        fact = truth["elements"][found.global_id]
        edit = epoch.edits.get(row)
        there = edit is None or edit.kind == "shift"
        if there and found.state == "DISAPPEARED" and (edit is None or fact["witnessed"] < 0.01):
            false_gone.append(f"{where} {found.ifc_class} {found.name}: {found.reason}")
        if fact["witnessed"] < 0.01 and fact["hits"] < 20 and found.state != "UNKNOWN":
            misses.append(f"{where} hidden {found.ifc_class} {found.name} is {found.state}: {found.reason}")
        if fact["witnessed"] < LEAST_WITNESSED:
            continue
        if before is not None and before["elements"][found.global_id]["witnessed"] < LEAST_WITNESSED:
            continue
        right = expected(model, row, edit, row in built, 0.0137)
        name = found.state if found.state in right else sorted(right)[0]
        table[(name, found.state)] += 1
        if found.state not in right:
            misses.append(
                f"{where} {found.ifc_class} {found.name} {edit} built={row in built} witnessed {fact['witnessed']:.2f}: "
                f"{found.state}, not {'/'.join(sorted(right))}: {found.reason}"
            )
        if edit is not None and edit.kind == "remove" and fact["witnessed"] >= FULLY and found.volume > 1e-4:
            volumes.append(found.disappeared_volume / found.volume - 1.0)
        if edit is None and not built and fact["witnessed"] >= FULLY and found.volume > 1e-4:
            volumes.append(found.built_volume / found.volume - 1.0)


def report(
    table: Counter[tuple[str, str]], volumes: list[float], false_gone: list[str], misses: list[str]
) -> None:
    """Print the figures."""
    for line in misses:
        print("  miss", line)
    total = sum(n for (_, found), n in table.items() if found != "UNKNOWN")
    print(f"{sum(table.values())} elements scored, {total} decided, "
          f"{sum(n for (a, b), n in table.items() if a == b and b != 'UNKNOWN') / max(total, 1):.4f} right")
    for state in ("CONFIRMED", "NEW", "DISAPPEARED", "PARTIAL"):
        right = table[(state, state)]
        said = sum(n for (_, found), n in table.items() if found == state)
        true = sum(n for (want, found), n in table.items() if want == state and found != "UNKNOWN")
        if said or true:
            print(f"{state:12} precision {right / max(said, 1):.3f} ({right}/{said})  "
                  f"recall {right / max(true, 1):.3f} ({right}/{true})")
    print(f"standing or hidden elements called disappeared: {len(false_gone)}")
    for line in false_gone[:5]:
        print("  ", line)
    if volumes:
        error = np.abs(volumes)
        print(f"volumes of {len(error)} fully seen elements: error median {100 * np.median(error):.1f} %, "
              f"95th percentile {100 * np.quantile(error, 0.95):.1f} %, largest {100 * error.max():.1f} %")


if __name__ == "__main__":
    main()
