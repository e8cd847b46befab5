"""The report of a plan."""

from __future__ import annotations

from pathlib import Path

from ..quality.levels import ACTIONS
from ..report.floor_plan import Mark, draw_floor_plan
from ..report.plain_page import Section, millimetres, percent, write_page
from ..sensing.loa import label
from .results import PlanResult


def write_plan_report(folder: str | Path, result: PlanResult) -> Path:
    """Write ``index.html`` into ``folder`` (made if missing) and return its path; BimVerifyError where that fails."""
    summary, model = result.summary(), result.model
    more = " more" if result.existing else ""
    proof = "No plan over the places looked at has fewer." if result.optimal else (
        f"At least {result.least} are needed, so the plan is at most {percent(result.gap)} too large."
    )
    headline = (
        f"{len(result.stations)}{more} set-ups, {result.minutes:.0f} minutes, for LOA{result.options.loa} on "
        f"{summary['elements_reached']} of {summary['elements_asked']} elements. {proof}"
    )
    sections = [
        Section("Stations", drawing=draw_floor_plan(
            model, [Mark(str(k + 1), s.name, s.position) for k, s in enumerate(result.stations)]
        )),
        Section(
            "In the order to scan in", f"{', '.join(f'{k}: {v}' for k, v in ACTIONS.items())}." if result.existing else "",
            columns=("", "Name", "X m", "Y m", "Z m", "Minutes", "Measures m2", "New m2", "Action", "Registered to"),
            rows=[
                (str(k + 1), s.name, *(f"{x:.2f}" for x in s.position), f"{s.minutes:.1f}", f"{s.area:.1f}",
                 f"{s.new_area:.1f}", ", ".join(s.actions), ", ".join(s.linked_to))
                for k, s in enumerate(result.stations)
            ],
            numeric=frozenset(range(2, 8)),
        ),
        Section(
            "What to expect per element", "Worked out before anyone scans, for elements that stand as planned.",
            columns=("Element", "In reach", "Target", "Coverage", "Belief", "Spacing mm", "Sigma mm", "Model error mm", "LOA"),
            rows=[
                (f"{f.ifc_class} {f.name}".strip(), percent(f.reachable), percent(f.target), percent(f.coverage),
                 f"{f.belief:.2f}", millimetres(f.spacing), millimetres(f.sigma, 2), millimetres(f.predicted_error),
                 label(f.loa))
                for f in result.forecasts if f.chosen
            ],
            numeric=frozenset(range(1, 8)),
        ),
    ]
    if result.warnings:
        sections.append(Section("Warnings", columns=("",), rows=[(w,) for w in result.warnings]))
    meta = [
        ("Model", Path(model.path).name), ("Scanner", result.scanner.name), ("Places looked at", str(result.places)),
        ("Method", result.method),
    ]
    return write_page(
        folder, f"Scan plan of {model.project_name or Path(model.path).name}", "Scan plan", headline, meta, sections
    )
