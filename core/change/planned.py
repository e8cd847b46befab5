"""What should stand at a date: from tasks, from the phase, or from the status in the element's common property set."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import date, datetime
from typing import Any, Literal

from ..errors import BimVerifyError
from ..model.parts import DEEPEST

Act = Literal["build", "demolish", ""]
DEMOLITION = ("DEMOLITION", "REMOVAL", "DISMANTLE", "DISPOSAL")
UPKEEP = (
    "ADJUSTMENT", "ATTENDANCE", "CALIBRATION", "EMERGENCY", "INSPECTION", "LOGISTIC", "MAINTENANCE", "MOVE", "OPERATION",
    "RENOVATION", "SAFETY", "SHUTDOWN", "STARTUP", "TESTING", "TROUBLESHOOTING",
)
"""Types of tasks that neither make an element nor take it away: they say nothing of when it stands."""
STATUS_ACT: dict[str, Act] = {"NEW": "build", "EXISTING": "", "DEMOLISH": "demolish", "TEMPORARY": ""}
PHASE_WORD = re.compile(r"^(phas|fase)|(?<!^em)(phas(e|en|es)|fase[ns]?)$")
"""Names of property sets and properties are in the language of the program that wrote them: English, German, Dutch, French.
Words may be joined (Bauphase, bouwfase), but an emphasis is no phase."""
CAPITAL = re.compile(r"(?<=[a-z])(?=[A-Z])")
"""Where words are joined with capitals (RenovationAndPhasing)."""
GONE = ("demol", "abbruch", "abgebrochen", "abriss", "abgerissen", "sloop", "gesloopt", "removed")
"""How words of a demolition begin, without accents."""
BUILT = ("newbuild", "neubau", "nieuwbouw")
BUILT_WORDS = ("new", "neu", "nieuw", "nouveau", "nouvelle")
OPEN = re.compile(r"\s*<.*>\s*$")
"""A value that stands for several, or for none: <varies>."""
NOT = ("no", "none", "not", "kein", "keine", "keiner", "nicht", "geen", "niet", "aucun", "aucune", "non", "pas")


@dataclass(frozen=True)
class Planned:
    """The plan for one element. Dates are None where nothing gives them."""

    act: Act = ""
    """What is to be done with it: build it, demolish it, or nothing."""
    start: date | None = None
    finish: date | None = None
    task: str = ""
    source: str = ""
    """task, phase, status, or empty when the model says nothing but that it exists."""
    temporary: bool = False
    stages: tuple[Planned, ...] = ()
    """What its dated tasks do, in order of time; tasks that follow each other and do the same are one stage."""
    stated: Planned | None = None
    """Of an element with dated tasks: what its phase or status says, where there is no day to hold the dates against."""

    @property
    def dated(self) -> bool:
        return self.start is not None or self.finish is not None

    @property
    def exists(self) -> bool:
        """Whether the model says that the element stands, and is to be left as it is."""
        return self.source == "status" and not self.act and not self.temporary

    @property
    def begin(self) -> date:
        return self.start or self.finish or date.min

    def on(self, day: date | None) -> Planned:
        """The plan that counts on a day: of the stage that began last, else of the first to come.

        Without a day, what phase or status say counts; where they say nothing, the dates stay unused.
        """
        if day is None:
            return self.stated if self.dated and self.stated else self
        begun = [stage for stage in self.stages if stage.begin <= day]
        return begun[-1] if begun else self.stages[0] if self.stages else self


def read_planned(file: Any, elements: list[tuple[int, str]]) -> tuple[Planned, ...]:
    """The plan of elements (STEP id, GlobalId) of an open IFC file: dated tasks go before phases, phases before the status,
    and that before tasks without dates."""
    tasks = _tasks(file)
    return tuple(_planned(file, step_id, global_id, tasks) for step_id, global_id in elements)


def reversed_tasks(file: Any) -> Iterator[str]:
    """A sentence on each task of elements that ends before it begins."""
    plans = {plan for tasks in _tasks(file).values() for plan in tasks}
    for plan in sorted((p for p in plans if p.start and p.finish and p.finish < p.start), key=lambda p: (p.task, str(p))):
        yield f"The task {plan.task} ends on {plan.finish}, before it begins on {plan.start}: one of its dates is wrong."


def parse_date(text: str | None) -> date | None:
    """A day of an ISO 8601 date or time, or None."""
    if not text:
        return None
    try:
        return datetime.fromisoformat(str(text).strip().replace("Z", "+00:00")).date()
    except ValueError:
        try:
            return date.fromisoformat(str(text)[:10])
        except ValueError:
            return None


def check_day(text: str, name: str) -> str:
    """A day that was asked for under ``name``, as YYYY-MM-DD (empty: none was); BimVerifyError when it is no day."""
    text = text.strip()
    try:
        return text and date.fromisoformat(text).isoformat()
    except ValueError as error:
        raise BimVerifyError(f"{name} takes a day like 2025-03-31, not {text!r}.") from error


def _planned(file: Any, step_id: int, global_id: str, tasks: dict[int, list[Planned]]) -> Planned:
    import ifcopenshell.util.element as util

    try:
        product = file.by_id(step_id)
    except RuntimeError:
        return Planned()
    stated = _stated(util.get_psets(product, psets_only=True))
    found = _tasks_of(product, tasks)
    if not found:
        return stated
    if stages := _stages(found):
        return replace(stages[-1], stages=stages, stated=stated if stated.source else None)
    undated = max(found, key=lambda p: p.act == "demolish")  # a demolition comes after the building
    return replace(stated, task=undated.task) if stated.source else undated


def _tasks_of(product: Any, tasks: dict[int, list[Planned]]) -> list[Planned]:
    """Tasks of a product, else of the nearest whole that it is a part of and that has any (a stair, a curtain wall)."""
    import ifcopenshell.util.element as util

    whole = product
    for _ in range(DEEPEST):
        if whole is None or not whole.is_a("IfcElement"):
            break
        if found := tasks.get(whole.id()):
            return found
        whole = util.get_aggregate(whole)
    return tasks.get(product.id(), [])


def _stages(tasks: list[Planned]) -> tuple[Planned, ...]:
    found: list[Planned] = []
    for task in sorted((t for t in tasks if t.dated), key=lambda t: (t.begin, t.act == "demolish")):
        if found and found[-1].act == task.act:
            finish = max((d for d in (found[-1].finish, task.finish) if d), default=None)
            found[-1] = replace(task, start=found[-1].start, finish=finish)
        else:
            found.append(task)
    return tuple(found)


def _stated(sets: dict[str, dict[str, Any]]) -> Planned:
    """What the phase says, else the status in the common property set."""
    for name, properties in sets.items():
        if any(PHASE_WORD.search(word) for word in _words(CAPITAL.sub(" ", name))) and (act := _phase_act(properties)):
            return Planned(act, source="phase")
    for name, properties in sets.items():
        if name.startswith("Pset_") and name.endswith("Common") and properties.get("Status"):
            value = properties["Status"]
            words = {str(v).upper() for v in (value if isinstance(value, (list, tuple)) else [value])}
            for word in ("DEMOLISH", "NEW", "TEMPORARY", "EXISTING"):
                if word in words:
                    return Planned(STATUS_ACT[word], source="status", temporary=word == "TEMPORARY")
    return Planned()


def _phase_act(properties: dict[str, Any]) -> Act:
    """What the phases in a property set make of an element: nothing where they name none, or in words that are not known."""
    stated = [
        (_words(name), _words(str(value))) for name, value in properties.items() if value and not OPEN.match(str(value))
    ]
    stated = [(name, value) for name, value in stated if value and value[0] not in NOT]
    if any(word.startswith(GONE) for name, value in stated for word in (*name, *value)):
        return "demolish"
    words = [word for _, value in stated for word in value]
    return "build" if any(word in BUILT_WORDS or word.startswith(BUILT) for word in words) else ""


def _words(text: str) -> list[str]:
    """Lower case, without accents."""
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode().lower()
    return re.findall(r"[a-z0-9]+", plain)


def _tasks(file: Any) -> dict[int, list[Planned]]:
    """STEP id of a product -> its tasks."""
    found: dict[int, list[Planned]] = {}
    for relation in file.by_type("IfcRelAssignsToProcess"):
        process = relation.RelatingProcess
        if process is not None and process.is_a("IfcTask") and (plan := _task(process)) is not None:
            for product in relation.RelatedObjects or ():
                if product.is_a("IfcProduct"):
                    found.setdefault(product.id(), []).append(plan)
    for relation in file.by_type("IfcRelAssignsToProduct"):
        product = relation.RelatingProduct
        for process in relation.RelatedObjects or ():
            plan = _task(process) if process.is_a("IfcTask") else None
            if plan is not None and product is not None and product.is_a("IfcProduct"):
                found.setdefault(product.id(), []).append(plan)
    return found


def _task(task: Any) -> Planned | None:
    """What a task makes of its products; None where it leaves them as they are, or its own words do not say plainly."""
    start, finish = _dates(task)
    kind = getattr(task, "PredefinedType", None) or "NOTDEFINED"
    if kind in ("USERDEFINED", "NOTDEFINED"):
        kind = (task.ObjectType or "").strip().upper()
    if kind not in DEMOLITION and any(word in kind for word in (*DEMOLITION, *UPKEEP)):
        return None
    act: Act = "demolish" if kind in DEMOLITION else "build"
    return Planned(act, start, finish, task.Name or task.GlobalId, "task")


def _dates(task: Any, depth: int = 0) -> tuple[date | None, date | None]:
    """Start and finish of a task, or of the nearest task above it that has them."""
    controls = (getattr(r, "TimeForTask", None) for r in getattr(task, "HasAssignments", None) or ())  # IFC2X3
    for time in (getattr(task, "TaskTime", None), *controls):
        if time is not None:
            start, finish = _date(time.ScheduleStart), _date(time.ScheduleFinish)
            if start or finish:
                return start, finish
    for relation in (*(getattr(task, "Nests", None) or ()), *(getattr(task, "Decomposes", None) or ())):
        above = relation.RelatingObject
        if above is not None and above.is_a("IfcTask") and depth < DEEPEST:
            return _dates(above, depth + 1)
    return None, None


def _date(value: Any) -> date | None:
    """A date, which is an entity in IFC2X3."""
    if value is None or isinstance(value, str):
        return parse_date(value)
    day = getattr(value, "DateComponent", value)
    try:
        return date(day.YearComponent, day.MonthComponent, day.DayComponent)
    except (AttributeError, TypeError, ValueError):
        return None
