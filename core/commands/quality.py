"""``bim-verify quality``: what a scan campaign is worth, what it misses, and why."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import BimVerifyError
from ..progress import Progress
from ..quality.options import QualityOptions
from .checks import check_outputs, check_report, input_options, larger_than_zero
from .table import COMMON, MODEL, ORIGIN, SCANS, Argument, Command, Outcome, Values

if TYPE_CHECKING:
    from ..quality.results import QualityResult

DEFAULT = QualityOptions()


def quality_options(values: Values) -> QualityOptions:
    """Options of a quality survey from a command's values."""
    larger_than_zero(values, "spacing_mm", "patch_m", "window_mm", "queries")
    if not 0 < values["coverage"] <= 1:
        raise BimVerifyError(f"--coverage must be a share, 0 to 1, not {values['coverage']:g}.")
    if not 0 < values["max_incidence"] < 90:
        raise BimVerifyError(f"--max-incidence must be between 0 and 90 degrees, not {values['max_incidence']:g}.")
    reach = values["range_max"]
    if reach is not None and not 0 < reach < math.inf:
        raise BimVerifyError(f"--range-max must be a number of metres larger than zero, not {reach:g}.")
    return QualityOptions(
        loa=values["loa"], sample_spacing=values["spacing_mm"] / 1000, patch_size=values["patch_m"],
        window=values["window_mm"] / 1000, max_incidence=math.radians(values["max_incidence"]), range_max=reach,
        target_coverage=values["coverage"], most_queries=values["queries"], **input_options(values),
    )


def _quality(values: Values, progress: Progress) -> Outcome:
    from ..jobs import quality
    from ..quality.json_out import quality_to_json, write_patches, write_quality_samples
    from ..quality.report import write_quality_report
    from ..quality.write_ifc import write_quality_ifc
    from ..report.page_frame import PAGE

    options = quality_options(values)
    inputs = [values["model"], *values["scan"]]
    outputs = [values[key] for key in ("out", "patches", "samples", "json") if values[key]]
    check_outputs(inputs, outputs)
    if values["report"]:
        check_report(values["report"], (PAGE,), inputs, outputs)
    result = quality(values["model"], values["scan"], options, progress.part(0.0, 0.9))
    lines = [*quality_lines(result), f"Property sets: {values['out']}"]
    if values["report"]:
        lines.append(f"Report: {Path(values['report']) / PAGE}")

    def write() -> None:
        write_quality_ifc(values["model"], result, values["out"])
        if values["patches"]:
            write_patches(values["patches"], result)
        if values["samples"]:
            write_quality_samples(values["samples"], result)
        if values["report"]:
            write_quality_report(values["report"], result)

    return Outcome(lines, quality_to_json(result), result, write)


def quality_lines(result: QualityResult) -> list[str]:
    """The result in a few lines for a person."""
    lines = [result.headline]
    lines += [f"{factor.name}: {factor.text}." for factor in result.factors]
    missing = [f"{share:.1%} {cause}" for cause, share in result.whole.missing.items() if share >= 0.0005]
    if missing:
        lines.append(f"Missing: {', '.join(missing)}.")
    if result.clutter:
        largest = result.clutter[0]
        middle = ", ".join(f"{0.5 * (a + b):.1f}" for a, b in zip(largest.low, largest.high, strict=True))
        lines.append(
            f"Things that are not in the model and hide parts of it: {len(result.clutter)}; the largest hides "
            f"{largest.hidden_area:.2f} m2 near ({middle})."
        )
    lines += [f"Note: {warning}" for warning in result.warnings[:5]]
    return lines


COMMAND = Command(
    "quality",
    "say what a scan campaign is worth for every element, what it misses, and why",
    (
        MODEL,
        SCANS,
        Argument("--out", "IFC file to write, with a property set on every element", required=True),
        Argument("--loa", "level of accuracy that the scans should support", int, DEFAULT.loa, (10, 20, 30, 40, 50)),
        Argument("--coverage", "share of an element's surface that should have returns", float, DEFAULT.target_coverage),
        Argument("--spacing-mm", "distance between query positions, millimetres", float, 1000 * DEFAULT.sample_spacing),
        Argument(
            "--queries", "most query positions over all elements; the distance grows to keep to it", int, DEFAULT.most_queries
        ),
        Argument("--patch-m", "size of the patches, metres", float, DEFAULT.patch_size),
        Argument(
            "--window-mm", "a return this close to the planned surface lies on it, millimetres", float, 1000 * DEFAULT.window
        ),
        Argument("--max-incidence", "steepest incidence angle that counts, degrees", float, 80.0),
        Argument("--range-max", "longest range of the scanner in metres (default: from the returns)", float),
        Argument("--frame", "frame the scans are in", str, DEFAULT.scan_frame, ("auto", "model", "map")),
        ORIGIN,
        Argument("--patches", "CSV file with the quality of every patch"),
        Argument("--samples", "PLY file of all query positions, coloured by the cause of what is missing"),
        Argument("--report", "folder for the report (one HTML page)"),
        *COMMON,
    ),
    _quality,
)
