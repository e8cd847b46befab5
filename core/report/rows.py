"""What the report shows of each element, and of groups of elements: plain values in millimetres and shares."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..results import LEVELS, STATUSES, ElementVerdict, VerificationResult
from ..sensing.loa import UPPER_BOUND_M

NICE_LIMITS_MM = (1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 50.0, 75.0, 100.0, 150.0, 200.0, 300.0, 500.0)
ELEMENT_BINS = 31
SEVERITY = ("ABSENT", "DEVIATING", "PARTIAL", "NOTOBSERVED", "CONFIRMED")
"""Order of the table: what a person must look at first."""


def element_rows(result: VerificationResult) -> list[dict[str, Any]]:
    """One record per element, most urgent first; ``row`` is its place in ``result.verdicts``.

    ``status`` is what holds; ``decision`` says who put it in the place of the computed verdict, if anybody did.
    """
    start = result.samples.first_of(len(result.verdicts))
    bound_mm = UPPER_BOUND_M[result.options.loa] * 1000.0
    rows = []
    for index, (element, verdict) in enumerate(zip(result.model.elements, result.verdicts, strict=True)):
        part = slice(int(start[index]), int(start[index + 1]))
        record = _record(verdict)
        record["row"] = index
        decision = result.decisions.get(verdict.global_id)
        record["status"] = result.status_of(verdict)
        record["decision"] = None if decision is None else {**asdict(decision), "computed": verdict.status}
        record["type"] = element.type_name
        record["histogram"], record["limit"] = _histogram(
            result.evidence.deviation[part], result.samples.area[part], bound_mm
        )
        rows.append(record)
    rows.sort(key=lambda r: (SEVERITY.index(r["status"]), -(r["shift"] or 0.0), -(r["p95"] or 0.0), r["row"]))
    return rows


def group_counts(
    rows: list[dict[str, Any]], key: Callable[[dict[str, Any]], str], most: int = 8
) -> list[tuple[str, int, list[int]]]:
    """(group, elements, count per status), largest first; groups beyond ``most`` come together as ``other``."""
    groups: dict[str, list[int]] = {}
    for row in rows:
        groups.setdefault(key(row), [0] * len(STATUSES))[STATUSES.index(row["status"])] += 1
    ordered = sorted(groups.items(), key=lambda item: (-sum(item[1]), item[0]))
    if len(ordered) > most:
        rest = np.sum([counts for _, counts in ordered[most - 1 :]], axis=0).tolist()
        ordered = [*ordered[: most - 1], (f"other ({len(ordered) - most + 1})", rest)]
    return [(name, sum(counts), counts) for name, counts in ordered]


def nice_limit_mm(
    values_m: NDArray[np.floating], least_mm: float, share: float = 0.99, most_mm: float = math.inf
) -> float:
    """A round limit that holds ``share`` of the absolute values, from about ``least_mm`` to about ``most_mm``."""
    known = np.abs(values_m[np.isfinite(values_m)])
    wanted = max(least_mm, float(np.quantile(known, share)) * 1000.0 if len(known) else 0.0)
    wanted = min(wanted, most_mm)
    return next((limit for limit in NICE_LIMITS_MM if limit >= wanted - 1e-9), NICE_LIMITS_MM[-1])


def weighted_quantile(values: NDArray[np.floating], weight: NDArray[np.floating], share: float) -> float | None:
    """Quantile of the finite values by weight; None where there are none."""
    known = np.isfinite(values)
    if not known.any():
        return None
    order = np.argsort(values[known], kind="stable")
    total = np.cumsum(weight[known][order])
    at = min(int(np.searchsorted(total, share * total[-1])), len(order) - 1)
    return float(values[known][order[at]])


def _record(v: ElementVerdict) -> dict[str, Any]:
    vector = None if v.displacement_vector is None else [_mm(x) for x in v.displacement_vector]
    return {
        "id": v.global_id,
        "class": v.ifc_class,
        "name": v.name,
        "storey": v.storey,
        "required": v.required_loa,
        "achieved": v.achieved_loa,
        "occupied": _share(v.belief_occupied),
        "empty": _share(v.belief_empty),
        "unknown": _share(v.belief_unknown),
        "conflict": _share(v.conflict),
        "coverage": _share(v.coverage),
        "ratio": [_share(v.confirmed_ratio.get(level)) for level in LEVELS],
        "samples": v.sample_count,
        "observed": v.observed_count,
        "area": round(v.area, 3),
        "median": _mm(v.deviation_median),
        "p95": _mm(v.deviation_p95),
        "shift": _mm(v.displacement),
        "vector": vector,
        "shiftSigma": _mm(v.displacement_sigma),
        "significant": v.significant,
        "measurementSigma": _mm(v.measurement_sigma),
        "registrationSigma": _mm(v.registration_sigma),
        "reason": v.reason,
        "stations": list(v.stations),
    }


def _histogram(
    deviation: NDArray[np.float32], area: NDArray[np.float64], bound_mm: float
) -> tuple[list[float] | None, float]:
    """Shares of the measured area in ELEMENT_BINS bins from minus to plus a limit, and that limit, millimetres.

    What lies beyond the limit is in the first and last bin.
    """
    known = np.isfinite(deviation)
    limit = nice_limit_mm(deviation, bound_mm / 3.0)
    if not known.any():
        return None, limit
    values = np.clip(deviation[known].astype(np.float64) * 1000.0, -limit, limit)
    count, _ = np.histogram(values, bins=ELEMENT_BINS, range=(-limit, limit), weights=area[known])
    return [round(float(c), 4) for c in count / count.sum()], limit


def _share(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else round(float(value), 4)


def _mm(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else round(float(value) * 1000.0, 2)
