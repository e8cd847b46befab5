"""``bim-verify displacement``: how a panelled wall has moved between two epochs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import BimVerifyError
from ..progress import Progress
from .checks import check_outputs, check_report, input_options, parse_place
from .compare_clouds import compare
from .table import COMMON, ORIGIN, Argument, Command, Outcome, Values

if TYPE_CHECKING:
    from ..jobs.displacement import DisplacementOptions


def displacement_options(values: Values) -> DisplacementOptions:
    """Options of a comparison from a command's values."""
    from ..jobs.displacement import DisplacementOptions

    sigma = values["registration_sigma_mm"]
    if not 0 <= sigma < 1000:
        raise BimVerifyError(f"--registration-sigma-mm must be 0 to 1000, not {sigma:g}.")
    return DisplacementOptions(
        registration_sigma=sigma / 1000, near=parse_place("--near", values["near"]), **input_options(values)
    )


def _displacement(values: Values, progress: Progress) -> Outcome:
    from ..jobs.displacement import displacement
    from ..report.page_frame import PAGE
    from ..wall_displacement.psets import write_displacement_ifc
    from ..wall_displacement.report import write_displacement_report
    from ..wall_displacement.tables import displacement_to_json, summary_lines, write_joints

    options = displacement_options(values)
    if values["m3c2"]:
        if given := [f"--{k.replace('_', '-')}" for k in ("near", "model", "element", "out_ifc", "report") if values[k]]:
            raise BimVerifyError(f"{given[0]} belongs to a panelled wall; --m3c2 compares whole clouds, so leave it out.")
        return compare(values, progress)
    model, element, out_ifc = values["model"], values["element"], values["out_ifc"]
    if any((model, element, out_ifc)) and not all((model, element, out_ifc)):
        raise BimVerifyError("--model, --element and --out-ifc belong together: give all three, or none of them.")
    inputs = [values["base"], values["later"], *([model] if model else [])]
    outputs = [values[key] for key in ("out", "out_ifc", "json") if values[key]]
    check_outputs(inputs, outputs)
    if values["report"]:
        check_report(values["report"], (PAGE,), inputs, outputs)
    wall = (model, element) if model else None
    result = displacement([values["base"]], [values["later"]], options, progress, wall)
    lines = [*summary_lines(result), f"Joints: {values['out']}"]
    if out_ifc:
        lines.append(f"Property set: {out_ifc}")
    if values["report"]:
        lines.append(f"Report: {Path(values['report']) / PAGE}")

    def write() -> None:
        write_joints(values["out"], result)
        if out_ifc:
            write_displacement_ifc(model, element, result, out_ifc)
        if values["report"]:
            write_displacement_report(values["report"], result)

    return Outcome(lines, displacement_to_json(result), result, write)


COMMAND = Command(
    "displacement",
    "say how the joints of a panelled wall have moved between two scans",
    (
        Argument("BASE", "scan of the base epoch", required=True),
        Argument("LATER", "scan of the later epoch, registered to the same frame", required=True),
        Argument("--out", "CSV file to write, one line a joint", required=True),
        Argument("--registration-sigma-mm", "standard deviation of the registration between the epochs", float, 1.0),
        Argument("--m3c2", "compare whole clouds instead, a dense cloud with a scan: M3C2 distances by point", flag=True),
        Argument("--near", "X,Y,Z of a point on the wall in metres, where the scans hold several walls"),
        Argument("--model", "IFC file in which the wall is an element, in the scans' frame"),
        Argument("--element", "GlobalId of the wall in the model"),
        Argument("--out-ifc", "IFC file to write: the model with a property set on the wall"),
        ORIGIN,
        Argument("--report", "folder for the report (one HTML page)"),
        *COMMON,
    ),
    _displacement,
)
