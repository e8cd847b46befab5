"""The whole quality result but the samples as plain JSON, and the patches as a table."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from ..files import whole_file
from ..report.csv_out import csv_bytes, guard
from ..report.json_out import to_plain
from ..scans.write_ply import write_ply
from .missing import CAUSES, NO_STATION, OCCLUDED, SEEN, TURNED_AWAY
from .results import Measured, PatchQuality, QualityResult

FORMAT, FORMAT_VERSION = "bim_verify.quality", 1
CAUSE_COLORS: dict[str, tuple[int, int, int]] = {
    "seen": (11, 138, 102),
    "seen through": (180, 18, 60),
    "absorbed": (108, 182, 240),
    "too grazing": (242, 169, 0),
    "out of range": (125, 80, 200),
    "outside the field of view": (154, 162, 175),
    "occluded": (60, 66, 80),
}
"""sRGB 0..255 of what a query position is."""


def quality_to_json(result: QualityResult) -> dict[str, Any]:
    """Plain lists, dicts, numbers and texts; None where nothing is known. Metres, radians, model frame."""
    model = result.model
    plain: dict[str, Any] = to_plain({
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "method": result.method,
        "summary": result.summary(),
        "model": {"path": model.path, "sha256": model.content_hash, "schema": model.schema, "project": model.project_name},
        "scans": {"paths": result.scan_paths, "date": result.scan_date},
        "options": result.options,
        "factors": result.factors,
        "limits": result.survey.limits,
        "whole": result.whole,
        "elements": result.elements,
        "stations": result.stations,
        "clutter": result.clutter,
        "timings": result.timings,
        "warnings": result.warnings,
    })
    return plain


def write_patches(path: str | Path, result: QualityResult) -> None:
    """One line per patch, UTF-8 with a byte order mark; lengths in millimetres, angles in degrees, positions in metres."""
    header = (
        "GlobalId", "Class", "Name", "X_m", "Y_m", "Z_m", "NormalX", "NormalY", "NormalZ", "Area_m2", "Coverage",
        "Spacing_mm", "SpacingP95_mm", "Consistency", "Noise_mm", "IncidenceP95_deg", "Range_m", "Registration_mm",
        *(cause.title().replace(" ", "") for cause in CAUSES.values()),
    )

    def row(patch: PatchQuality) -> list[str]:
        element = result.model.elements[patch.element]
        return [
            guard(element.global_id), guard(element.ifc_class), guard(element.name),
            *(f"{x:.3f}" for x in (*patch.center, *patch.normal)), *_numbers(patch.measured),
        ]

    with whole_file(path) as temporary:
        temporary.write_bytes(csv_bytes(header, map(row, result.patches)))


def _numbers(m: Measured) -> list[str]:
    def text(value: float | None, scale: float = 1.0, digits: int = 2) -> str:
        return "" if value is None or not math.isfinite(value) else f"{scale * value:.{digits}f}"

    return [
        text(m.area, 1, 4), text(m.coverage, 1, 4), text(m.spacing, 1000), text(m.spacing_p95, 1000), text(m.consistency),
        text(m.noise, 1000, 3), text(m.incidence_p95, 180 / math.pi, 1), text(m.range_median), text(m.registration, 1000, 3),
        *(text(m.missing[cause], 1, 4) for cause in CAUSES.values()),
    ]


def sample_causes(result: QualityResult) -> list[str]:
    """Per exposed sample, in order: ``seen`` or the cause."""
    state = result.survey.best.state[result.samples.exposed]
    state = np.where((state == TURNED_AWAY) | (state == NO_STATION), OCCLUDED, state)
    names = {SEEN: "seen", **CAUSES}
    return [names[int(s)] for s in state]


def write_quality_samples(path: str | Path, result: QualityResult) -> None:
    """PLY of all exposed query positions, model frame: x y z, normal, colour by cause, cause, spacing, element."""
    rows = np.flatnonzero(result.samples.exposed)
    causes = sample_causes(result)
    code = {name: k for k, name in enumerate(CAUSE_COLORS)}
    number = np.array([code[c] for c in causes], np.uint8)
    position = result.samples.position[rows] + result.model.origin
    color = np.array(list(CAUSE_COLORS.values()), np.uint8)[number]
    columns: dict[str, Any] = {
        **dict(zip("xyz", position.T, strict=True)),
        **dict(zip(("nx", "ny", "nz"), result.samples.normal[rows].T, strict=True)),
        **dict(zip(("red", "green", "blue"), color.T, strict=True)),
        "cause": number,
        "spacing": result.survey.spacing[rows].astype(np.float32),
        "element": result.samples.element[rows].astype(np.int32),
    }
    legend = ", ".join(f"{number} {name}" for number, name in enumerate(CAUSE_COLORS))
    write_ply(path, columns, ["metres, model frame", f"cause: {legend}"])
