"""``bim-verify classify``: every return to its element."""

from __future__ import annotations

from pathlib import Path

from ..classification.results import Classification
from ..errors import BimVerifyError
from ..options import ClassifyOptions
from ..progress import Progress
from .checks import check_outputs, check_report, input_options, larger_than_zero, zero_or_more
from .table import COMMON, MODEL, ORIGIN, SCANS, Argument, Command, Outcome, Values

DEFAULT = ClassifyOptions()
LAS_SUFFIXES = (".las", ".laz")


def classify_options(values: Values) -> ClassifyOptions:
    """Options of a classification from a command's values."""
    larger_than_zero(values, "sigma_mm")
    zero_or_more(values, "registration_sigma_mm")
    registration = values["registration_sigma_mm"]
    return ClassifyOptions(
        loa=values["loa"], sigma=values["sigma_mm"] / 1000, as_built=values["as_built"],
        registration_sigma=None if registration is None else registration / 1000, **input_options(values),
    )


def _classify(values: Values, progress: Progress) -> Outcome:
    from ..classification.report import write_classification_report
    from ..classification.results import classification_to_json
    from ..classification.write import write_classified
    from ..jobs import classify
    from ..report.page_frame import PAGE

    options = classify_options(values)
    suffix = Path(values["out"]).suffix.lower()
    if suffix not in (".e57", *LAS_SUFFIXES):
        raise BimVerifyError(f"--out {values['out']} must end with .e57, .las or .laz.")
    if (values["per_station"] or values["fields"]) and suffix != ".e57":
        raise BimVerifyError("--per-station and --fields are for E57 files; in LAS files each point names its station.")
    inputs, outputs = [values["model"], *values["scan"]], [values[key] for key in ("out", "json") if values[key]]
    check_outputs(inputs, outputs)
    if values["report"]:
        check_report(values["report"], (PAGE,), inputs, outputs)
    result = classify(values["model"], values["scan"], options, progress.part(0.0, 0.6))
    lines = [result.summary(), *_notes(result, values["scan"]), f"Classified cloud: {values['out']}"]
    if values["report"]:
        lines.append(f"Report: {Path(values['report']) / PAGE}")

    def write() -> None:
        write_classified(
            values["out"], result, options.memory_gb, progress.part(0.6, 1.0), per_station=values["per_station"],
            fields=values["fields"],
        )
        if values["report"]:
            write_classification_report(values["report"], result)

    return Outcome(lines, classification_to_json(result), result, write)


def _notes(result: Classification, scans: list[str]) -> list[str]:
    out = []
    if result.moved or result.absent:
        out.append(
            f"{len(result.moved)} moved elements were looked for where they stand, {len(result.absent)} absent ones not at all."
        )
    lost = result.dropped
    if lost.total:
        out.append(
            f"Note: {lost.total:,} points of the scans are no returns and are left out: {lost.invalid:,} marked invalid, "
            f"{lost.zero:,} at the scanner itself, {lost.not_finite:,} without a finite place."
        )
    again = {path for path in scans if sum(Path(other).resolve() == Path(path).resolve() for other in scans) > 1}
    if again:
        out.append(f"Note: given more than once, so that their returns count again: {', '.join(sorted(again))}.")
    return out


COMMAND = Command(
    "classify",
    "assign every return of scans to the model's element that it met, and write the cloud element by element",
    (
        MODEL,
        SCANS,
        Argument("--out", "E57 file to write, one scan an element; .las or .laz: with classification codes", required=True),
        Argument("--as-built", "verify first, and look for moved elements where they stand", flag=True),
        Argument("--per-station", "E57: one scan for each element and station, with that station's pose", flag=True),
        Argument(
            "--fields", "E57: also the columns bv:station and bv:deviation, which some readers refuse", flag=True
        ),
        Argument("--loa", "level of accuracy of the planned surfaces", int, DEFAULT.loa, (10, 20, 30, 40, 50)),
        Argument(
            "--sigma-mm", "standard deviation of one return along its ray, millimetres", float, 1000 * DEFAULT.sigma
        ),
        Argument(
            "--registration-sigma-mm",
            "standard deviation of a station's position, millimetres (default: as found by --as-built, else 2)", float,
        ),
        Argument("--frame", "frame the scans are in", str, DEFAULT.scan_frame, ("auto", "model", "map")),
        ORIGIN,
        Argument("--report", "folder for the report (one HTML page)"),
        *COMMON,
    ),
    _classify,
)
