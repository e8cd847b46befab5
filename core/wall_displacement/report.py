"""The report of a wall's displacement: its elevation in colours, a profile of every column, the table of joints."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from ..report.palette import deviation_color, to_bytes
from ..report.plain_page import Section, millimetres, write_page
from .result import Column, DisplacementResult, JointDisplacement
from .tables import column_moved, summary_lines

Array = NDArray[np.float64]
WIDTH = 760
MOST_CELLS = 4000
"""Of the elevation, so that the page stays small."""
MOST_PROFILES = 24
LABEL_WIDTH = 44
"""Of a column in the drawing, so that the numbers at its joints can be read."""
SMALLEST_LIMIT_M = 0.005
PLOT, LEFT, TOP, BOTTOM = 300, 52, 14, 40
FACE, JOINT = "#3a7ca5", "#b5651d"


def write_displacement_report(folder: str | Path, result: DisplacementResult) -> Path:
    """Write ``index.html`` into ``folder`` (made if missing) and return its path; BimVerifyError where that fails."""
    lines = summary_lines(result)
    limit = color_limit(result)
    sections = [Section(
        "Elevation",
        f"Movement out of the wall (orange) and into it (blue) between the joints; the colours end at "
        f"{1000 * limit:.0f} mm. Pale cells are smaller than their level of detection. "
        "The numbers at the joints are their vertical movement in mm, upwards positive.", drawing=_elevation(result, limit),
    )]  # fmt: skip
    chosen = sorted(result.columns, key=lambda c: -_reach(c))[:MOST_PROFILES]
    for column in sorted(chosen, key=lambda c: c.number):
        sections.append(Section(
            f"Column {column.number}", _caption(column), drawing=_profile(column),
            columns=("State", "Height m", "Vertical mm", "Sigma mm", "Lateral mm", "Sigma mm", "Opening mm", "Sigma mm",
                     "Significant"),
            rows=[
                (j.state.capitalize(), f"{j.height:.3f}", millimetres(j.vertical), millimetres(j.vertical_sigma, 2),
                 millimetres(j.lateral), millimetres(j.lateral_sigma, 2), millimetres(j.opening),
                 millimetres(j.opening_sigma, 2), _directions(j))
                for j in column.joints
            ],
            numeric=frozenset(range(1, 8)),
        ))
    if len(result.columns) > MOST_PROFILES:
        lines.append(f"The {MOST_PROFILES} columns that moved most are shown; the CSV file has all.")
    meta = [
        ("Base epoch", _epoch(result.base_paths, result.base_date, result.spacing[0])),
        ("Later epoch", _epoch(result.later_paths, result.later_date, result.spacing[1])),
        ("Wall", f"{result.area:.0f} m²"),
        ("Registration", f"sigma {1000 * result.registration_sigma:g} mm, counted in every test"),
        ("Notes", " ".join(lines[1:])),
    ]
    return write_page(folder, "Wall displacement", "Two epochs compared", lines[0], meta, sections)


def color_limit(result: DisplacementResult) -> float:
    """Metres at which the colours end: 98 % of the field's distances are smaller."""
    if not len(result.field.distance):
        return SMALLEST_LIMIT_M
    return max(float(np.quantile(np.abs(result.field.distance), 0.98)), SMALLEST_LIMIT_M)


def _epoch(paths: tuple[str, ...], date: str, spacing: float) -> str:
    names = ", ".join(Path(p).name for p in paths)
    return f"{names}{f' ({date})' if date else ''}, points {1000 * spacing:.0f} mm apart"


def _reach(column: Column) -> float:
    moves = [abs(v) for j in column.joints for v in (j.vertical, j.lateral) if v is not None]
    return max(moves, default=0.0)


def _caption(column: Column) -> str:
    def chance(value: float | None) -> str:
        return "not determined" if value is None else "below 0.001" if value < 0.001 else f"{value:.3f}"

    verdict = "Moved" if column_moved(column) else "No significant movement"
    bow = "" if column.bow is None else f" It bends by {1000 * column.bow:+z.1f} mm against the straight line between its ends."
    return (
        f"{verdict}: if it stood still, measurement and registration would show as much with a probability of "
        f"{chance(column.vertical_probability)} vertically and {chance(column.lateral_probability)} laterally.{bow}"
    )


def _directions(joint: JointDisplacement) -> str:
    both = (("vertical", joint.vertical_significant), ("lateral", joint.lateral_significant))
    return ", ".join(word for word, moved in both if moved) or "–"


def _elevation(result: DisplacementResult, limit: float) -> Markup:
    field = result.field
    if not len(field.distance):
        return Markup("")
    x, z = along_wall(result, field.points), field.points[:, 2]
    cell = max(0.1, float(np.sqrt(np.ptp(x) * np.ptp(z) / MOST_CELLS)), float(np.ptp(x)) / 400)
    rows = int(np.ptp(z) / cell) + 1
    key = ((x - x.min()) / cell).astype(np.int64) * rows + ((z - z.min()) / cell).astype(np.int64)
    keys, inverse = np.unique(key, return_inverse=True)
    count = np.bincount(inverse.ravel())
    mean = np.bincount(inverse.ravel(), weights=field.distance) / count
    significant = np.bincount(inverse.ravel(), weights=field.significant) / count > 0.5
    scale = WIDTH / max(float(np.ptp(x)) + cell, 1e-6)
    height = rows * cell * scale
    colors = to_bytes(deviation_color(mean, limit))
    parts = []
    for k, color, value, sure in zip(keys, colors, mean, significant, strict=True):
        left, low = (k // rows) * cell * scale, (k % rows + 1) * cell * scale
        parts.append(
            f'<rect x="{left:.1f}" y="{height - low:.1f}" width="{cell * scale:.1f}" height="{cell * scale:.1f}" '
            f'fill="#{color[0]:02x}{color[1]:02x}{color[2]:02x}" opacity="{1 if sure else 0.35}">'
            f"<title>{1000 * value:+z.1f} mm</title></rect>"
        )
    for column in result.columns:
        if (column.high - column.low) * scale < LABEL_WIDTH:
            continue
        for joint in column.paired:
            if joint.vertical is not None:
                at = float(along_wall(result, np.array([joint.position]))[0])
                parts.append(_text((at - x.min()) * scale, height - (joint.height - z.min()) * scale + 4,
                                   f"{1000 * joint.vertical:+z.1f}", "middle strong"))  # fmt: skip
    return Markup(f'<svg viewBox="0 0 {WIDTH} {height:.0f}" role="img" aria-label="Elevation">{"".join(parts)}</svg>')


def along_wall(result: DisplacementResult, points: Array) -> Array:
    """(N,) metres along the wall, to the right as seen from in front of it, of points (N, 3) in the scan frame."""
    return np.asarray(points @ np.cross([0.0, 0.0, 1.0], result.outward))


def _profile(column: Column) -> Markup:
    """Two plots over height: movement out of the wall (face as a line, joints with 95 % bars), and upwards (joints)."""
    z = column.profile_height
    change = column.profile_later - column.profile_base
    low, high = (float(z.min()), float(z.max())) if len(z) else (0.0, 1.0)
    parts = []
    for side, direction in enumerate(("lateral", "vertical")):
        line = change if direction == "lateral" else np.zeros(0)
        joints = [(j.height, getattr(j, direction), 1.96 * getattr(j, f"{direction}_sigma")) for j in column.paired
                  if getattr(j, direction) is not None]
        values = [*line[np.isfinite(line)], *(v - s for _, v, s in joints), *(v + s for _, v, s in joints), 0.0]
        start, end = 1000 * min(values), 1000 * max(values)
        room = max(0.08 * (end - start), 0.5)
        parts += _plot(side * (WIDTH / 2), direction, (start - room, end + room), (low, high), z, 1000 * line, joints)
    return Markup(
        f'<svg class="chart" viewBox="0 0 {WIDTH} {PLOT}" role="img" aria-label="Displacement over height">'
        f"{''.join(parts)}</svg>"
    )


def _plot(
    left: float, name: str, span: tuple[float, float], heights: tuple[float, float], z: Array, line: Array,
    joints: list[tuple[float, float, float]],
) -> list[str]:
    def x(mm: float) -> float:
        return left + LEFT + (mm - span[0]) / (span[1] - span[0]) * (WIDTH / 2 - LEFT - 24)

    def y(height: float) -> float:
        return TOP + (heights[1] - height) / max(heights[1] - heights[0], 1e-6) * (PLOT - TOP - BOTTOM)

    parts = []
    for mm in _ticks(*span):
        kind = "zero" if mm == 0 else "grid"
        parts.append(f'<line class="{kind}" x1="{x(mm):.1f}" x2="{x(mm):.1f}" y1="{TOP}" y2="{PLOT - BOTTOM}"/>')
        parts.append(_text(x(mm), PLOT - BOTTOM + 16, f"{mm:g}"))
    for height in _ticks(*heights):
        parts.append(_text(left + LEFT - 8, y(height) + 4, f"{height:g} m", "end"))
    word = "out of the wall" if name == "lateral" else "upwards"
    parts.append(_text(left + WIDTH / 4 + 14, PLOT - 6, f"{name}, mm ({word} positive)"))
    if len(line):
        good = np.isfinite(line)
        path = " ".join(f"{x(float(a)):.1f},{y(float(b)):.1f}" for a, b in zip(line[good], z[good], strict=True))
        parts.append(f'<polyline points="{path}" fill="none" stroke="{FACE}" stroke-width="1.5"/>')
    for height, value, bar in joints:
        at = y(height)
        parts.append(
            f'<line x1="{x(1000 * (value - bar)):.1f}" x2="{x(1000 * (value + bar)):.1f}" y1="{at:.1f}" y2="{at:.1f}" '
            f'stroke="{JOINT}" stroke-width="2"/><circle cx="{x(1000 * value):.1f}" cy="{at:.1f}" r="4" fill="{JOINT}">'
            f"<title>{1000 * value:+z.2f} mm ± {1000 * bar:.2f} mm at {height:.2f} m</title></circle>"
        )
    return parts


def _text(x: float, y: float, text: str, anchor: str = "middle") -> str:
    return f'<text class="axis {anchor}" x="{x:.1f}" y="{y:.1f}">{text}</text>'


def _ticks(low: float, high: float) -> list[float]:
    """A handful of round numbers between two."""
    rough = max(high - low, 1e-6) / 5
    power = 10.0 ** np.floor(np.log10(rough))
    step = next(f * power for f in (1, 2, 5, 10) if f * power >= rough - 1e-12)
    first = int(np.ceil(low / step))
    return [float(np.round(k * step, 9)) for k in range(first, int(np.floor(high / step)) + 1)]
