"""What somebody has to look at: one finding an element that is not simply confirmed."""

from __future__ import annotations

import math
import re
from collections.abc import Collection
from dataclasses import dataclass

from ..report.palette import STATUS_LABELS
from ..report.rows import SEVERITY
from ..results import ElementVerdict, Status, VerificationResult

DEFAULT_STATUSES: tuple[Status, ...] = ("ABSENT", "DEVIATING", "PARTIAL")
"""NOTOBSERVED is no finding: nothing is known there."""
NOT_IN_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
LONGEST_TITLE = 200


@dataclass(frozen=True)
class Finding:
    """One element with what is to be said of it."""

    row: int
    """Of ``result.verdicts``."""
    verdict: ElementVerdict
    status: Status
    title: str
    text: str


def findings(
    result: VerificationResult,
    statuses: Collection[Status] = DEFAULT_STATUSES,
    global_ids: Collection[str] | None = None,
) -> list[Finding]:
    """The elements with one of ``statuses`` (among ``global_ids`` if given), most urgent first.

    A verdict that a person overruled counts with what the person decided.
    """
    found = []
    for row, verdict in enumerate(result.verdicts):
        status = result.status_of(verdict)
        if status in statuses and (global_ids is None or verdict.global_id in global_ids):
            found.append(Finding(row, verdict, status, _title(verdict, status), _text(result, verdict)))
    return sorted(found, key=lambda f: (SEVERITY.index(f.status), -(f.verdict.displacement or 0.0), f.row))


def plain_text(text: str) -> str:
    """The text without the characters that XML cannot hold; escaping is the writer's work."""
    return NOT_IN_XML.sub("\ufffd", text)


def _title(verdict: ElementVerdict, status: Status) -> str:
    shift = ""
    if status == "DEVIATING" and verdict.displacement is not None:
        shift = f" by {1000 * verdict.displacement:.0f} mm"
    name = " ".join(plain_text(verdict.name).split()) or "unnamed"
    return f"{STATUS_LABELS[status]}{shift}: {verdict.ifc_class.removeprefix('Ifc')} {name}"[:LONGEST_TITLE]


def _text(result: VerificationResult, verdict: ElementVerdict) -> str:
    lines = [verdict.reason]
    if (decision := result.decisions.get(verdict.global_id)) is not None:
        lines.append(f"Decided by {decision.author or 'a person'} on {decision.date}: {decision.reason}")
    if verdict.displacement is not None and verdict.displacement_vector is not None:
        x, y, z = (1000 * v for v in verdict.displacement_vector)
        sigma = "" if verdict.displacement_sigma is None else f" ± {1960 * verdict.displacement_sigma:.1f} mm (95 %)"
        lines.append(f"Shift {1000 * verdict.displacement:.1f} mm{sigma}; X {x:+z.1f}, Y {y:+z.1f}, Z {z:+z.1f} mm.")
    if verdict.deviation_median is not None and math.isfinite(verdict.deviation_median):
        lines.append(f"Median deviation {1000 * verdict.deviation_median:+z.1f} mm along the outward normal.")
    place = " at its planned place" if verdict.status == "DEVIATING" else ""
    lines.append(f"{verdict.achieved_loa} of {verdict.required_loa}; {verdict.coverage:.0%} of it has evidence{place}.")
    lines.append(f"GlobalId {verdict.global_id}" + (f", storey {verdict.storey}" if verdict.storey else ""))
    return plain_text("\n".join(lines))
