"""The report of a classification: what lies on which element, by class and by station."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

import numpy as np

from ..report.plain_page import Section, millimetres, percent, write_page
from .results import Classification

MOST_ELEMENTS = 500


def write_classification_report(folder: str | Path, result: Classification) -> Path:
    """Write ``index.html`` into ``folder`` (made if missing) and return its path; BimVerifyError where that fails."""
    elements, number = result.model.elements, result.counts[:-1].sum(axis=1)
    total, rest = max(int(result.counts.sum()), 1), int(result.counts[-1].sum())
    classes: dict[str, list[int]] = defaultdict(list)
    for row, element in enumerate(elements):
        classes[element.ifc_class].append(row)
    by_class = [
        (name, str(len(rows)), str(int((number[rows] > 0).sum())), f"{int(number[rows].sum()):,}",
         percent(float(number[rows].sum()) / total))
        for name, rows in sorted(classes.items(), key=lambda c: -int(number[c[1]].sum()))
    ]  # fmt: skip
    by_class.append(("on no element", "", "", f"{rest:,}", percent(rest / total)))
    stations = [
        (s.name, f"{int(n):,}", f"{int(none):,}", percent(1.0 - none / n if n else None))
        for s, n, none in zip(result.stations, result.counts.sum(axis=0), result.counts[-1], strict=True)
    ]
    order = np.argsort(-number, kind="stable")[:MOST_ELEMENTS]
    rows = [
        (elements[k].name or elements[k].global_id, elements[k].ifc_class, elements[k].storey, f"{int(number[k]):,}",
         _known(result.mean[k]), _known(result.spread[k]), _note(result, elements[k].global_id))
        for k in order.tolist()
    ]  # fmt: skip
    shown = f" The {MOST_ELEMENTS} with most returns; --json has all." if len(elements) > MOST_ELEMENTS else ""
    sections = [
        Section("By class", columns=("Class", "Elements", "With returns", "Returns", "Share"), rows=by_class,
                numeric=frozenset({1, 2, 3, 4})),
        Section("By station", "What lies on no element was kept: things that are not in the model, or that stand elsewhere.",
                columns=("Station", "Returns", "On no element", "On elements"), rows=stations, numeric=frozenset({1, 2, 3})),
        Section("By element", "Distance: of its returns from its surface along the outward normal." + shown,
                columns=("Element", "Class", "Storey", "Returns", "Distance mm, mean", "Distance mm, sigma", "Note"),
                rows=rows, numeric=frozenset({3, 4, 5})),
    ]  # fmt: skip
    meta = [
        ("Model", Path(result.model.path).name), ("Scans", ", ".join(Path(p).name for p in result.source.paths)),
        ("Reach", f"{1000 * result.reach:.0f} mm along the normal"),
        ("Registration", f"sigma {1000 * result.registration_sigma:.1f} mm"),
    ]
    return write_page(folder, "Classification", "Scans split by the model's elements", result.summary(), meta, sections)


def _known(value: float) -> str:
    return millimetres(value if np.isfinite(value) else None)


def _note(result: Classification, global_id: str) -> str:
    if global_id in result.absent:
        return "absent, not looked for"
    if global_id in result.moved:
        return f"looked for {1000 * float(np.linalg.norm(result.moved[global_id])):.0f} mm from its plan"
    return ""
