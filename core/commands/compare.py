"""``bim-verify compare``: one building model against another."""

from __future__ import annotations

from pathlib import Path

from ..progress import Progress
from .checks import check_outputs, check_report
from .table import COMMON, Argument, Command, Outcome, Values


def _compare(values: Values, progress: Progress) -> Outcome:
    from ..reconstruction.compare import compare, comparison_lines, comparison_to_json
    from ..reconstruction.compare_report import write_comparison_report
    from ..reconstruction.shapes import read_shapes
    from ..report.page_frame import PAGE

    inputs, outputs = [values["model"], values["reference"]], [values["json"]] if values["json"] else []
    check_outputs(inputs, outputs)
    if values["report"]:
        check_report(values["report"], (PAGE,), inputs, outputs)
    progress.update(0.0, "Reading the model")
    found = read_shapes(values["model"])
    progress.update(0.5, "Reading the reference")
    result = compare(found, read_shapes(values["reference"]))
    lines = comparison_lines(result)
    if values["report"]:
        lines.append(f"Report: {Path(values['report']) / PAGE}")

    def write() -> None:
        if values["report"]:
            write_comparison_report(values["report"], result, values["model"], values["reference"])

    data = {"model": values["model"], "reference": values["reference"], **comparison_to_json(result)}
    return Outcome(lines, data, None, write)


COMMAND = Command(
    "compare",
    "compare a building model with another: what is in both, and the differences of places and sizes",
    (
        Argument("MODEL", "IFC file that is compared", required=True),
        Argument("REFERENCE", "IFC file that it is compared with", required=True),
        Argument("--report", "folder for the report (one HTML page)"),
        *(argument for argument in COMMON if argument.name in ("--json", "--quiet")),
    ),
    _compare,
    shown=False,
)
