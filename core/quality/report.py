"""The report of a quality survey."""

from __future__ import annotations

import math
from pathlib import Path

from ..report.floor_plan import Area, Mark, draw_floor_plan
from ..report.plain_page import Section, millimetres, percent, write_page
from ..sensing.loa import label
from .levels import ACTIONS
from .missing import CAUSES
from .results import ElementQuality, QualityResult

MOST_CLUTTER = 40


def write_quality_report(folder: str | Path, result: QualityResult) -> Path:
    """Write ``index.html`` into ``folder`` (made if missing) and return its path; BimVerifyError where that fails."""
    model = result.model
    sections = [
        Section(
            "Nine factors", columns=("Factor", "What the returns say"),
            rows=[(f.name, f.text) for f in result.factors],
        ),
        Section(
            "Missing surface",
            "Free is what no other element touches or encloses. Each free place that no station sees is put down to the view "
            "that came closest to seeing it.",
            columns=("Cause", "Share of the free surface"),
            rows=[
                *((name, f"{100 * result.whole.missing[name]:.1f} %") for name in CAUSES.values()),
                ("… of that, on sides that face no station", f"{100 * result.whole.turned_away:.1f} %"),
            ],
            numeric=frozenset({1}),
        ),
        Section("Stations and what stands before them", drawing=draw_floor_plan(
            model,
            [Mark(str(k + 1), s.name, s.position) for k, s in enumerate(result.stations)],
            [Area(f"{c.name}: hides {c.hidden_area:.1f} m2", c.low, c.high) for c in result.clutter[:MOST_CLUTTER]],
        )),
        Section(
            "Elements",
            "What is needed most comes first. Spacing, noise, noise at edges and expected error of an as-built model in "
            f"millimetres; incidence is its 95th percentile. {', '.join(f'{k}: {v}' for k, v in ACTIONS.items())}.",
            columns=(
                "Element", "Coverage", "Spacing", "Noise", "At edges", "Incidence", "Error", "GSA", "LOA", "Action", "Why",
            ),
            rows=[_element(e) for e in sorted(result.elements, key=_urgency)], numeric=frozenset(range(1, 9)),
        ),
        Section(
            "Stations", columns=("", "Name", "Returns", "Step", "Longest range m", "Best view m2", "Against others mm"),
            rows=[
                (str(k + 1), s.name, f"{s.returns:,}", f"{math.degrees(s.spacing_rad):.3f}°" if s.returns else "–",
                 f"{s.range_max:.1f}", f"{s.best_view_area:.1f}", millimetres(s.registration))
                for k, s in enumerate(result.stations)
            ],
            numeric=frozenset(range(2, 7)),
        ),
    ]
    if result.clutter:
        sections.append(Section(
            "Things that are not in the model", "The boxes hold the side that returns came from.",
            columns=("Name", "From", "To", "Hides m2", "Stations"),
            rows=[
                (c.name, ", ".join(f"{x:.2f}" for x in c.low), ", ".join(f"{x:.2f}" for x in c.high),
                 f"{c.hidden_area:.1f}", ", ".join(c.stations))
                for c in result.clutter[:MOST_CLUTTER]
            ],
            numeric=frozenset({3}),
        ))
    if result.warnings:
        sections.append(Section("Warnings", columns=("",), rows=[(w,) for w in result.warnings]))
    meta = [
        ("Model", Path(model.path).name), ("Scans", ", ".join(dict.fromkeys(Path(p).name for p in result.scan_paths))),
        ("Scanned", result.scan_date or "date not in the files"), ("Method", result.method),
    ]
    title = f"Scan quality of {model.project_name or Path(model.path).name}"
    return write_page(folder, title, "Scan quality report", result.headline, meta, sections)


def _urgency(element: ElementQuality) -> tuple[bool, bool, float]:
    return (element.measured.area <= 0, not element.actions, element.measured.coverage)


def _element(e: ElementQuality) -> tuple[str, ...]:
    m = e.measured
    steep = "–" if m.incidence_p95 is None else f"{math.degrees(m.incidence_p95):.0f}°"
    return (
        f"{e.ifc_class} {e.name}".strip(), percent(m.coverage) if m.area > 0 else "–", millimetres(m.spacing),
        millimetres(m.noise, 2), millimetres(e.edge_noise, 2), steep, millimetres(e.predicted_error),
        str(e.gsa_level) if e.gsa_level else "–", label(e.supported_loa), ", ".join(e.actions), e.reason,
    )
