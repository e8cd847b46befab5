"""``bim-verify facade``: photos of facades to a mock-up model."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..progress import Progress
from .checks import check_outputs, check_report, checked_threads, larger_than_zero
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
    from ..facade.mockup import write_mockup
    from ..facade.report import facade_to_plain, summary, write_facade_report
    from ..jobs.facade import FacadeOptions, facade_mockup
    from ..report.page_frame import PAGE

    larger_than_zero(values, "width", "height", "floor_height", "memory_gb")
    images = values["image"]
    outline = values["footprint"] or ""
    inputs = [*images, *([outline] if outline.lower().endswith("json") else [])]
    outputs = [values[key] for key in ("out", "json") if values[key]]
    check_outputs(inputs, outputs)
    if values["report"]:
        check_report(values["report"], (PAGE,), inputs, outputs)
    options = FacadeOptions(
        corners=tuple(parse_corners(text) for text in values["corners"] or ()),
        width=values["width"],
        height=values["height"],
        floor_height=values["floor_height"],
        threads=checked_threads(values),
        memory_gb=values["memory_gb"],
    )
    made, notes = facade_mockup(images, options, outline, values["crs"] or "", progress.part(0.0, 0.9))
    lines = [summary(made)]
    for one in made.facades:
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

    place = None if made.place is None else asdict(made.place)
    return Outcome(lines, {"facades": [facade_to_plain(f) for f in made.facades], "map": place}, made, write)


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
        Argument("--crs", "name of the map that a footprint in map coordinates is of, as EPSG:25832"),
        Argument("--report", "folder for the report (one HTML page)"),
        Argument("--json", "write what was found to this file"),
        Argument("--quiet", "show no progress", flag=True),
        Argument("--threads", "processor threads to use (0: all)", int, 0),
        Argument("--memory-gb", "memory for a photo, gigabytes; one that takes more is refused", float, 3.0),
    ),
    _facade,
)
