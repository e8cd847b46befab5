"""The report of a comparison of two models: classes, pairs with their differences, and what has no partner."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..report.plain_page import Section, millimetres, write_page
from .compare import AREA_LIMIT_M2, MIDDLE_LIMIT_M, ClassComparison, Comparison, comparison_lines
from .shapes import Shape

MEANING = (
    f"It is the mean of three: the distance of the middles in plan over {MIDDLE_LIMIT_M:g} m, difference of length times "
    f"difference of width over {AREA_LIMIT_M2:g} m2, both at most 1, and the sine of the angle. The limits are fixed, so that "
    "runs compare. What has no partner counts 1. It does not see heights, nor a difference of length or of width alone: those "
    "are in the columns."
)
COLUMNS = (
    "Found", "In the reference", "Number", "Middle mm", "Axis mm", "Angle °", "Length mm", "Width mm", "Height mm", "Edge mm",
)


def write_comparison_report(folder: str | Path, result: Comparison, found: str, reference: str) -> Path:
    """Write ``index.html`` into ``folder`` (made if missing) and return its path; BimVerifyError where that fails."""
    *lines, headline = comparison_lines(result)
    meta = [("Model", Path(found).name), ("Reference", Path(reference).name), ("Notes", " ".join(lines))]
    return write_page(folder, "Comparison", "Two building models", headline, meta, comparison_sections(result))


def comparison_sections(result: Comparison) -> list[Section]:
    """One table of the classes, then for each class its pairs and what has no partner."""
    sections = [Section(
        "Against the reference", f"Thomson and Boehm's number is {result.quality:.3f}. {MEANING}",
        columns=(
            "Class", "Reference", "Found", "Matched", "Precision", "Recall", "F1", "Middle max mm", "Axis max mm",
            "Angle max °", "Length max mm", "Width max mm", "Height max mm", "Edge max mm, seen", "Edge max mm, all",
        ),
        rows=[
            (kind, str(c.reference), str(c.found), str(len(c.matches)), *_shares(c), *_largest(c))
            for kind, c in result.classes.items()
        ],
        numeric=frozenset(range(1, 15)),
    )]  # fmt: skip
    return sections + [_pairs(c) for c in result.classes.values()]


def _shares(c: ClassComparison) -> list[str]:
    """Precision, recall and F1; nothing of a class that the reference does not have."""
    return [f"{v:.3f}" for v in (c.precision, c.recall, c.f1)] if c.reference else [""] * 3


def _largest(c: ClassComparison) -> list[str]:
    """Differences of pairs; nothing where there is none."""
    if not c.matches:
        return [""] * 8
    angle = f"{np.degrees(c.largest('angle')):.2f}"
    before, after = ("middle", "axis"), ("length", "width", "height", "seen_edge", "edge")
    return [*(millimetres(c.largest(w)) for w in before), angle, *(millimetres(c.largest(w)) for w in after)]


def _pairs(c: ClassComparison) -> Section:
    rows = [
        (_name(m.found), _name(m.reference), f"{m.quality:.3f}", millimetres(m.middle), millimetres(m.axis),
         f"{np.degrees(m.angle):.2f}", *(millimetres(v) for v in (m.length, m.width, m.height, m.edge)))
        for m in sorted(c.matches, key=lambda m: -m.quality)
    ]  # fmt: skip
    rows += [("–", _name(s), "1", *[""] * 7) for s in c.missed]
    rows += [(_name(s), "–", "1", *[""] * 7) for s in c.extra]
    return Section(
        f"Pairs: {c.kind}", "Lengths, widths and heights: model minus reference. Edge: the largest difference of an edge.",
        columns=COLUMNS, rows=rows, numeric=frozenset(range(2, 10)),
    )


def _name(shape: Shape) -> str:
    name = shape.name or shape.global_id
    return f"{name}, {shape.storey}" if shape.storey else name
