"""``bim-verify demo``: the main job on a house made for it."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from ..files import all_or_none
from ..options import ChangeOptions, VerifyOptions
from ..progress import Progress
from .table import COMMON, Argument, Command, Outcome, Values
from .verify import summary_lines

if TYPE_CHECKING:
    from ..simulation.demo import DemoFiles

DEMO_VOXEL_M = 0.03
"""Voxels of the demo: as coarse as its scanner's returns lie apart."""
DEMO_SPACING_M = 0.05
"""Query positions of the demo: close enough to look at."""
DEMO_CHANGE_SPACING_M = 0.1
"""Query positions of the comparison of epochs, as in ``scripts/bench_change.py``; the voxels are finer."""


def _demo(values: Values, progress: Progress) -> Outcome:
    from ..simulation.rehearsal import kernels_ahead

    house = progress.part(0.0, 0.4) if values["all"] else progress
    with kernels_ahead():
        outcome = _both_epochs(values, house)
    if not values["all"] or outcome.write is None:
        return outcome
    from .demo_tour import tour

    with all_or_none():
        outcome.write()
        house.check()
    lines = list(tour(Path(values["out"]), values, progress.part(0.4, 1.0)))
    return Outcome([*outcome.lines, *lines], outcome.data, outcome.result)


def _both_epochs(values: Values, progress: Progress) -> Outcome:
    from ..model.write_psets import write_verified_ifc
    from ..report.html import PAGE, write_report
    from ..report.json_out import result_to_json, write_document
    from ..report.samples_ply import write_samples
    from ..simulation.demo import make_demo
    from ..simulation.score import score

    folder = Path(values["out"])
    files = make_demo(folder, seed=values["seed"], progress=progress.part(0.0, 0.4))
    from ..jobs import verify

    options = VerifyOptions(
        sample_spacing=DEMO_SPACING_M, threads=values["threads"], memory_gb=values["memory_gb"],
        cache=not values["no_cache"],
    )
    result = verify(files.model, [files.scan], options, progress.part(0.4, 0.65))
    data = result_to_json(result)
    truth = score(result, json.loads(files.truth.read_text(encoding="utf-8")))
    lines = [
        f"A simulated scan of the demo house as it was built: {files.returns:,} returns, {files.scan}",
        *summary_lines(result),
        f"Against the truth: {truth.right} of {truth.scored} verdicts right; median error of a shift "
        f"{1000 * truth.shift_error_median:.1f} mm.",
        f"Model with property sets: {folder / 'house_verified.ifc'}",
        f"Report: {folder / 'report' / PAGE}",
    ]

    changed, write_changes = _later(files, folder, values, progress.part(0.65, 0.9))

    def write() -> None:
        write_changes()
        write_verified_ifc(files.model, result, folder / "house_verified.ifc")
        write_samples(folder / "samples.ply", result)
        write_report(folder / "report", result, progress=progress.part(0.9, 1.0))
        write_document(folder / "result.json", data)

    return Outcome([*lines, *changed], data, result, write)


def _later(
    files: DemoFiles, folder: Path, values: Values, progress: Progress
) -> tuple[list[str], Callable[[], None]]:
    """A second epoch of the demo house, compared with the first: lines for a person, and what writes the files."""
    from ..change.psets import write_changed_ifc
    from ..jobs import change
    from ..report.change_files import write_voxels
    from ..report.change_page import write_change_report
    from ..report.html import PAGE
    from ..simulation.demo import make_later_epoch
    from .change import summary_lines as change_lines

    scan = make_later_epoch(folder, values["seed"], progress=progress.part(0.0, 0.3))
    options = ChangeOptions(
        voxel=DEMO_VOXEL_M, sample_spacing=DEMO_CHANGE_SPACING_M, threads=values["threads"], memory_gb=values["memory_gb"],
        cache=not values["no_cache"],
    )
    result = change(files.model, [[scan]], [files.scan], options, progress.part(0.3, 1.0))

    def write() -> None:
        write_changed_ifc(files.model, result, folder / "house_changed.ifc")
        write_voxels(folder / "voxels.ply", result)
        write_change_report(folder / "change", result)

    return ["A second epoch, later:", *change_lines(result), f"Changes: {folder / 'change' / PAGE}"], write


COMMAND = Command(
    "demo",
    "make a small house, scan it twice with a simulated scanner, verify it, and say what changed",
    (
        Argument("--out", "folder to write to", str, "demo"),
        Argument("--seed", "seed of the simulated scan", int, 1),
        Argument("--all", "show every other command too: some minutes more", flag=True),
        *COMMON,
    ),
    _demo,
)
