"""What was found of a wall in words, as a table of joints (CSV) and as JSON. Millimetres where a name says so, else metres."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Any

import numpy as np

from ..files import whole_file
from .result import Column, DisplacementResult, JointDisplacement

COLUMNS = (
    "Column", "State", "X_m", "Y_m", "Z_m", "Vertical_mm", "VerticalSigma_mm", "VerticalSignificant", "Lateral_mm",
    "LateralSigma_mm", "LateralSignificant", "Opening_mm", "OpeningSigma_mm", "CompletenessBase", "CompletenessLater",
)
CHANCE = 0.05
"""A column has moved when its joints' displacements are less probable than this without movement."""


def joint_row(joint: JointDisplacement) -> list[Any]:
    """One joint in the order of ``COLUMNS``; None where a number was not determined."""
    return [
        joint.column, joint.state, *(round(float(v), 4) + 0.0 for v in joint.position),
        _mm(joint.vertical), _mm(joint.vertical_sigma), joint.vertical_significant,
        _mm(joint.lateral), _mm(joint.lateral_sigma), joint.lateral_significant, _mm(joint.opening),
        _mm(joint.opening_sigma), round(float(joint.completeness_base), 3), round(float(joint.completeness_later), 3),
    ]


def write_joints(path: str | Path, result: DisplacementResult) -> None:
    """Write the CSV file, one line a joint; whole or not at all."""
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(COLUMNS)
    writer.writerows(joint_row(joint) for joint in result.joints)
    with whole_file(path) as temporary:
        temporary.write_text(text.getvalue(), encoding="utf-8", newline="")


def column_moved(column: Column) -> bool:
    """The joints' displacements together are significant at 95 % in at least one direction."""
    return any(p is not None and p < CHANCE for p in (column.vertical_probability, column.lateral_probability))


def largest(joints: tuple[JointDisplacement, ...], direction: str) -> JointDisplacement | None:
    """The joint that moved most in ``vertical`` or ``lateral`` direction; None where nothing was determined."""
    known = [j for j in joints if getattr(j, direction) is not None]
    return max(known, key=lambda j: abs(getattr(j, direction)), default=None)


def summary_lines(result: DisplacementResult) -> list[str]:
    """The result in a few lines for a person; the first is the headline."""
    paired = tuple(j for j in result.joints if j.state == "PAIRED")
    moved = sum(bool(j.vertical_significant or j.lateral_significant) for j in paired)
    columns = sum(column_moved(c) for c in result.columns)
    lines = [
        f"{len(result.columns)} columns, {len(paired)} joints in both epochs: {moved} joints and {columns} columns moved "
        "significantly."
    ]
    for direction, word in (("vertical", "up"), ("lateral", "out of the wall")):
        top = largest(paired, direction)
        if top is not None:
            value, sigma = 1000 * getattr(top, direction), 1000 * getattr(top, f"{direction}_sigma")
            lines.append(
                f"Largest {direction} displacement {value:+z.1f} mm ({word} positive), sigma {sigma:.1f} mm, in column "
                f"{top.column} at height {top.height:.2f} m."
            )
    if len(result.field.distance):
        share = float(result.field.significant.mean())
        lines.append(
            f"Between the joints {share:.0%} of {len(result.field.distance)} places moved by more than their level of "
            f"detection (median {1000 * float(np.median(result.field.detection)):.1f} mm)."
        )
    new, missing = (sum(j.state == s for j in result.joints) for s in ("NEW", "MISSING"))
    if new or missing:
        lines.append(f"{new} joints are only in the later epoch, {missing} only in the base epoch.")
    return lines + [f"Note: {warning}" for warning in result.warnings]


def displacement_to_json(result: DisplacementResult) -> dict[str, Any]:
    """Everything for ``--json``; the keys of a joint are the columns of the CSV file."""
    field = result.field
    return {
        "summary": summary_lines(result),
        "base": {"paths": list(result.base_paths), "date": result.base_date, "spacing_m": _number(result.spacing[0])},
        "later": {"paths": list(result.later_paths), "date": result.later_date, "spacing_m": _number(result.spacing[1])},
        "outward": list(result.outward),
        "wall_area_m2": _number(result.area),
        "registration_sigma_m": result.registration_sigma,
        "columns": [_column(c) for c in result.columns],
        "joints": [dict(zip(COLUMNS, joint_row(j), strict=True)) for j in result.joints],
        "field": {
            "column": field.column.tolist(),
            "position_m": np.round(field.points, 4).tolist(),
            "distance_mm": np.round(1000 * field.distance, 3).tolist(),
            "detection_mm": np.round(1000 * field.detection, 3).tolist(),
            "significant": field.significant.tolist(),
        },
        "warnings": list(result.warnings),
        "seconds": result.timings,
    }


def _column(column: Column) -> dict[str, Any]:
    return {
        "number": column.number,
        "low_m": _number(column.low),
        "high_m": _number(column.high),
        "moved": column_moved(column),
        "vertical_probability": column.vertical_probability,
        "lateral_probability": column.lateral_probability,
        "bow_mm": _mm(column.bow),
        "profile": {
            "height_m": np.round(column.profile_height, 4).tolist(),
            "base_mm": [_mm(v) for v in column.profile_base],
            "later_mm": [_mm(v) for v in column.profile_later],
        },
    }


def _mm(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else round(1000 * float(value), 3) + 0.0


def _number(value: float) -> float:
    return round(float(value), 6)
