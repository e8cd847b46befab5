"""``bim-verify update``: displaced elements of a verified model to their as-built place, and back."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from ..errors import BimVerifyError
from ..files import whole_file
from ..progress import Progress
from .checks import check_outputs, check_report
from .table import COMMON, Argument, Command, Outcome, Values


def _update(values: Values, progress: Progress) -> Outcome:
    from ..model.load import open_ifc
    from ..report.page_frame import PAGE
    from ..update.report import write_update_report
    from ..update.update import UpdatedFile, undo_file, update_file, update_lines

    if Path(values["out"]).suffix.lower() != ".ifc":
        raise BimVerifyError(f"--out {values['out']} must end with .ifc.")
    outputs = [values[key] for key in ("out", "json") if values[key]]
    check_outputs([values["model"]], outputs)
    if values["report"]:
        check_report(values["report"], (PAGE,), [values["model"]], outputs)
    progress.update(0.0, "Reading the model")
    file = open_ifc(values["model"])
    result = undo_file(file) if values["undo"] else update_file(file)

    def write() -> None:
        from ..model.write_psets import write_open_file

        with whole_file(values["out"]) as temporary:
            write_open_file(file, temporary, values["out"])
        if values["report"]:
            write_update_report(values["report"], result, values["model"], values["undo"])

    data = {"undo": values["undo"], "updates": [asdict(u) for u in result.updates], "notes": list(result.notes)}
    lines = [*update_lines(result, values["undo"]), f"Model: {values['out']}"]
    if values["report"]:
        lines.append(f"Report: {Path(values['report']) / PAGE}")
    return Outcome(lines, data, UpdatedFile(result, file), write)


COMMAND = Command(
    "update",
    "move the elements of a verified model that were found displaced to where they stand, or put them back",
    (
        Argument("MODEL", "verified IFC file (bim-verify verify ... --out)", required=True),
        Argument("--out", "IFC file to write", required=True),
        Argument("--undo", "put back what an earlier update moved", flag=True),
        Argument("--report", "folder for the report (one HTML page)"),
        *(argument for argument in COMMON if argument.name in ("--json", "--blend", "--quiet")),
    ),
    _update,
)
