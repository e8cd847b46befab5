"""The report of a reconstruction: a plan of each storey, the walls with what is known of them, the comparison."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
from markupsafe import Markup, escape
from numpy.typing import NDArray
from shapely import Polygon

from ..dimensions.table import COLUMNS, NUMERIC, shown
from ..report.plain_page import Section, millimetres, percent, write_page
from .building import ASSUMED, BuiltStorey, BuiltWall, Reconstruction
from .compare import Comparison
from .compare_report import comparison_sections
from .dimensions import storey_rows
from .summary import summary_lines

WIDTH = 760
COLORS = {"door": "#b5651d", "window": "#3a7ca5", "opening": "#888888", "recess": "#c8a2c8"}


def write_reconstruction_report(folder: str | Path, result: Reconstruction, comparison: Comparison | None) -> Path:
    """Write ``index.html`` into ``folder`` (made if missing) and return its path; BimVerifyError where that fails."""
    sections = []
    for storey in result.storeys:
        sections.append(Section(f"{storey.name}: plan", _caption(storey), drawing=_plan(storey)))
        sections.append(Section(
            f"{storey.name}: walls", "Sigma is the standard deviation of the axis' place. The lean is over the wall's height.",
            columns=(
                "Wall", "Length m", "Thickness mm", "Thickness from", "Openings", "Seen", "Residual mm", "Sigma mm", "Lean mm",
            ),
            rows=[
                (f"Wall {k}", f"{w.length:.3f}", millimetres(w.thickness), w.fit.thickness_source.lower(), str(len(w.openings)),
                 percent(w.fit.quality), millimetres(w.fit.fit_sigma), millimetres(w.fit.position_sigma, 2),
                 f"{1000 * math.tan(w.lean) * (w.top - w.base):z.1f} ± {1960 * w.lean_sigma * (w.top - w.base):z.1f}")
                for k, w in enumerate(storey.walls, start=1)
            ],
            numeric=frozenset({1, 2, 4, 5, 6, 7, 8}),
        ))
        sections.append(Section(
            f"{storey.name}: rooms", columns=("Room", "Area m2", "Perimeter m", "Floor m", "Clear height m"),
            rows=[
                (f"Room {k}", f"{r.outline.area:.2f}", f"{r.outline.exterior.length:.2f}",
                 f"{r.floor + result.origin[2]:.3f}",
                 "not seen" if r.height_source == ASSUMED else f"{r.ceiling - r.floor:.3f}")
                for k, r in enumerate(storey.rooms, start=1)
            ],
            numeric=frozenset({1, 2, 3, 4}),
        ))  # fmt: skip
        sections.append(_dimensions(storey, result.origin))
    if comparison is not None:
        sections = comparison_sections(comparison) + sections
    lines = summary_lines(result)
    meta = [("Scans", ", ".join(Path(p).name for p in result.scan_paths)), ("Notes", " ".join(lines[1:]))]
    return write_page(folder, "Reconstruction", "Scan to building model", lines[0], meta, sections)


def _dimensions(storey: BuiltStorey, origin: NDArray[np.float64]) -> Section:
    return Section(
        f"{storey.name}: dimensions",
        "As built, with the half-width of the 95 % interval. Plumb, right angles and parallels are offsets over the height or "
        "the shorter wall, leans and slopes are over one metre; p is that of no deviation at all, the limit that of DIN 18202. "
        "Unevenness is the standard deviation of what a surface deviates smoothly from its plane.",
        columns=COLUMNS, rows=shown(storey_rows(storey, origin)), numeric=NUMERIC,
    )


def _caption(storey: BuiltStorey) -> str:
    assumed = sum(w.fit.thickness_source == ASSUMED for w in storey.walls)
    return (
        f"{len(storey.rooms)} rooms, {len(storey.walls)} walls; light grey: {assumed} walls whose thickness is "
        "assumed. Numbers on walls are those of the tables. Doors brown, windows blue, openings without a leaf, or whose foot "
        "is hidden, grey, recesses violet; openings in the floor dashed."
    )


def _plan(storey: BuiltStorey) -> Markup:
    shapes = [w.footprint for w in storey.walls] + [r.outline for r in storey.rooms]
    if not shapes:
        return Markup("")
    x0, y0 = (min(s.bounds[k] for s in shapes) for k in (0, 1))
    x1, y1 = (max(s.bounds[k] for s in shapes) for k in (2, 3))
    scale = WIDTH / max(x1 - x0, 1e-6)
    height = (y1 - y0) * scale

    def points(coordinates: list[tuple[float, ...]]) -> str:
        return " ".join(f"{(p[0] - x0) * scale + 5:.1f},{height - (p[1] - y0) * scale + 5:.1f}" for p in coordinates)

    def polygon(shape: Polygon, style: str, title: str) -> str:
        return f'<polygon points="{points(list(shape.exterior.coords))}" {style}><title>{escape(title)}</title></polygon>'

    def label(at: tuple[float, ...], text: str, kind: str) -> str:
        x, y = points([at]).split(",")
        return f'<text x="{x}" y="{y}" class="{kind}">{text}</text>'

    parts = [
        polygon(r.outline, 'fill="#eef3ea" stroke="none"', f"Room {k}: {r.outline.area:.2f} m2")
        for k, r in enumerate(storey.rooms, start=1)
    ]
    for k, w in enumerate(storey.walls, start=1):
        assumed = w.fit.thickness_source == ASSUMED
        fill = "#b9bdc2" if assumed else "#4a5058"
        style = f'fill="{fill}" stroke="#222" stroke-width="0.5"'
        parts.append(polygon(w.footprint, style, f"Wall {k}: {w.thickness * 1000:.0f} mm"))
        for o in w.openings:
            face, left = w.thickness / 2, _left(w.along)
            back = (face - o.recess if o.recess else -face) * left
            ends = [w.start + w.along * u for u in (o.u0, o.u1)]
            corners = [tuple(p) for p in (ends[0] + back, ends[1] + back, ends[1] + face * left, ends[0] + face * left)]
            name = "door or window, foot hidden" if o.foot_hidden else o.kind
            parts.append(polygon(Polygon(corners), f'fill="{COLORS[o.kind]}"', f"{name}: {o.width:.3f} x {o.height:.3f} m"))
    parts += [
        polygon(h.outline, 'fill="none" stroke="#222" stroke-dasharray="4 3"', f"Opening in the floor: {h.outline.area:.2f} m2")
        for h in storey.slab_holes
    ]
    parts += [polygon(c.footprint, 'fill="#7a3b3b"', f"Column {k}") for k, c in enumerate(storey.columns, start=1)]
    for k, r in enumerate(storey.rooms, start=1):
        at = r.outline.representative_point()
        parts.append(label((at.x, at.y), f"Room {k}", "label room"))
    for k, w in enumerate(storey.walls, start=1):
        parts.append(label(tuple(_solid_middle(w)), str(k), "label"))
    return Markup(
        f'<svg viewBox="0 0 {WIDTH + 10} {height + 10:.0f}" role="img" aria-label="Plan">{"".join(parts)}</svg>'
    )


def _solid_middle(wall: BuiltWall) -> NDArray[np.float64]:
    """(2,) of the longest piece of wall between its openings."""
    ends = sorted([0.0, wall.length, *(u for o in wall.openings for u in (o.u0, o.u1))])
    pieces = [
        (b - a, 0.5 * (a + b)) for a, b in pairwise(ends) if not any(o.u0 < 0.5 * (a + b) < o.u1 for o in wall.openings)
    ]
    return np.asarray(wall.start + wall.along * max(pieces, default=(0.0, wall.length / 2))[1])


def _left(along: NDArray[np.float64]) -> NDArray[np.float64]:
    a = np.asarray(along)
    return np.array([-a[1], a[0]])
