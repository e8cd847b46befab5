"""How right are the verdicts on a simulated campaign, whose truth is known?"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..results import ElementVerdict, VerificationResult
from ..sensing.loa import UPPER_BOUND_M

CLEARLY_MOVED, CLEARLY_WITHIN = 1.3, 0.6
"""Shifts between these multiples of the level's bound could be judged either way and are not scored."""
UNSEEN, WELL_SEEN, MOSTLY_SEEN = 0.01, 0.25, 0.6
"""Witnessed shares of the surface: nothing to see below the first, scored above the second, no excuse above the third."""
STRAY_RETURNS = 20


@dataclass
class Score:
    """Verdicts against the truth of a campaign. Lengths in metres."""

    right: int = 0
    scored: int = 0
    wrong: list[tuple[ElementVerdict, str]] = field(default_factory=list)
    per_kind: dict[str, Counter[str]] = field(default_factory=dict)
    """Kind of truth (confirmed, deviating, absent, unseen) -> statuses given."""
    shift_errors: list[float] = field(default_factory=list)
    """Error of the displacement along the true direction, for shifted elements."""
    normalized_errors: list[float] = field(default_factory=list)
    """The same divided by the stated standard deviation, registration included."""
    unmoved_significant: list[bool] = field(default_factory=list)
    """Whether a shift was called significant, for elements in view that did not move."""

    @property
    def shift_error_median(self) -> float:
        return float(np.median(np.abs(self.shift_errors))) if self.shift_errors else 0.0

    @property
    def false_significant(self) -> float:
        """Share of the elements that did not move with a significant shift."""
        return float(np.mean(self.unmoved_significant)) if self.unmoved_significant else 0.0

    def tally(self, kind: str) -> str:
        """``right/scored`` of a kind of truth."""
        scored = sum(self.per_kind.get(kind, Counter()).values())
        return f"{scored - sum(k == kind for _, k in self.wrong)}/{scored}"

    def add(self, other: Score) -> None:
        """Join another campaign's score to this one."""
        self.right += other.right
        self.scored += other.scored
        for kind, counts in other.per_kind.items():
            self.per_kind.setdefault(kind, Counter()).update(counts)
        for name in ("wrong", "shift_errors", "normalized_errors", "unmoved_significant"):
            getattr(self, name).extend(getattr(other, name))


def score(result: VerificationResult, truth: dict[str, Any]) -> Score:
    """Score every element that the truth says something definite about."""
    bound = UPPER_BOUND_M[result.options.loa]
    total = Score()
    for verdict in result.verdicts:
        if (fact := truth["elements"].get(verdict.global_id)) is None:
            continue
        _add_shift_error(total, verdict, fact)
        kind, right = _expected(fact, bound)
        if not kind:
            continue
        if kind == "confirmed" and fact["edit"] == "none" and verdict.significant is not None:
            total.unmoved_significant.append(verdict.significant)
        total.scored += 1
        total.per_kind.setdefault(kind, Counter())[verdict.status] += 1
        if verdict.status in right:
            total.right += 1
        else:
            total.wrong.append((verdict, kind))
    return total


def _expected(fact: dict[str, Any], bound: float) -> tuple[str, tuple[str, ...]]:
    seen, offset = fact["witnessed"], abs(fact["offset"])
    if seen < UNSEEN and fact["hits"] < STRAY_RETURNS:
        return "unseen", ("NOTOBSERVED",)
    if seen < WELL_SEEN:
        return "", ()
    if fact["edit"] == "remove":
        return "absent", ("ABSENT",)
    if fact["edit"] == "shift" and offset >= CLEARLY_MOVED * bound:
        return "deviating", ("DEVIATING",)
    if fact["edit"] == "shift" and offset > CLEARLY_WITHIN * bound:
        return "", ()
    return "confirmed", ("CONFIRMED", "PARTIAL") if seen < MOSTLY_SEEN else ("CONFIRMED",)


def _add_shift_error(total: Score, verdict: ElementVerdict, fact: dict[str, Any]) -> None:
    if fact["edit"] != "shift" or verdict.displacement_vector is None or fact["witnessed"] <= 0.3:
        return
    error = float(np.dot(verdict.displacement_vector, fact["direction"])) - fact["offset"]
    total.shift_errors.append(error)
    if verdict.displacement_sigma:
        total.normalized_errors.append(error / verdict.displacement_sigma)
