"""The report of a plan."""

from __future__ import annotations

from pathlib import Path

from ..quality.levels import ACTIONS
from ..report.floor_plan import Mark, draw_floor_plan
from ..report.plain_page import Section, millimetres, percent, write_page
from ..sensing.loa import label
from .results import PlanResult
from .sentences import named, plan_sentence


def write_plan_report(folder: str | Path, result: PlanResult) -> Path:
    """Write ``index.html`` into ``folder`` (made if missing) and return its path; BimVerifyError where that fails."""
    model = result.model
    sections = [
        Section("Stations", drawing=draw_floor_plan(
            model, [Mark(str(k + 1), s.name, s.position) for k, s in enumerate(result.stations)]
        )),
        Section(
            "In the order to scan in", f"{', '.join(f'{k}: {v}' for k, v in ACTIONS.items())}." if result.existing else "",
            columns=(
                "", "Name", "X m", "Y m", "Z m", "Minutes", "Measures m2", "New m2", "Completes", "Action", "Registered to",
            ),
            rows=[
                (str(k + 1), s.name, *(f"{x:.2f}" for x in s.position), f"{s.minutes:.1f}", f"{s.area:.1f}",
                 f"{s.new_area:.1f}", named(result.completed(k + 1)), ", ".join(s.actions), ", ".join(s.linked_to))
                for k, s in enumerate(result.stations)
            ],
            numeric=frozenset(range(2, 8)),
        ),
        Section(
            "What to expect per element", "Worked out before anyone scans, for elements that stand as planned.",
            columns=(
                "Element", "In reach", "Target", "Before", "Coverage", "Belief", "Spacing mm", "Sigma mm", "Model error mm",
                "LOA",
            ),
            rows=[
                (f"{f.ifc_class} {f.name}".strip(), percent(f.reachable), percent(f.target),
                 percent(f.before if result.existing else None), percent(f.coverage), f"{f.belief:.2f}",
                 millimetres(f.spacing), millimetres(f.sigma, 2), millimetres(f.predicted_error),
                 label(f.loa))
                for f in result.forecasts if f.chosen
            ],
            numeric=frozenset(range(1, 9)),
        ),
    ]
    if result.warnings:
        sections.append(Section("Warnings", columns=("",), rows=[(w,) for w in result.warnings]))
    meta = [
        ("Model", Path(model.path).name), ("Scanner", result.scanner.name), ("Places looked at", str(result.places)),
        ("Method", result.method),
    ]
    title = f"Scan plan of {model.project_name or Path(model.path).name}"
    return write_page(folder, title, "Scan plan", plan_sentence(result), meta, sections)
