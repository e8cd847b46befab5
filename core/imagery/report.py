"""The report of a co-registration."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from ..report.plain_page import Section, millimetres, percent, write_page
from .coregistration import MEANINGS, CoregistrationResult, is_placed, sigmas, state_of
from .line_pose import pose_difference
from .overlay import overlay_pair

MOST_OVERLAYS = 12
COLUMNS = (
    "Image", "State", "Explained", "Next best", "Chance", "Used", "Lines", "Moved cm", "Turned deg", "Sigma mm", "Sigma deg",
    "Sigma 0",
)
COLUMN_NOTE = (
    "Explained: share of the visible edges' length that has a line. Next best: what the best different pose explains, as a "
    "share of that; above 93 % is ambiguous. Chance: the same of poses drawn by chance; above 80 % is ambiguous. An image that "
    "is not placed has no further figures."
)


def write_coregistration_report(folder: str | Path, result: CoregistrationResult) -> Path:
    """Write ``index.html`` into ``folder`` (made if missing) and return its path; BimVerifyError where that fails."""
    rows = [_row(result, index) for index in range(len(result.images))]
    states = [state_of(found) for found in result.registrations]
    sections = [Section(
        "Images", " ".join([*(f"{name}: {text}." for name, text in MEANINGS.items() if name in states), COLUMN_NOTE]),
        columns=COLUMNS, rows=rows, numeric=frozenset(range(2, len(COLUMNS))),
    )]
    notes = [
        (Path(path).name, text)
        for path, found in zip(result.images, result.registrations, strict=True)
        for text in ([found.note] if found.note else []) + [f"Not determined: {w.text}" for w in found.weak]
    ]
    if notes:
        sections.append(Section("What is not sure", columns=("Image", ""), rows=notes))
    for path, found in list(zip(result.images, result.registrations, strict=True))[:MOST_OVERLAYS]:
        sections.append(Section(
            Path(path).name,
            "Red: the model's edges from the coarse pose. White: from the refined pose. Green: lines that fixed it. Yellow: "
            "lines taken out by their test.",
            drawing=overlay_pair(path, found),
        ))
    meta = [
        ("Model", Path(result.model.path).name), ("Level of the edges", f"LOA{result.options.loa}"),
        ("Lines by", result.options.detector.upper()), ("Method", result.method),
    ]
    return write_page(
        folder, f"Photos on {result.model.project_name or Path(result.model.path).name}", "Image to BIM",
        f"{result.placed} of {len(states)} images are placed on the model.", meta, sections,
    )


def _row(result: CoregistrationResult, index: int) -> tuple[str, ...]:
    found = result.registrations[index]
    name, state = Path(result.images[index]).name, state_of(found)
    if found.estimate is None or found.covariance is None:
        return (name, state, *("–" for _ in COLUMNS[2:]))
    used = str(sum(m.kept for m in found.matches))
    judged = (percent(found.explained), percent(found.runner_up), percent(found.chance))
    if not is_placed(found):
        return (name, state, *judged, used, *("–" for _ in COLUMNS[6:]))
    away = pose_difference(found.camera, found.coarse.camera)
    rotation, position = sigmas(found.covariance)
    return (
        name, state, *judged, used, str(len(found.matches)), f"{100 * np.linalg.norm(away[3:]):.1f}",
        f"{math.degrees(float(np.linalg.norm(away[:3]))):.2f}", millimetres(position), f"{math.degrees(rotation):.3f}",
        f"{math.sqrt(found.estimate.variance_factor):.2f}",
    )
