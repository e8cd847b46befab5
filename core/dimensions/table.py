"""Dimensions and tests as rows: for the CSV file, the JSON file and the report alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..files import whole_file
from ..planes.conformity import Conformity
from ..planes.derived import Estimate, level_of_accuracy
from ..report.csv_out import csv_bytes, guard

HEADER = (
    "Where", "GlobalId", "What", "Between", "Planned_mm", "AsBuilt_mm", "Sigma_mm", "Low95_mm", "High95_mm", "LOA",
    "PValue", "Limit_mm", "PLimit", "Exceeds", "Result", "Reason",
)  # fmt: skip
COLUMNS = ("Where", "What", "Between", "Planned mm", "As built mm", "± mm", "p", "Limit mm", "LOA, or limit")
NUMERIC = frozenset({3, 4, 5, 6, 7})


@dataclass(frozen=True)
class Dimension:
    """Something measured in a room or an opening, or a test of DIN 18202 as an offset. Metres."""

    where: str
    """Name of the room or the opening."""
    global_id: str
    """Of the space or the opening; empty where there is none."""
    what: str
    """width, height, ``vertex x``, ``edge length``, ... or the name of a test. Leans and slopes are metres over one metre."""
    between: tuple[str, ...]
    """The elements whose faces were used."""
    planned: float | None
    value: float | None
    """None where it could not be measured; ``reason`` then says why."""
    sigma: float | None
    interval_95: tuple[float, float] | None
    loa: str | None
    p_value: float | None
    """Of no difference from the plan, or of no deviation at all; None where no plan is known."""
    limit: float | None = None
    p_limit: float | None = None
    """Of keeping the limit."""
    exceeds: bool | None = None
    keeps: bool | None = None
    """At 95 %; where it is neither shown to exceed the limit nor to keep it, the question is open."""
    covariance: tuple[float, ...] | None = None
    """Of a vertex: of this coordinate with x, y and z [m2]."""
    opening: bool = False
    """Of an opening, not of a room."""
    reason: str = ""
    """Why it was not measured."""


def measured(
    where: str, global_id: str, what: str, between: tuple[str, ...], found: Estimate, planned: float | None = None,
    loa: str | None = None,
) -> Dimension:
    """A row for a number with its standard deviation, and with what was planned where that is known."""
    p = None if planned is None else found.p_value(planned)
    return Dimension(where, global_id, what, between, planned, found.value, found.sigma, found.interval, loa, p)


def width(
    where: str, global_id: str, what: str, between: tuple[str, ...], found: Estimate, planned: float | None = None
) -> Dimension:
    """A row for a clear distance."""
    return measured(where, global_id, what, between, found, planned, level_of_accuracy(found.sigma))


def unmeasured(where: str, global_id: str, what: str, between: tuple[str, ...], reason: str) -> Dimension:
    """A row for what could not be measured, and why."""
    return Dimension(where, global_id, what, between, None, None, None, None, None, None, reason=reason)


def conformity(where: str, global_id: str, between: tuple[str, ...], test: Conformity) -> Dimension:
    """A row for a test."""
    interval = Estimate(test.value, test.sigma).interval
    return Dimension(
        where, global_id, test.name, between, None, test.value, test.sigma, interval, None, test.p_value, test.limit,
        test.p_limit, test.exceeds, test.keeps,
    )


def dimensions_to_json(rows: Sequence[Dimension]) -> list[dict[str, Any]]:
    """Plain values, metres."""
    return [
        {**asdict(row), "between": list(row.between), "interval_95": list(row.interval_95) if row.interval_95 else None}
        for row in rows
    ]


def write_dimensions(path: str | Path, rows: Sequence[Dimension]) -> None:
    """One line a row, UTF-8 with a byte order mark, millimetres; BimVerifyError when ``path`` cannot be written."""
    lines = [
        (guard(r.where), guard(r.global_id), r.what, guard("; ".join(r.between)),
         *(_mm(v, 2) for v in (r.planned, r.value, r.sigma, *(r.interval_95 or (None, None)))), r.loa or "",
         _share(r.p_value, 4), _mm(r.limit, 2), _share(r.p_limit, 4),
         "" if r.exceeds is None else str(r.exceeds).upper(), _result(r), guard(r.reason))
        for r in rows
    ]  # fmt: skip
    with whole_file(path) as temporary:
        temporary.write_bytes(csv_bytes(HEADER, lines))


def shown(rows: Sequence[Dimension]) -> list[tuple[str, ...]]:
    """Cells under ``COLUMNS`` for a report."""
    return [
        (r.where, r.what, ", ".join(r.between), _mm(r.planned, 1), _mm(r.value, 1),
         "" if r.sigma is None else f"{1960 * r.sigma:.1f}",
         _share(r.p_value, 3), _mm(r.limit, 0),
         r.loa or _result(r) or r.reason)
        for r in rows
    ]  # fmt: skip


def _result(row: Dimension) -> str:
    """Of a limit."""
    return "" if row.exceeds is None else "exceeded" if row.exceeds else "kept" if row.keeps else "open"


def _mm(value: float | None, digits: int) -> str:
    return "" if value is None else f"{1000 * value:.{digits}f}"


def _share(value: float | None, digits: int) -> str:
    return "" if value is None else f"{value:.{digits}f}"
