"""``bim-verify change``: what changed between epochs and against the model."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ..change.results import STATES, ChangeResult
from ..errors import BimVerifyError
from ..options import MOST_MIN_POINTS, MOST_VOXEL_M, ChangeOptions
from ..progress import Progress
from .checks import (
    check_folder,
    check_outputs,
    check_report,
    input_options,
    larger_than_zero,
    refuse_same,
    zero_or_more,
)
from .table import ALIGN, COMMON, MODEL, ORIGIN, Argument, Command, Outcome, Values

DEFAULT = ChangeOptions()


def change_options(values: Values) -> ChangeOptions:
    """Options of a comparison from a command's values."""
    from ..change.planned import check_day

    larger_than_zero(values, "voxel_mm", "sigma_mm")
    zero_or_more(values, "registration_sigma_mm")
    most_mm = 1000 * MOST_VOXEL_M
    if not 1 <= values["voxel_mm"] <= most_mm:
        raise BimVerifyError(f"--voxel-mm must be 1 to {most_mm:g} millimetres, not {values['voxel_mm']:g}.")
    if not 1 <= values["min_points"] <= MOST_MIN_POINTS:
        raise BimVerifyError(f"--min-points must be 1 to {MOST_MIN_POINTS}, not {values['min_points']}.")
    registration = values["registration_sigma_mm"]
    return ChangeOptions(
        voxel=values["voxel_mm"] / 1000,
        min_points=values["min_points"],
        loa=values["loa"],
        sigma=values["sigma_mm"] / 1000,
        registration_sigma=None if registration is None else registration / 1000,
        align=values["align"],
        date=check_day(values["date"] or "", "--date"),
        **input_options(values),
    )


def _change(values: Values, progress: Progress) -> Outcome:
    from ..change.psets import write_changed_ifc
    from ..jobs import change
    from ..report.change_files import change_to_json, write_voxels
    from ..report.change_page import write_change_report
    from ..report.html import PAGE, TABLE
    from ..report.remaining import SHAPES, write_remaining

    options = change_options(values)
    reference = values["reference"] or []
    inputs = [values["model"], *reference, *(path for epoch in values["epoch"] for path in epoch)]
    outputs = [values[key] for key in ("out", "voxels", "json") if values[key]]
    check_outputs(inputs, outputs)
    if values["report"]:
        check_report(values["report"], (PAGE, TABLE), inputs, outputs)
    if values["remaining"]:
        check_folder(values["remaining"])
        refuse_same(values["remaining"], outputs)
    result = change(values["model"], values["epoch"], reference or None, options, progress.part(0.0, 0.9))
    lines = [*summary_lines(result), f"Property sets: {values['out']}"]
    if values["voxels"]:
        lines.append(f"{len(result.voxels.state):,} voxels: {values['voxels']}")
    if values["remaining"]:
        lines.append(f"Remaining shapes: {Path(values['remaining']) / SHAPES}")
    if values["report"]:
        lines.append(f"Report: {Path(values['report']) / PAGE}")

    def write() -> None:
        write_changed_ifc(values["model"], result, values["out"])
        if values["voxels"]:
            write_voxels(values["voxels"], result)
        if values["remaining"]:
            write_remaining(values["remaining"], result)
        if values["report"]:
            write_change_report(values["report"], result, progress=progress.part(0.9, 1.0))

    return Outcome(lines, change_to_json(result), result, write)


def summary_lines(result: ChangeResult) -> list[str]:
    """The result in a few lines for a person."""
    found = result.summary()
    against = "the reference epoch" if result.reference else "the model"
    counts = ", ".join(f"{found[state]} {state}" for state in STATES)
    lines = [
        f"{found['elements']} elements against {against}: {counts}.",
        f"Gone {found['disappeared_volume']:.3f} m3, standing {found['built_volume']:.3f} m3, "
        f"summed over elements, in voxels of {1000 * result.edge:g} mm.",
    ]
    for epoch in result.series:
        if epoch.alignment.mode != "none":
            weakest = epoch.alignment.weakest_direction or "all six directions are fixed"
            lines.append(f"Alignment of the {epoch.name} ({epoch.alignment.mode}): {weakest}")
    if places := result.places():
        lines.append(places)
    if new := [c for c in result.clusters if c.kind == "NEW" and not c.inside]:
        neither = "neither in the model nor in the reference" if result.reference else "not in the model"
        lines.append(f"Groups of voxels that are {neither}: {len(new)}; the largest holds {new[0].voxels:,}.")
    if any(p.act for p in result.planned):
        late = sum(e.progress in ("late", "not built", "should be gone") for e in result.elements)
        early = sum(e.progress == "early" for e in result.elements)
        lines.append(f"Progress: {late} elements are late, not built or should be gone, {early} early.")
    lines += [f"Note: {warning}" for warning in result.warnings[:5]]
    return lines


COMMAND = Command(
    "change",
    "say what appeared, vanished or stayed between epochs of scans and against the model, and how far the work has come",
    (
        MODEL,
        Argument(
            "--epoch", "scan files of one epoch; give it again for later epochs, in order of time", many=True,
            required=True, repeat=True,
        ),
        Argument("--reference", "scan files of the epoch to compare with (default: the model)", many=True),
        Argument("--out", "IFC file to write, with a property set on every element", required=True),
        Argument("--voxel-mm", "edge of a voxel, millimetres", float, 10.0),
        Argument("--min-points", "returns that make a voxel occupied", int, DEFAULT.min_points),
        Argument("--voxels", "PLY file of all voxels with their state"),
        Argument("--report", "folder for the report (one HTML page, one CSV)"),
        Argument("--remaining", "folder for the remaining shapes of partly demolished elements (OBJ) and a table of them"),
        Argument("--loa", "level of accuracy that the result is wanted for: warns if voxels cannot support it",
                 int, None, (10, 20, 30, 40, 50)),
        Argument("--date", "day of the last epoch, like 2025-03-31, for scans that do not say it"),
        Argument("--sigma-mm", "standard deviation of one return along its ray, millimetres", float, 2.5),
        Argument(
            "--registration-sigma-mm",
            "standard deviation of a station's position, millimetres (default: from the stations' agreement)", float,
        ),
        replace(ALIGN, help=f"{ALIGN.help}; every epoch, and the reference, for itself"),
        Argument("--frame", "frame the scans are in", str, DEFAULT.scan_frame, ("auto", "model", "map")),
        ORIGIN,
        *COMMON,
    ),
    _change,
)
