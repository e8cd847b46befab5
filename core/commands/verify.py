"""``bim-verify verify``: the main job."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ..errors import BimVerifyError
from ..options import VerifyOptions
from ..progress import Progress
from ..results import STATUSES, VerificationResult
from ..sensing.presets import PRESETS
from . import exports
from .checks import check_outputs, check_report, input_options, larger_than_zero, zero_or_more
from .earlier import earlier_decisions, still_there
from .table import ALIGN, COMMON, MODEL, ORIGIN, SCANS, Argument, Command, Outcome, Values

DEFAULT = VerifyOptions()


def verify_options(values: Values) -> VerifyOptions:
    """Options of a verification from a command's values."""
    larger_than_zero(values, "sigma_mm", "spacing_mm")
    zero_or_more(values, "registration_sigma_mm")
    registration = values["registration_sigma_mm"]
    return VerifyOptions(
        loa=values["loa"],
        sigma=values["sigma_mm"] / 1000,
        registration_sigma=None if registration is None else registration / 1000,
        align=values["align"],
        sample_spacing=values["spacing_mm"] / 1000,
        fusion=values["fusion"],
        preset=values["preset"],
        dense=tuple(values["dense"] or ()),
        **input_options(values),
    )


def _verify(values: Values, progress: Progress) -> Outcome:
    from ..dimensions.openings import opening_shares
    from ..dimensions.table import dimensions_to_json, write_dimensions
    from ..jobs import dimensions as dimensions_of
    from ..jobs import verify
    from ..model.write_psets import write_verified_ifc
    from ..report.html import PAGE, TABLE, write_report
    from ..report.json_out import result_to_json
    from ..report.samples_ply import write_samples

    options = verify_options(values)
    inputs = [values["model"], *values["scan"], *options.dense]
    outputs = [values[key] for key in ("out", "samples", "json", "dimensions", *exports.KEYS) if values[key]]
    check_outputs(inputs, outputs)
    if values["dimensions"] and Path(values["dimensions"]).suffix.lower() != ".csv":
        raise BimVerifyError(f"--dimensions {values['dimensions']} must end with .csv.")
    if values["report"]:
        check_report(values["report"], (PAGE, TABLE), inputs, outputs)
    decisions = earlier_decisions(values["model"], values["out"], values["decisions"])
    found = verify(values["model"], values["scan"], options, progress.part(0.0, 0.8))
    result = replace(found, decisions=still_there(decisions, found))
    data = result_to_json(result)
    dimensions = None
    if values["dimensions"]:
        dimensions = dimensions_of(result, progress=progress.part(0.8, 0.85))
        data["dimensions"] = dimensions_to_json(dimensions)
    lines = [*summary_lines(result), f"Property sets: {values['out']}"]
    if values["report"]:
        lines.append(f"Report: {Path(values['report']) / PAGE}")
    if dimensions is not None:
        lines.append(f"Dimensions: {values['dimensions']}, {len(dimensions)} lines. {opening_shares(dimensions)}")
    lines += exports.lines(values, result)

    def write() -> None:
        write_verified_ifc(values["model"], result, values["out"])
        if values["samples"]:
            write_samples(values["samples"], result)
        if values["report"]:
            write_report(values["report"], result, dimensions=dimensions or (), progress=progress.part(0.85, 0.9))
        if dimensions is not None:
            write_dimensions(values["dimensions"], dimensions)
        exports.write(values, result, progress.part(0.9, 1.0))

    return Outcome(lines, data, result, write)


def summary_lines(result: VerificationResult) -> list[str]:
    """The result in a few lines for a person."""
    summary = result.summary()
    counts = ", ".join(f"{summary[status]} {status}" for status in STATUSES)
    lines = [f"{summary['elements']} elements at LOA{result.options.loa}: {counts}."]
    stations = "photos" if result.photos_only else "stations"
    lines.append(f"{summary['coverage']:.0%} of the exposed surface has evidence from {len(result.stations)} {stations}.")
    record = result.alignment
    if record.mode != "none":
        lines.append(f"Alignment ({record.mode}): {record.weakest_direction or 'all six directions are fixed'}")
    if result.decisions:
        lines.append(f"{len(result.decisions)} verdicts are overruled by a person; the computed ones are kept beside them.")
    lines += [f"Note: {warning}" for warning in result.warnings[:5]]
    if len(result.warnings) > 5:
        lines.append(f"Note: {len(result.warnings) - 5} more notes are in the report.")
    return lines


COMMAND = Command(
    "verify",
    "say for every element whether the scans confirm it, contradict it, or never saw it",
    (
        MODEL,
        SCANS,
        Argument("--out", "IFC file to write, with a property set on every element", required=True),
        Argument("--loa", "required level of accuracy", int, DEFAULT.loa, (10, 20, 30, 40, 50)),
        Argument("--sigma-mm", "standard deviation of one return along its ray, millimetres", float, 2.5),
        Argument(
            "--registration-sigma-mm",
            "standard deviation of a station's position, millimetres (default: from the stations' agreement)",
            float,
        ),
        ALIGN,
        Argument("--spacing-mm", "distance between query positions, millimetres", float, 20.0),
        Argument(
            "--fusion", "rule that combines the returns", str, DEFAULT.fusion,
            ("station", "dempster", "yager", "dubois-prade"),
        ),
        Argument("--preset", "parameters of the belief masses", str, DEFAULT.preset, ("derived", *sorted(PRESETS))),
        Argument("--dense", "dense photogrammetric points, made with the bundle project among the scans", many=True),
        Argument("--frame", "frame the scans are in", str, DEFAULT.scan_frame, ("auto", "model", "map")),
        ORIGIN,
        Argument("--samples", "PLY file of all query positions with their evidence"),
        Argument("--report", "folder for the report (one HTML page, one CSV)"),
        Argument("--dimensions", "CSV file of rooms and openings as built; --report and --json then have them too"),
        Argument("--decisions", "IFC file with a person's decisions (default: those in MODEL and in an earlier --out)"),
        *exports.ARGUMENTS,
        *COMMON,
    ),
    _verify,
)
