"""``bim-verify demo``: the main job on a house made for it."""

from __future__ import annotations

import json
from pathlib import Path

from ..files import whole_file
from ..options import VerifyOptions
from ..progress import Progress
from .table import COMMON, Argument, Command, Outcome, Values
from .verify import summary_lines

DEMO_SPACING_M = 0.05
"""Query positions of the demo: close enough to look at, and done in a minute."""


def _demo(values: Values, progress: Progress) -> Outcome:
    from ..model.write_psets import write_verified_ifc
    from ..report.html import PAGE, write_report
    from ..report.json_out import result_to_json
    from ..report.samples_ply import write_samples
    from ..simulation.demo import make_demo
    from ..simulation.score import score

    folder = Path(values["out"])
    files = make_demo(folder, seed=values["seed"], progress=progress.part(0.0, 0.5))
    from ..jobs import verify

    options = VerifyOptions(
        sample_spacing=DEMO_SPACING_M, threads=values["threads"], memory_gb=values["memory_gb"],
        cache=not values["no_cache"],
    )
    result = verify(files.model, [files.scan], options, progress.part(0.5, 0.9))
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

    def write() -> None:
        write_verified_ifc(files.model, result, folder / "house_verified.ifc")
        write_samples(folder / "samples.ply", result)
        write_report(folder / "report", result, progress=progress.part(0.9, 1.0))
        with whole_file(folder / "result.json") as temporary:
            temporary.write_text(json.dumps(data, indent=1, allow_nan=False), encoding="utf-8")

    return Outcome(lines, data, result, write)


COMMAND = Command(
    "demo",
    "make a small house, scan it with a simulated scanner, and verify it",
    (
        Argument("--out", "folder to write to", str, "demo"),
        Argument("--seed", "seed of the simulated scan", int, 1),
        *COMMON,
    ),
    _demo,
)
