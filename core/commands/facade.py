"""``bim-verify facade``: photos of facades to a mock-up model."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..progress import Progress
from .checks import check_outputs, check_report, larger_than_zero
from .table import Argument, Command, Outcome, Values


def parse_corners(text: str) -> NDArray[np.float64]:
    """``X,Y,X,Y,X,Y,X,Y`` in pixels as (4, 2)."""
    try:
        numbers = np.array([float(v) for v in text.replace(" ", ",").split(",") if v], dtype=np.float64)
    except ValueError as error:
        raise BimVerifyError(f"--corners takes X,Y,X,Y,X,Y,X,Y in pixels, not {text[:60]!r}.") from error
    if len(numbers) != 8 or not np.isfinite(numbers).all():
        raise BimVerifyError(f"--corners takes four corners, eight numbers X,Y,X,Y,X,Y,X,Y in pixels, not {text[:60]!r}.")
    return numbers.reshape(4, 2)


def _facade(values: Values, progress: Progress) -> Outcome:
    from ..facade.footprint import read_footprint
    from ..facade.mockup import mockup, write_mockup
    from ..facade.report import facade_to_plain, summary, write_facade_report
    from ..jobs.facade import FacadeOptions, facade
    from ..report.page_frame import PAGE

    larger_than_zero(values, "width", "height", "floor_height")
    images = values["image"]
    outline = values["footprint"]
    if outline and values["width"]:
        raise BimVerifyError("The edges of --footprint give the widths of the facades; leave out --width, or the footprint.")
    if values["floor_height"] and (outline or values["width"] or values["height"]):
        raise BimVerifyError("--floor-height sets the scale where no length is known; leave it out, or the length.")
    inputs = [*images, *([outline] if outline and outline.lower().endswith("json") else [])]
    outputs = [values[key] for key in ("out", "json") if values[key]]
    check_outputs(inputs, outputs)
    if values["report"]:
        check_report(values["report"], (PAGE,), inputs, outputs)
    footprint, notes = read_footprint(outline) if outline else (None, [])
    if footprint is None and len(images) > 1:
        raise BimVerifyError("Several facades need the outline they stand on; give --footprint, a corner list or GeoJSON.")
    widths: list[float | None] = []
    if footprint is not None:
        if len(images) > len(footprint):
            raise BimVerifyError(f"The footprint has {len(footprint)} edges, fewer than the {len(images)} images.")
        sides = np.linalg.norm(np.roll(footprint, -1, axis=0) - footprint, axis=1)
        widths = [float(v) for v in sides[: len(images)]]
    options = FacadeOptions(
        corners=tuple(parse_corners(text) for text in values["corners"] or ()),
        width=values["width"],
        height=values["height"],
        floor_height=values["floor_height"],
    )
    found = facade(images, options, progress.part(0.0, 0.9), widths)
    made = mockup(found, footprint)
    lines = [summary(made)]
    for one in found:
        lines.append(
            f"{one.image}: {one.scale.width:.2f} x {one.scale.height:.2f} m (scale from {one.scale.source.lower()}, one sigma "
            f"{100 * one.scale.relative_sigma:.1f} %), elements {one.arrangement_x} along x, {one.arrangement_z} along z."
        )
        lines += [f"Note: {warning}" for warning in one.warnings]
    lines += [f"Note: {note}" for note in notes]
    lines.append(f"Model: {values['out']}")

    def write() -> None:
        write_mockup(values["out"], made)
        if values["report"]:
            write_facade_report(values["report"], made)

    return Outcome(lines, {"facades": [facade_to_plain(f) for f in made.facades]}, made, write)


COMMAND = Command(
    "facade",
    "make a mock-up model (IFC4) of walls, windows and doors from photos of facades",
    (
        Argument("IMAGE", "photos, one a facade; with --footprint in the order of its edges", many=True, required=True),
        Argument("--out", "IFC file to write", required=True),
        Argument(
            "--corners", "X,Y,X,Y,X,Y,X,Y of each facade in pixels, one text an image; else found by its lines", many=True
        ),
        Argument("--width", "width of the facade, metres", float),
        Argument("--height", "height of the facade, metres", float),
        Argument("--floor-height", "height from floor to floor, metres", float),
        Argument("--footprint", "outline of the building, X,Y X,Y X,Y counter-clockwise in metres, or a GeoJSON file"),
        Argument("--report", "folder for the report (one HTML page)"),
        Argument("--json", "write what was found to this file"),
        Argument("--quiet", "show no progress", flag=True),
    ),
    _facade,
)
