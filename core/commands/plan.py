"""``bim-verify plan``: where to stand a scanner."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import BimVerifyError
from ..planning.options import PlanOptions
from ..progress import Progress
from .checks import check_outputs, check_report, input_options, larger_than_zero, zero_or_more
from .table import COMMON, MODEL, ORIGIN, Argument, Command, Outcome, Values

if TYPE_CHECKING:
    from ..planning.results import PlanResult

DEFAULT = PlanOptions()
MOST_LINES = 12
SCANNERS = ("auto", "fast", "medium", "fine")


def plan_options(values: Values) -> PlanOptions:
    """Options of a planning from a command's values."""
    if not 0 < values["coverage"] <= 1:
        raise BimVerifyError(f"--coverage must be a share, 0 to 1, not {values['coverage']:g}.")
    if not 0 < values["max_incidence"] < 90:
        raise BimVerifyError(f"--max-incidence must be between 0 and 90 degrees, not {values['max_incidence']:g}.")
    if not 0 <= values["overlap"] < 1:
        raise BimVerifyError(f"--overlap must be a share, 0 to 1, not {values['overlap']:g}.")
    larger_than_zero(values, "range_max", "spacing_mm")
    zero_or_more(values, "setup_minutes", "registration_sigma_mm", "solve_seconds")
    if not 1 <= values["places"] <= 5000:
        raise BimVerifyError(f"--places must be 1 to 5000, not {values['places']}.")
    return PlanOptions(
        loa=values["loa"], scanner=values["scanner"], coverage=values["coverage"], classes=_words(values["classes"]),
        elements=_words(values["elements"]), max_incidence=math.radians(values["max_incidence"]),
        range_max=values["range_max"], spacing=None if values["spacing_mm"] is None else values["spacing_mm"] / 1000,
        registration_sigma=values["registration_sigma_mm"] / 1000, overlap=values["overlap"], candidates=values["places"],
        setup_minutes=values["setup_minutes"], solve_seconds=values["solve_seconds"], seed=values["seed"],
        **input_options(values),
    )


def _words(text: str | None) -> tuple[str, ...]:
    return tuple(word.strip() for word in (text or "").split(",") if word.strip())


def _plan(values: Values, progress: Progress) -> Outcome:
    from ..jobs import plan
    from ..planning.outputs import plan_to_json, write_plan_csv, write_plan_ifc, write_plan_json
    from ..planning.report import write_plan_report
    from ..report.page_frame import PAGE

    options = plan_options(values)
    scans = values["add_to"] or []
    inputs = [values["model"], *scans]
    outputs = [values[key] for key in ("out", "csv", "ifc", "json") if values[key]]
    check_outputs(inputs, outputs)
    if values["report"]:
        check_report(values["report"], (PAGE,), inputs, outputs)
    result = plan(values["model"], options, progress.part(0.0, 0.95), scans)
    if not result.stations:
        if not result.existing:
            raise BimVerifyError(
                f"No place on the floors of {values['model']} measures any chosen element as LOA{options.loa} needs; "
                "choose a lower level, a finer scanner, or other elements."
            )
        lines = [f"The campaign gives LOA{options.loa} wherever a scanner can; no set-up is missing."]
    else:
        lines = plan_lines(result)
    lines.append(f"Stations: {values['out']}")
    if values["report"]:
        lines.append(f"Report: {Path(values['report']) / PAGE}")

    def write() -> None:
        write_plan_json(values["out"], result)
        if values["csv"]:
            write_plan_csv(values["csv"], result)
        if values["ifc"]:
            write_plan_ifc(values["model"], result, values["ifc"])
        if values["report"]:
            write_plan_report(values["report"], result)

    return Outcome(lines, plan_to_json(result), result, write)


def plan_lines(result: PlanResult) -> list[str]:
    """The plan in a few lines for a person."""
    from ..planning.sentences import named, plan_sentence  # here: the table of commands loads no library

    lines = [plan_sentence(result)]
    for number, station in enumerate(result.stations[:MOST_LINES], 1):
        x, y, z = station.position
        actions = f" [{', '.join(station.actions)}]" if station.actions else ""
        complete = named(result.completed(number))
        lines.append(
            f"  {station.name}: {x:.2f}, {y:.2f}, {z:.2f} - {station.minutes:.1f} min, {station.new_area:.1f} m2 more on "
            f"{len(station.for_elements)} elements{actions}{f'; completes {complete}' if complete else ''}"
        )
    if len(result.stations) > MOST_LINES:
        lines.append(f"  and {len(result.stations) - MOST_LINES} more")
    lines += [f"Note: {warning}" for warning in result.warnings[:5]]
    return lines


COMMAND = Command(
    "plan",
    "say where to stand a scanner so that the chosen elements reach a level of accuracy with the fewest set-ups",
    (
        MODEL,
        Argument("--out", "stations.json to write; bim-verify simulate reads it", required=True),
        Argument("--loa", "level of accuracy", int, DEFAULT.loa, (10, 20, 30, 40, 50)),
        Argument("--scanner", "scanner preset; auto takes the one with the least time", str, DEFAULT.scanner, SCANNERS),
        Argument("--coverage", "share of what can be reached of each element", float, DEFAULT.coverage),
        Argument("--classes", "IFC classes of the elements, by commas (default: all)"),
        Argument("--elements", "GlobalIds of the elements, by commas (default: all)"),
        Argument("--add-to", "scans of a campaign that the plan adds to", many=True),
        Argument("--max-incidence", "steepest incidence angle, degrees", float, 70.0),
        Argument("--range-max", "longest range, metres (default: the scanner's)", float),
        Argument("--spacing-mm", "largest distance between returns, millimetres (default: from the level)", float),
        Argument(
            "--registration-sigma-mm", "registration error to expect, millimetres", float, 1000 * DEFAULT.registration_sigma
        ),
        Argument("--overlap", "share of the smaller view that linked stations have in common", float, DEFAULT.overlap),
        Argument("--places", "places on the floors to look at", int, DEFAULT.candidates),
        Argument("--setup-minutes", "minutes to set up and move on", float, DEFAULT.setup_minutes),
        Argument("--solve-seconds", "time for the proof that fewer do not do", float, DEFAULT.solve_seconds),
        Argument("--seed", "seed of the places", int, 0),
        Argument("--csv", "CSV file of the stations"),
        Argument("--ifc", "copy of the model with the stations as annotations"),
        Argument("--report", "folder for the report (one HTML page)"),
        Argument("--frame", "frame the scans are in", str, DEFAULT.scan_frame, ("auto", "model", "map")),
        ORIGIN,
        *COMMON,
    ),
    _plan,
)
