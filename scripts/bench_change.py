"""States of elements on simulated campaigns with known demolition, new walls, moved elements, clutter and occlusion.

    python scripts/bench_change.py [MODEL.ifc ...] [--seeds 1 2] [--scanner fast] [--voxel-mm 10]
        [--sample-spacing-mm 50] [--threads N] [--cuts 0.15] [--offset-mm X,Y,Z] [--align fine] [--keep FOLDER]

Without files, the demo house made in code is used. For each model and seed there are two campaigns from stations of their
own: a reference in which some elements are not built yet, and an epoch in which these are built, others are gone, some moved,
with ``--cuts`` walls and slabs of which an end or a stretch is cut away, and boxes and a person stand about. Scored are the
epoch against the reference, and both against the model. Printed are precision and recall of the states among decided elements,
hidden elements called disappeared, how the visits lie (with ``--offset-mm`` all poses of the epoch are off by that), and
volumes of elements that were seen from (nearly) everywhere; of cut ones also those of which half was seen.
"""

from __future__ import annotations

import argparse
import dataclasses
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bim_verify.core.change.look import change_tolerance
from bim_verify.core.change.results import ChangeResult
from bim_verify.core.jobs import change
from bim_verify.core.model.elements import BuildingModel
from bim_verify.core.model.load import load_model
from bim_verify.core.options import ChangeOptions
from bim_verify.core.report.remaining import remaining_volume
from bim_verify.core.simulation.campaign import Campaign, make_campaign, write_campaign
from bim_verify.core.simulation.cut import element_corners, removed_share
from bim_verify.core.simulation.scanner import PRESETS
from bim_verify.core.simulation.scene import Edit

LEAST_WITNESSED = 0.25
"""Elements of which the returns prove less are not scored, except that none of them may be called disappeared."""
FULLY, HALF = 0.9, 0.5
NOTHING_OF_IT = 0.1
"""Where less of the part that was cut away, or of the part that stands, is witnessed, the other part may be all."""
SHIFTS_M = (0.004, 0.06, 0.12, 0.2)


def made_in_code(folder: Path) -> list[Path]:
    """Models for those who give none."""
    from bim_verify.core.simulation.house import write_demo_house

    path = folder / "demo_house.ifc"
    write_demo_house(path)
    return [path]


def campaigns(model: BuildingModel, seed: int, scanner: str, cuts: float) -> tuple[Campaign, Campaign, set[int]]:
    """(reference, epoch, rows built in between)."""
    epoch = make_campaign(
        model, seed=seed, remove_share=0.12, shift_share=0.12, shifts_m=SHIFTS_M, clutter=6, people=1,
        scanner=PRESETS[scanner], pose_noise=(0.0008, 2e-5), cut_share=cuts,
    )
    before = make_campaign(
        model, seed=seed + 1000, remove_share=0.12, shift_share=0.0, clutter=2, scanner=PRESETS[scanner],
        pose_noise=(0.0008, 2e-5),
    )
    built = {row for row in before.edits if row not in epoch.edits}
    before = dataclasses.replace(before, edits={row: Edit("remove") for row in built})
    return before, epoch, built


def expected(
    model: BuildingModel, row: int, edit: Edit | None, built: bool, tolerance: float, fact: dict[str, Any]
) -> set[str]:
    """States that are right for an element; ``fact`` is what the truth says of it."""
    from bim_verify.core.evidence.overlap import overlap

    if built:
        return {"NEW"}
    if edit is None:
        return {"CONFIRMED"}
    if edit.kind == "remove":
        return {"DISAPPEARED"}
    if edit.kind == "cut":
        either = {"CONFIRMED"} if fact["witnessed_gone"] < NOTHING_OF_IT else set()
        return {"PARTIAL"} | either | ({"DISAPPEARED"} if fact["witnessed_left"] < NOTHING_OF_IT else set())
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
    parser.add_argument("--sample-spacing-mm", type=float, default=1000 * ChangeOptions().sample_spacing)
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--cuts", type=float, default=0.0, help="share of the walls and slabs that are cut")
    parser.add_argument("--offset-mm", default="0,0,0", help="X,Y,Z that all recorded stations of the epoch are off by")
    parser.add_argument("--align", default="none", choices=("none", "fine", "auto"))
    parser.add_argument("--keep", type=Path, help="folder for the campaigns' scans and truths")
    parser.add_argument("--misses", type=int, default=12)
    options = parser.parse_args()
    settings = ChangeOptions(
        voxel=options.voxel_mm / 1000, sample_spacing=options.sample_spacing_mm / 1000, threads=options.threads,
        align=options.align,
    )
    offset = np.array([float(v) for v in options.offset_mm.split(",")]) / 1000
    tally = Tally(change_tolerance(settings.voxel, settings.sigma, 0.001))
    with tempfile.TemporaryDirectory() as name:
        folder = options.keep or Path(name)
        for path in options.models or made_in_code(folder):
            model = load_model(path)
            for seed in options.seeds:
                before, epoch, built = campaigns(model, seed, options.scanner, options.cuts)
                then = write_campaign(before, folder / f"{path.stem}_{seed}_before")
                moved = [dataclasses.replace(s, recorded_position=s.recorded_position + offset) for s in epoch.set_ups]
                epoch = dataclasses.replace(epoch, set_ups=tuple(moved))
                now = write_campaign(epoch, folder / f"{path.stem}_{seed}_now")
                result = change(model, [[now.scan_path]], [then.scan_path], settings)
                print(f"{path.name} seed {seed}: " + ", ".join(f"{k} {v:.0f} s" for k, v in result.timings.items()), flush=True)
                print(f"{result.places()} Found of elements in view: " + ", ".join(
                    f"{e.name} {e.found_ratio:.0%}" for e in result.series if e.found_ratio is not None), flush=True)
                where = f"{path.name} seed {seed}"
                tally.states(f"{where}, two epochs", model, [e.state for e in result.elements], epoch.edits, built, now.truth,
                             then.truth, [e.reason for e in result.elements])
                tally.states(f"{where}, model", model, result.epoch.states, epoch.edits, set(), now.truth)
                assert result.reference is not None
                tally.states(f"{where}, model (reference)", model, result.reference.states, before.edits, set(), then.truth)
                tally.amounts(where, result, epoch.edits, now.truth, then.truth)
                tally.cuts(where, model, result, epoch.edits, now.truth, then.truth)
    tally.report(options.misses)


def spread(errors: np.ndarray) -> str:
    """Median and largest, percent."""
    return f"{100 * np.median(errors):.1f} % ({100 * errors.max():.1f} %)"


@dataclasses.dataclass
class Tally:
    """What was found against what is true, over all comparisons."""

    tolerance: float
    """Metres within which the voxels do not tell two places apart."""
    table: Counter[tuple[str, str]] = dataclasses.field(default_factory=Counter)
    volumes: list[tuple[float, str]] = dataclasses.field(default_factory=list)
    cut: list[tuple[float, float, float, float, str]] = dataclasses.field(default_factory=list)
    """Partly demolished: share seen, errors of the volumes standing, gone and of the remaining shape (of the planned), name."""
    false_gone: list[str] = dataclasses.field(default_factory=list)
    misses: list[str] = dataclasses.field(default_factory=list)
    shared: int = 0
    """Elements that stay undecided between the epochs, because another one has their surface."""

    def states(
        self, where: str, model: BuildingModel, found: Sequence[str], edits: dict[int, Edit], built: set[int],
        truth: dict[str, Any], before: dict[str, Any] | None = None, reasons: Sequence[str] | None = None,
    ) -> None:
        """Enter one comparison."""
        for row, (state, element) in enumerate(zip(found, model.elements, strict=True)):
            fact, edit = truth["elements"][element.global_id], edits.get(row)
            who = f"{where}: {element.ifc_class} {element.name} {edit or ''}"
            why = f": {reasons[row]}" if reasons else ""
            hidden = fact["witnessed"] < 0.01 and fact["hits"] < 20
            if state == "DISAPPEARED" and (edit is None or hidden):
                self.false_gone.append(f"{who}{why}")
            if hidden and state != "UNKNOWN":
                self.misses.append(f"{who} is hidden, but {state}{why}")
            if fact["witnessed"] < LEAST_WITNESSED:
                continue
            if before is not None and before["elements"][element.global_id]["witnessed"] < LEAST_WITNESSED:
                continue
            right = expected(model, row, edit, row in built, self.tolerance, fact)
            self.table[state if state in right else min(right), state] += 1
            if reasons and state == "UNKNOWN" and "may be either" in reasons[row]:
                self.shared += 1
            elif state not in right and state != "UNKNOWN":
                self.misses.append(
                    f"{who} built={row in built} witnessed {fact['witnessed']:.2f}: {state}, not {'/'.join(sorted(right))}{why}"
                )

    def amounts(
        self, where: str, result: ChangeResult, edits: dict[int, Edit], truth: dict[str, Any], before: dict[str, Any]
    ) -> None:
        """Enter the volumes of elements that are whole or gone, and were seen from everywhere in both epochs."""
        for row, found in enumerate(result.elements):
            seen = min(t["elements"][found.global_id]["witnessed"] for t in (truth, before))
            edit = edits.get(row)
            if seen < FULLY or found.volume <= 1e-4 or found.state == "UNKNOWN" or (edit is not None and edit.kind != "remove"):
                continue
            part = found.built_volume if edit is None else found.disappeared_volume
            name = f"{where} {found.ifc_class} {found.name} {found.state}, seen {seen:.0%}"
            self.volumes.append((part / found.volume - 1.0, name))

    def cuts(
        self, where: str, model: BuildingModel, result: ChangeResult, edits: dict[int, Edit], truth: dict[str, Any],
        before: dict[str, Any],
    ) -> None:
        """Enter the volumes of elements that were called partly gone, and are."""
        for row, edit in edits.items():
            found = result.elements[row]
            if edit.kind != "cut" or found.state != "PARTIAL":
                continue
            seen = min(t["elements"][found.global_id]["witnessed"] for t in (truth, before))
            gone = removed_share(element_corners(model, row), edit)
            shape = remaining_volume(result, row) / found.volume
            who = f"{where} {found.ifc_class} {found.name}"
            name = f"{who}, {gone:.0%} cut away, seen {seen:.0%}, unknown {found.unknown_ratio:.0%}"
            self.cut.append((
                seen, found.built_volume / found.volume - (1.0 - gone), found.disappeared_volume / found.volume - gone,
                shape - (1.0 - gone), name,
            ))

    def report(self, most: int) -> None:
        """Print the figures."""
        for line in self.misses[:most]:
            print("  miss", line)
        total = sum(n for (_, found), n in self.table.items() if found != "UNKNOWN")
        right = sum(n for (a, b), n in self.table.items() if a == b and b != "UNKNOWN")
        print(f"{sum(self.table.values())} elements in view, {total} decided, {right / max(total, 1):.4f} right")
        print(f"undecided between the epochs because another element has their surface: {self.shared}")
        for state in ("CONFIRMED", "NEW", "DISAPPEARED", "PARTIAL"):
            right = self.table[state, state]
            said = sum(n for (_, found), n in self.table.items() if found == state)
            true = sum(n for (want, found), n in self.table.items() if want == state and found != "UNKNOWN")
            if said or true:
                print(f"{state:12} precision {right / max(said, 1):.3f} ({right}/{said})  "
                      f"recall {right / max(true, 1):.3f} ({right}/{true})")
        print(f"standing or hidden elements called disappeared: {len(self.false_gone)}")
        for line in self.false_gone[:5]:
            print("  ", line)
        for least, named in ((FULLY, "fully"), (HALF, "half")):
            rows = np.array([c[1:4] for c in self.cut if c[0] >= least])
            if len(rows):
                stands, gone, shape = (np.abs(column) for column in rows.T)
                print(f"of {len(rows)} {named} seen elements that are cut, of the planned volume: standing off by "
                      f"{spread(stands)}, gone {spread(gone)}, remaining shape {spread(shape)}, all within 5 %: "
                      f"{int((np.abs(rows) <= 0.05).all(axis=1).sum())}")
        for _, stands, gone, shape, line in sorted(self.cut, key=lambda c: -max(map(abs, c[1:4])))[:most]:
            print(f"   standing {100 * stands:+.1f} %, gone {100 * gone:+.1f} %, shape {100 * shape:+.1f} %: {line}")
        if self.volumes:
            error = np.abs([v for v, _ in self.volumes])
            print(f"volumes of {len(error)} fully seen elements: error median {100 * np.median(error):.1f} %, "
                  f"95th percentile {100 * np.quantile(error, 0.95):.1f} %, largest {100 * error.max():.1f} %, "
                  f"within 5 %: {int((error <= 0.05).sum())}")
            for error_of, line in sorted(self.volumes, key=lambda v: -abs(v[0]))[:5]:
                print(f"   {100 * error_of:+.1f} % {line}")


if __name__ == "__main__":
    main()
