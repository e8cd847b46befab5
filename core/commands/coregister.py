"""``bim-verify coregister``: photos onto the model."""

from __future__ import annotations

import math
from pathlib import Path

from ..errors import BimVerifyError
from ..progress import Progress
from .checks import check_outputs, check_report, larger_than_zero
from .table import COMMON, MODEL, Argument, Command, Outcome, Values

DETECTORS = ("lsd", "hough")


def _coregister(values: Values, progress: Progress) -> Outcome:
    from ..imagery.cameras_file import read_cameras
    from ..imagery.coregistration import CoregisterOptions, findings, is_placed, refined_cameras, sigmas, state_of
    from ..imagery.report import write_coregistration_report
    from ..jobs.coregister import coregister
    from ..report.json_out import write_document
    from ..report.page_frame import PAGE

    larger_than_zero(values, "memory_gb", "position_sigma_m", "rotation_sigma_deg")
    if values["threads"] < 0:
        raise BimVerifyError(f"--threads must be zero (all) or more, not {values['threads']}.")
    inputs = [values["model"], *values["image"], values["cameras"]]
    outputs = [values["out"], *([values["json"]] if values["json"] else [])]
    check_outputs(inputs, outputs)
    if values["report"]:
        check_report(values["report"], (PAGE,), inputs, outputs)
    options = CoregisterOptions(
        loa=values["loa"], detector=values["detector"], focal=values["focal"], seed=values["seed"],
        threads=values["threads"], cache=not values["no_cache"],
    )
    cameras = read_cameras(values["cameras"], values["position_sigma_m"], math.radians(values["rotation_sigma_deg"]))
    result = coregister(values["model"], values["image"], cameras, options, progress)
    states = [state_of(found) for found in result.registrations]
    lines = [f"{result.placed} of {len(states)} images are placed on the model."]
    for path, found, state in list(zip(result.images, result.registrations, states, strict=True))[:20]:
        text = f"  {Path(path).name}: {state}"
        if found.covariance is not None and is_placed(found):
            rotation, position = sigmas(found.covariance)
            used = sum(m.kept for m in found.matches)
            text += f", {used} lines, sigma {1000 * position:.1f} mm and {math.degrees(rotation):.3f} deg"
        lines.append(text)
        lines += [f"    Not determined: {weak.text}" for weak in found.weak]
    lines += [f"Note: {warning}" for warning in result.warnings[:10]]
    lines.append(f"Cameras: {values['out']}")
    if values["report"]:
        lines.append(f"Report: {Path(values['report']) / PAGE}")

    def write() -> None:
        write_document(values["out"], refined_cameras(result))
        if values["report"]:
            write_coregistration_report(values["report"], result)

    return Outcome(lines, findings(result), result, write)


COMMAND = Command(
    "coregister",
    "place photos on the model by straight lines that lie on its edges",
    (
        MODEL,
        Argument("IMAGE", "JPEG, PNG or TIFF files", many=True, required=True),
        Argument("--cameras", "cameras.json: interior orientation and coarse pose of every image", required=True),
        Argument("--out", "refined cameras file to write", required=True),
        Argument("--loa", "level of accuracy that the model's edges have", int, 30, (10, 20, 30, 40, 50)),
        Argument("--detector", "line detector: LSD, or Canny and Hough", str, "lsd", DETECTORS),
        Argument("--position-sigma-m", "of coarse positions where the file states none, metres per axis", float, 0.15),
        Argument("--rotation-sigma-deg", "of coarse directions where the file states none, degrees per axis", float, 1.0),
        Argument("--focal", "estimate the focal length too", flag=True),
        Argument("--report", "folder for the report (one HTML page with overlays)"),
        Argument("--seed", "seed of the search", int, 0),
        *COMMON,
    ),
    _coregister,
)
