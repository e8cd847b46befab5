"""``bim-verify reconstruct``: scans to a building model."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..errors import BimVerifyError
from ..options import ReconstructOptions
from ..progress import Progress
from .checks import check_outputs, check_report, input_options, larger_than_zero, zero_or_more
from .table import COMMON, ORIGIN, SCANS, Argument, Command, Outcome, Values


def reconstruct_options(values: Values) -> ReconstructOptions:
    """Options of a reconstruction from a command's values."""
    larger_than_zero(values, "sigma_mm")
    zero_or_more(values, "registration_sigma_mm")
    registration = values["registration_sigma_mm"]
    return ReconstructOptions(
        sigma=values["sigma_mm"] / 1000, registration_sigma=None if registration is None else registration / 1000,
        **input_options(values),
    )


def _reconstruct(values: Values, progress: Progress) -> Outcome:
    from ..dimensions.table import write_dimensions
    from ..jobs import reconstruct
    from ..reconstruction.compare import compare, comparison_lines, comparison_to_json
    from ..reconstruction.dimensions import dimension_rows
    from ..reconstruction.report import write_reconstruction_report
    from ..reconstruction.shapes import read_shapes, shapes_of
    from ..reconstruction.summary import reconstruction_to_json, summary_lines
    from ..reconstruction.write_ifc import write_building_file, written_building
    from ..report.page_frame import PAGE

    options = reconstruct_options(values)
    if Path(values["out"]).suffix.lower() != ".ifc":
        raise BimVerifyError(f"--out {values['out']} must end with .ifc.")
    if values["dimensions"] and Path(values["dimensions"]).suffix.lower() != ".csv":
        raise BimVerifyError(f"--dimensions {values['dimensions']} must end with .csv.")
    inputs = [*values["scan"], *([values["compare"]] if values["compare"] else [])]
    outputs = [values[key] for key in ("out", "json", "dimensions") if values[key]]
    check_outputs(inputs, outputs)
    if values["report"]:
        check_report(values["report"], (PAGE,), inputs, outputs)
    reference = read_shapes(values["compare"]) if values["compare"] else None
    result = reconstruct(values["scan"], options, progress.part(0.0, 0.95))
    lines = summary_lines(result)
    building, ids = written_building(result)
    data: dict[str, Any] = reconstruction_to_json(result, ids)
    comparison = None
    if reference is not None:
        comparison = compare(shapes_of(building, values["out"]), reference)
        lines += comparison_lines(comparison)
        data["comparison"] = comparison_to_json(comparison)
    lines.append(f"Model: {values['out']}")
    if values["dimensions"]:
        lines.append(f"Dimensions: {values['dimensions']}")
    if values["report"]:
        lines.append(f"Report: {Path(values['report']) / PAGE}")

    def write() -> None:
        write_building_file(values["out"], building)
        if values["dimensions"]:
            write_dimensions(values["dimensions"], dimension_rows(result, ids))
        if values["report"]:
            write_reconstruction_report(values["report"], result, comparison)

    return Outcome(lines, data, result, write)


COMMAND = Command(
    "reconstruct",
    "make a building model (IFC4) from scans: rooms, walls, openings, columns, slabs",
    (
        SCANS,
        Argument("--out", "IFC file to write", required=True),
        Argument("--compare", "reference IFC file that the model is compared with"),
        Argument("--sigma-mm", "standard deviation of one return along its ray, millimetres", float, 2.5),
        Argument(
            "--registration-sigma-mm",
            "standard deviation of a station's position, millimetres (default: from the stations' agreement)", float,
        ),
        ORIGIN,
        Argument(
            "--dimensions",
            "CSV file of rooms and openings: widths, heights, vertices, edges, slopes, unevenness, and tests of plumb, square, "
            "parallel and flat",
        ),
        Argument("--report", "folder for the report (one HTML page)"),
        *COMMON,
    ),
    _reconstruct,
)
