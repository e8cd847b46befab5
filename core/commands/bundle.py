"""``bim-verify bundle``: adjust cameras and tie points."""

from __future__ import annotations

import math
from pathlib import Path

from ..errors import BimVerifyError
from ..progress import Progress
from .checks import check_outputs, check_report, larger_than_zero
from .table import Argument, Command, Outcome, Values


def _bundle(values: Values, progress: Progress) -> Outcome:
    from ..imagery.bundle_project import adjusted_project, imported_files
    from ..imagery.bundle_report import scaling, summary, write_bundle_report
    from ..jobs.bundle import ModelEdges, bundle
    from ..report.json_out import to_plain, write_document
    from ..report.page_frame import PAGE

    if values["threads"] < 0:
        raise BimVerifyError(f"--threads must be zero (all) or more, not {values['threads']}.")
    images = values["edges"] or []
    if bool(images) != bool(values["model"]):
        raise BimVerifyError("--model and --edges belong together: give the model and images that show its edges, or neither.")
    larger_than_zero(values, "position_sigma_m", "rotation_sigma_deg", "memory_gb")
    inputs = [values["project"], *imported_files(values["project"]), *images, *([values["model"]] if values["model"] else [])]
    outputs = [values["out"], *([values["json"]] if values["json"] else [])]
    check_outputs(inputs, outputs)
    if values["report"]:
        check_report(values["report"], (PAGE,), inputs, outputs)
    edges = ModelEdges(
        model=values["model"], images=images, loa=values["loa"], position_sigma=values["position_sigma_m"],
        rotation_sigma=math.radians(values["rotation_sigma_deg"]),
    ) if images else None
    found = bundle(
        values["project"], robust=not values["plain"], threads=values["threads"], memory_gb=values["memory_gb"], edges=edges,
        progress=progress,
    )
    facts = summary(found.problem, found.result)
    lines = [
        f"{facts['images']} images, {facts['points']} tie points, {facts['observations']} observations, "
        f"{facts['control_points']} control points.",
        *([f"Left out: {len(found.left_out)} points that fewer than two images show."] if len(found.left_out) else []),
        f"Sigma 0 {facts['sigma0']:.3f}, redundancy {facts['redundancy']}, residuals {facts['residual_rms_px']:.2f} px, "
        f"{facts['rejected']} observations taken out.",
        scaling(found.result),
        f"Tie points: sigma {1000 * facts['point_sigma_median']:.2f} mm (median), "
        f"{1000 * facts['point_sigma_p95']:.2f} mm (95 %).",
        *(f"  {name} on the model: {state}" for name, state in found.placed.items()),
        *(f"  {g.name}: variance component {g.factor:.3f}, redundancy {g.redundancy:.0f}" for g in found.result.groups),
        f"Adjusted project: {values['out']}",
    ]
    if values["report"]:
        lines.append(f"Report: {Path(values['report']) / PAGE}")

    def write() -> None:
        write_document(values["out"], adjusted_project(found.problem, found.result, found.method, found.left_out))
        if values["report"]:
            write_bundle_report(
                values["report"], Path(values["project"]).name, found.problem, found.result, found.method, len(found.left_out)
            )

    data = to_plain({
        "summary": facts, "groups": found.result.groups, "timings": found.timings, "placed": found.placed,
        "method": found.method, "left_out": found.left_out, "covariance_scale": found.result.covariance_scale,
    })
    return Outcome(lines, data, found, write)


COMMAND = Command(
    "bundle",
    "adjust cameras and tie points, with the covariance of every point",
    (
        Argument("PROJECT", "JSON file of the project, a COLMAP folder or a Bundler file (.out)", required=True),
        Argument("--out", "adjusted project to write (JSON)", required=True),
        Argument("--model", "IFC file whose edges tie the block, in the project's frame"),
        Argument("--edges", "images of the project in which the model's edges are looked for", many=True),
        Argument("--loa", "level of accuracy that the model's edges have", int, 30, (10, 20, 30, 40, 50)),
        Argument("--position-sigma-m", "standard deviation of those images' given positions, metres per axis", float, 0.15),
        Argument("--rotation-sigma-deg", "standard deviation of their given directions, degrees per axis", float, 1.0),
        Argument("--plain", "plain least squares: gross errors keep their weight", flag=True),
        Argument("--report", "folder for the report (one HTML page)"),
        Argument("--json", "write what was found to this file"),
        Argument("--quiet", "show no progress", flag=True),
        Argument("--threads", "processor threads to use (0: all)", int, 0),
        Argument("--memory-gb", "memory for the adjustment, gigabytes; one that takes more is refused", float, 3.0),
    ),
    _bundle,
)
