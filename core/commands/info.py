"""``bim-verify info``: what files hold."""

from __future__ import annotations

from pathlib import Path

from ..progress import Progress
from .table import COMMON, Argument, Command, Outcome, Values


def _info(values: Values, progress: Progress) -> Outcome:
    from ..model.describe import describe_model, format_model, is_ifc
    from ..scans.info import describe, format_description

    found, lines = [], []
    for number, path in enumerate(values["file"]):
        progress.update(number / len(values["file"]), f"Reading {Path(path).name}")
        if is_ifc(path):
            found.append(describe_model(path))
            lines.append(format_model(found[-1]))
        else:
            found.append(describe(path))
            lines.append(format_description(found[-1]))
    return Outcome(lines, {"files": found})


COMMAND = Command(
    "info",
    "say what IFC and scan files hold",
    (Argument("FILE", "IFC or scan files", many=True, required=True), *COMMON),
    _info,
    shown=False,
)
