"""The table of all elements as CSV, safe to open in a spreadsheet."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from ..files import whole_file
from ..results import LEVELS, VerificationResult

FORMULA_STARTS = tuple("=+-@＝＋－＠\t\r\n")
"""A cell that begins with one of these may be run by a spreadsheet."""
INSIDE = re.compile(r"""([;\t\r\n]["'\s]*)(?=[=+\-@＝＋－＠])""")
"""Where a cell begins with one for a spreadsheet that separates cells by semicolons or tabs."""
TEXT_COLUMNS = ("GlobalId", "Class", "Name", "Storey", "Status", "RequiredLOA", "AchievedLOA")
NUMBER_COLUMNS = (
    "Coverage", "BeliefOccupied", "BeliefEmpty", "BeliefUnknown", "Conflict",
    *(f"ConfirmedRatioLOA{level}" for level in LEVELS),
    "SampleCount", "ObservedCount", "Area_m2", "DeviationMedian_mm", "DeviationP95_mm",
    "Displacement_mm", "DisplacementX_mm", "DisplacementY_mm", "DisplacementZ_mm", "DisplacementSigma_mm",
    "Significant", "MeasurementSigma_mm", "RegistrationSigma_mm",
)  # fmt: skip
HEADER = (*TEXT_COLUMNS, *NUMBER_COLUMNS, "Stations", "Reason", "Decided", "DecidedBy", "DecisionReason")
Cell = str | float | int | bool | None


def elements_rows(result: VerificationResult) -> Iterator[list[Cell]]:
    """One row per element under ``HEADER``: shares 0..1, lengths in millimetres, None where nothing is known."""
    for v in result.verdicts:
        shift = v.displacement_vector or (None, None, None)
        decision = result.decisions.get(v.global_id)
        yield [
            v.global_id, v.ifc_class, v.name, v.storey, v.status, v.required_loa, v.achieved_loa,
            v.coverage, v.belief_occupied, v.belief_empty, v.belief_unknown, v.conflict,
            *(v.confirmed_ratio.get(level) for level in LEVELS),
            v.sample_count, v.observed_count, v.area,
            *(_mm(x) for x in (v.deviation_median, v.deviation_p95, v.displacement, *shift, v.displacement_sigma)),
            None if v.significant is None else bool(v.significant),
            _mm(v.measurement_sigma), _mm(v.registration_sigma),
            "; ".join(v.stations), v.reason,
            *((decision.status, decision.author, decision.reason) if decision is not None else (None, None, None)),
        ]  # fmt: skip


def elements_csv(result: VerificationResult) -> bytes:
    """One line per element, UTF-8 with a byte order mark, lengths in millimetres, empty where nothing is known."""
    rows = elements_rows(result)
    return csv_bytes(HEADER, ([_cell(name, value) for name, value in zip(HEADER, row, strict=True)] for row in rows))


def write_csv(path: str | Path, result: VerificationResult) -> None:
    """Write ``elements_csv``; BimVerifyError when ``path`` cannot be written."""
    with whole_file(path) as temporary:
        temporary.write_bytes(elements_csv(result))


def csv_bytes(header: Iterable[str], rows: Iterable[Iterable[Cell]]) -> bytes:
    """A table as CSV in UTF-8 with a byte order mark, as spreadsheets know it. Texts are guarded by the caller."""
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(header)
    writer.writerows(rows)
    return b"\xef\xbb\xbf" + text.getvalue().encode("utf-8", "replace")


def guard(text: str) -> str:
    """The text with an apostrophe wherever a spreadsheet could take what follows for a formula.

    At its start, and after what separates cells where the comma does not (semicolon, tab, line).
    """
    starts = text.startswith(FORMULA_STARTS) or text.lstrip().startswith(FORMULA_STARTS)
    return INSIDE.sub(r"\1'", "'" + text if starts else text)


def _cell(name: str, value: Cell) -> str:
    if isinstance(value, str):
        return guard(value)
    if value is None or not math.isfinite(value):
        return ""
    if isinstance(value, bool):
        return str(value).upper()
    return str(value) if isinstance(value, int) else f"{value:.{2 if name.endswith('_mm') else 4}f}"


def _mm(value: float | None) -> float | None:
    return None if value is None else value * 1000.0
