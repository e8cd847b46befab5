"""Observed against planned: what was expected at the date of the scan, and how far the work has come."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import date

from .look import ElementSight
from .planned import Planned
from .results import ElementChange, GroupProgress, Progressing, State


def expected_state(plan: Planned, day: date | None) -> State:
    """What the plan says of an element on that day, in the words of the observed states; UNKNOWN where dates lack a day."""
    plan = plan.on(day)
    if plan.dated and day is None:
        return "UNKNOWN"
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


def judge(plan: Planned, expected: State, found: State) -> tuple[Progressing, bool | None]:
    """Progress of an element, and whether what was found agrees with the plan (None: not decided, or no plan).

    ``plan`` is the one that counts on the day (``Planned.on``). ``found`` is its state against the model: what left its
    place, or moved partly off it, is not where it was planned.
    """
    if found == "UNKNOWN" or expected == "UNKNOWN":
        return "cannot tell", None
    stands, gone = found in ("CONFIRMED", "NEW"), found == "DISAPPEARED"
    if expected == "PARTIAL":  # its task runs, and may begin or end with this element
        return "on time", True
    if plan.act == "demolish":
        if expected == "CONFIRMED":
            return ("on time", True) if stands else ("early", False)
        return ("on time", True) if gone else ("should be gone", False)
    if expected == "DISAPPEARED":
        return ("on time", True) if gone else ("early", False)
    if stands:
        return "on time", True
    if plan.exists:
        return "early", False  # it was there, and nothing is to be done with it
    return ("late" if plan.dated else "not built"), False


def group_progress(
    elements: Sequence[ElementChange], plans: Sequence[Planned], weight: Sequence[float], day: date | None = None
) -> tuple[GroupProgress, ...]:
    """Percent complete per storey, class and task.

    elements : as found against the model, whatever the reference is, since the plan tells what is to stand.
    weight : each element's planned volume (or what stands for it), space that elements share counted once.

    Complete is the share of the work that is done: what stands of elements to be built or to be left, what is gone of
    elements to be demolished. Temporary elements are no part of it. Of a task that runs on that ``day``, as much is due as of
    its time has passed.
    """
    found: list[GroupProgress] = []
    kinds: tuple[tuple[str, Callable[[int], str]], ...] = (
        ("storey", lambda n: elements[n].storey or "(no storey)"),
        ("class", lambda n: elements[n].ifc_class),
        ("task", lambda n: plans[n].task),
    )
    for kind, key in kinds:
        groups: dict[str, list[int]] = {}
        for n in range(len(elements)):
            if not plans[n].temporary and (name := key(n)):
                groups.setdefault(name, []).append(n)
        found += [_group(kind, name, rows, elements, plans, weight, day) for name, rows in sorted(groups.items())]
    return tuple(found)


def _group(
    kind: str, name: str, rows: list[int], elements: Sequence[ElementChange], plans: Sequence[Planned],
    weight: Sequence[float], day: date | None,
) -> GroupProgress:
    total = sum(weight[n] for n in rows)
    decided = done = known = due = unseen = 0.0
    for n in rows:
        e = elements[n]
        if e.standing_ratio is None:
            unseen += weight[n]
            continue
        unseen += weight[n] * e.unknown_ratio
        decided += weight[n]
        done += weight[n] * _done(e.standing_ratio, plans[n])
        if e.expected != "UNKNOWN":
            known += weight[n]
            due += weight[n] * _due(e.expected, plans[n], day)
    return GroupProgress(
        kind, name, len(rows), done / decided if decided > 0 else None, due / known if known > 0 else None,  # type: ignore[arg-type]
        unseen / total if total > 0 else 1.0,
    )


def _due(expected: State, plan: Planned, day: date | None) -> float:
    """Share of the work on an element that should be done."""
    if expected == "PARTIAL" and plan.start and plan.finish and day:
        return (day - plan.start).days / max((plan.finish - plan.start).days, 1)
    return _done({"DISAPPEARED": 0.0, "PARTIAL": 0.5}.get(expected, 1.0), plan)


def _done(standing: float, plan: Planned) -> float:
    """Share of the work on an element that is done when this share of it stands."""
    return 1.0 - standing if plan.act == "demolish" else standing


def standing_ratio(found: ElementSight, state: State, shares: tuple[float, float, float, float]) -> float | None:
    """Share of an element that stands at its planned place, against the model; None where that was not decided.

    shares : of its volume, confirmed, disappeared, new and unknown. These are no measure of it: rays tell of all the
    thickness of a part that is gone, but only of that face of the rest which they met.
    """
    if state == "UNKNOWN":
        return None
    if state != "PARTIAL":
        return 0.0 if state == "DISAPPEARED" else 1.0
    if found.seen != "MOVED":
        return found.present
    known = shares[0] + shares[1]
    return shares[0] / known if known > 0 else 0.5
