"""``bim-verify displacement``: how a panelled wall has moved between two epochs."""

from __future__ import annotations

import csv
import io
from typing import Any

from ..errors import BimVerifyError
from ..files import whole_file
from ..progress import Progress
from .checks import check_outputs, input_options, parse_place
from .table import COMMON, ORIGIN, Argument, Command, Outcome, Values

COLUMNS = (
    "Column", "State", "X_m", "Y_m", "Z_m", "Vertical_mm", "VerticalSigma_mm", "VerticalSignificant", "Lateral_mm",
    "LateralSigma_mm", "LateralSignificant", "Opening_mm", "CompletenessBase", "CompletenessLater",
)


def _displacement(values: Values, progress: Progress) -> Outcome:
    from ..jobs.displacement import DisplacementOptions, displacement

    sigma = values["registration_sigma_mm"]
    if not 0 <= sigma < 1000:
        raise BimVerifyError(f"--registration-sigma-mm must be 0 to 1000, not {sigma:g}.")
    check_outputs([values["base"], values["later"]], [values["out"]])
    options = DisplacementOptions(
        registration_sigma=sigma / 1000, near=parse_place("--near", values["near"]), **input_options(values),
    )
    result = displacement([values["base"]], [values["later"]], options, progress)
    rows = [_row(joint) for joint in result.joints]
    paired = [j for j in result.joints if j.state == "PAIRED"]
    moved = sum(bool(j.vertical_significant or j.lateral_significant) for j in paired)
    lines = [
        f"{len(result.columns)} columns, {len(paired)} joints in both epochs, {moved} of them moved significantly.",
        *(f"Note: {warning}" for warning in result.warnings),
        f"Joints: {values['out']}",
    ]

    def write() -> None:
        text = io.StringIO(newline="")
        writer = csv.writer(text)
        writer.writerow(COLUMNS)
        writer.writerows(rows)
        with whole_file(values["out"]) as temporary:
            temporary.write_text(text.getvalue(), encoding="utf-8", newline="")

    data = {"columns": len(result.columns), "joints": [dict(zip(COLUMNS, row, strict=True)) for row in rows]}
    return Outcome(lines, data, result, write)


def _row(joint: Any) -> list[Any]:
    def mm(value: float | None) -> float | None:
        return None if value is None else round(1000 * value, 3)

    return [
        joint.column, joint.state, *(round(float(v), 4) for v in joint.position), mm(joint.vertical), mm(joint.vertical_sigma),
        joint.vertical_significant, mm(joint.lateral), mm(joint.lateral_sigma), joint.lateral_significant, mm(joint.opening),
        round(float(joint.completeness_base), 3), round(float(joint.completeness_later), 3),
    ]


COMMAND = Command(
    "displacement",
    "say how the joints of a panelled wall have moved between two scans",
    (
        Argument("BASE", "scan of the base epoch", required=True),
        Argument("LATER", "scan of the later epoch, registered to the same frame", required=True),
        Argument("--out", "CSV file to write, one line a joint", required=True),
        Argument("--registration-sigma-mm", "standard deviation of the registration between the epochs", float, 1.0),
        Argument("--near", "X,Y,Z of a point on the wall in metres, where the scans hold several walls"),
        ORIGIN,
        *COMMON,
    ),
    _displacement,
)
