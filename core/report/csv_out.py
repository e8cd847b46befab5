"""The table of all elements as CSV, safe to open in a spreadsheet."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path

from ..files import whole_file
from ..results import LEVELS, ElementVerdict, VerificationResult

FORMULA_STARTS = tuple("=+-@＝＋－＠\t\r\n")
"""A cell that begins with one of these may be run by a spreadsheet."""
TEXT_COLUMNS = ("GlobalId", "Class", "Name", "Storey", "Status", "RequiredLOA", "AchievedLOA")
NUMBER_COLUMNS = (
    "Coverage", "BeliefOccupied", "BeliefEmpty", "BeliefUnknown", "Conflict",
    *(f"ConfirmedRatioLOA{level}" for level in LEVELS),
    "SampleCount", "ObservedCount", "Area_m2", "DeviationMedian_mm", "DeviationP95_mm",
    "Displacement_mm", "DisplacementX_mm", "DisplacementY_mm", "DisplacementZ_mm", "DisplacementSigma_mm",
    "Significant", "MeasurementSigma_mm", "RegistrationSigma_mm",
)  # fmt: skip


def elements_csv(result: VerificationResult) -> bytes:
    """One line per element, UTF-8 with a byte order mark, lengths in millimetres, empty where nothing is known."""
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow([*TEXT_COLUMNS, *NUMBER_COLUMNS, "Stations", "Reason"])
    for verdict in result.verdicts:
        writer.writerow(_line(verdict))
    return b"\xef\xbb\xbf" + text.getvalue().encode("utf-8", "replace")


def write_csv(path: str | Path, result: VerificationResult) -> None:
    """Write ``elements_csv``; BimVerifyError when ``path`` cannot be written."""
    with whole_file(path) as temporary:
        temporary.write_bytes(elements_csv(result))


def guard(text: str) -> str:
    """The text with a leading apostrophe if a spreadsheet could take it for a formula."""
    return "'" + text if text.startswith(FORMULA_STARTS) or text.lstrip().startswith(FORMULA_STARTS) else text


def _line(v: ElementVerdict) -> list[str]:
    texts = (v.global_id, v.ifc_class, v.name, v.storey, v.status, v.required_loa, v.achieved_loa)
    shift = v.displacement_vector or (None, None, None)
    return [
        *(guard(text) for text in texts),
        *(_number(x) for x in (v.coverage, v.belief_occupied, v.belief_empty, v.belief_unknown, v.conflict)),
        *(_number(v.confirmed_ratio.get(level)) for level in LEVELS),
        str(v.sample_count), str(v.observed_count), _number(v.area),
        *(_mm(x) for x in (v.deviation_median, v.deviation_p95, v.displacement, *shift, v.displacement_sigma)),
        "" if v.significant is None else str(bool(v.significant)).upper(),
        _mm(v.measurement_sigma), _mm(v.registration_sigma),
        guard("; ".join(v.stations)), guard(v.reason),
    ]  # fmt: skip


def _number(value: float | None, digits: int = 4) -> str:
    return "" if value is None or not math.isfinite(value) else f"{value:.{digits}f}"


def _mm(value: float | None) -> str:
    return _number(None if value is None else value * 1000.0, 2)
