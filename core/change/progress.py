"""Observed against planned: what was expected at the date of the scan, and how far the work has come."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import date

from .look import Seen
from .planned import Planned
from .results import ElementChange, GroupProgress, Progressing, State

STANDING: tuple[Seen, ...] = ("STANDS", "MOVED")


def expected_state(plan: Planned, day: date | None) -> State:
    """What the plan says of an element on that day, in the words of the observed states."""
    if plan.act == "build":
        if plan.start and day and day < plan.start:
            return "DISAPPEARED"
        if plan.finish and day and day < plan.finish:
            return "PARTIAL"
        return "NEW"
    if plan.act == "demolish":
        if plan.start and day and day < plan.start:
            return "CONFIRMED"
        if plan.finish and day and day < plan.finish:
            return "PARTIAL"
        return "DISAPPEARED"
    return "UNKNOWN" if plan.temporary else "CONFIRMED"


def judge(plan: Planned, expected: State, seen: Seen) -> tuple[Progressing, bool | None]:
    """Progress of an element, and whether what was seen agrees with the plan (None: not seen, or no plan)."""
    if seen == "UNSEEN" or expected == "UNKNOWN":
        return "cannot tell", None
    dated = plan.start is not None or plan.finish is not None
    stands = seen in STANDING
    if expected == "PARTIAL":
        if plan.act == "build":
            return ("late", False) if seen == "GONE" else ("on time", True)
        return ("late", False) if stands else ("on time", True)
    if plan.act == "demolish":
        if expected == "CONFIRMED":
            return ("on time", True) if stands else ("early", False)
        return ("on time", True) if seen == "GONE" else ("should be gone", False)
    if expected == "DISAPPEARED":
        return ("on time", True) if seen == "GONE" else ("early", False)
    if stands:
        return "on time", True
    return ("late" if dated else "not built"), False


def group_progress(
    elements: Sequence[ElementChange], plans: Sequence[Planned], weight: Sequence[float]
) -> tuple[GroupProgress, ...]:
    """Percent complete per storey, class and task; ``weight`` is each element's planned volume (or what stands for it)."""
    found: list[GroupProgress] = []
    kinds: tuple[tuple[str, Callable[[int], str]], ...] = (
        ("storey", lambda n: elements[n].storey or "(no storey)"),
        ("class", lambda n: elements[n].ifc_class),
        ("task", lambda n: plans[n].task),
    )
    for kind, key in kinds:
        groups: dict[str, list[int]] = {}
        for n in range(len(elements)):
            if name := key(n):
                groups.setdefault(name, []).append(n)
        found += [_group(kind, name, rows, elements, weight) for name, rows in sorted(groups.items())]
    return tuple(found)


def _group(
    kind: str, name: str, rows: list[int], elements: Sequence[ElementChange], weight: Sequence[float]
) -> GroupProgress:
    total = sum(weight[n] for n in rows)
    seen = built = due = 0.0
    for n in rows:
        e = elements[n]
        if e.state == "UNKNOWN" and e.progress == "cannot tell":
            continue
        share = {"CONFIRMED": 1.0, "NEW": 1.0, "DISAPPEARED": 0.0, "UNKNOWN": 0.0}.get(
            e.state, _built_share(e)
        )
        seen += weight[n]
        built += weight[n] * share
        due += weight[n] * {"DISAPPEARED": 0.0, "PARTIAL": 0.5}.get(e.expected, 1.0)
    return GroupProgress(
        kind, name, len(rows), built / seen if seen > 0 else None, due / seen if seen > 0 else None,  # type: ignore[arg-type]
        1.0 - seen / total if total > 0 else 1.0,
    )


def _built_share(e: ElementChange) -> float:
    known = e.confirmed_ratio + e.new_ratio + e.disappeared_ratio
    return (e.confirmed_ratio + e.new_ratio) / known if known > 0 else 0.5
