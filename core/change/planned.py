"""What should stand at a date: from tasks, from the phase, or from the status in the element's common property set."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, datetime
from typing import Any, Literal

Act = Literal["build", "demolish", ""]
DEMOLITION = ("DEMOLITION", "REMOVAL", "DISMANTLE", "DISPOSAL")
STATUS_ACT: dict[str, Act] = {"NEW": "build", "EXISTING": "", "DEMOLISH": "demolish", "TEMPORARY": ""}
PHASES_GONE = ("demol", "abbruch", "sloop", "removed")
PHASES_NEW = ("new", "neubau", "nieuw")


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

    @property
    def dated(self) -> bool:
        return self.start is not None or self.finish is not None


def read_planned(file: Any, elements: list[tuple[int, str]]) -> tuple[Planned, ...]:
    """The plan of elements (STEP id, GlobalId) of an open IFC file: tasks go before phases, phases before the status."""
    tasks = _tasks(file)
    return tuple(_planned(file, step_id, global_id, tasks) for step_id, global_id in elements)


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


def _planned(file: Any, step_id: int, global_id: str, tasks: dict[int, list[Planned]]) -> Planned:
    import ifcopenshell.util.element as util

    if found := tasks.get(step_id):
        # of several tasks the last to begin that is dated decides; a demolition comes after the building
        return max(found, key=lambda p: (p.start or date.min, p.act == "demolish"))
    try:
        product = file.by_id(step_id)
    except RuntimeError:
        return Planned()
    sets = util.get_psets(product, psets_only=True)
    for name, properties in sets.items():
        if "phas" in name.lower():
            text = {k.lower(): str(v).lower() for k, v in properties.items() if v}
            gone = next((v for k, v in text.items() if "demol" in k and v not in ("none", "keine")), "")
            if gone:
                return Planned("demolish", source="phase")
            made = " ".join(v for k, v in text.items() if "demol" not in k)
            if any(word in made for word in PHASES_GONE):
                return Planned("demolish", source="phase")
            if any(word in made for word in PHASES_NEW):
                return Planned("build", source="phase")
    for name, properties in sets.items():
        if name.startswith("Pset_") and name.endswith("Common") and properties.get("Status"):
            value = properties["Status"]
            words = {str(v).upper() for v in (value if isinstance(value, (list, tuple)) else [value])}
            for word in ("DEMOLISH", "NEW", "TEMPORARY", "EXISTING"):
                if word in words:
                    return Planned(STATUS_ACT[word], source="status", temporary=word == "TEMPORARY")
    return Planned()


def _tasks(file: Any) -> dict[int, list[Planned]]:
    """STEP id of a product -> its tasks."""
    found: dict[int, list[Planned]] = {}
    for relation in file.by_type("IfcRelAssignsToProcess"):
        process = relation.RelatingProcess
        if process is not None and process.is_a("IfcTask"):
            plan = _task(process)
            for product in relation.RelatedObjects or ():
                if product.is_a("IfcProduct"):
                    found.setdefault(product.id(), []).append(plan)
    for relation in file.by_type("IfcRelAssignsToProduct"):
        product = relation.RelatingProduct
        for process in relation.RelatedObjects or ():
            if process.is_a("IfcTask") and product is not None and product.is_a("IfcProduct"):
                found.setdefault(product.id(), []).append(_task(process))
    return found


def _task(task: Any) -> Planned:
    start, finish = _dates(task)
    kind = f"{getattr(task, 'PredefinedType', '') or ''} {task.ObjectType or ''}".upper()
    act: Act = "demolish" if any(word in kind for word in DEMOLITION) else "build"
    return Planned(act, start, finish, task.Name or task.GlobalId, "task")


def _dates(task: Any, depth: int = 0) -> tuple[date | None, date | None]:
    """Start and finish of a task, or of the nearest task above it that has them."""
    time = getattr(task, "TaskTime", None)
    if time is not None:
        return parse_date(time.ScheduleStart), parse_date(time.ScheduleFinish)
    for relation in getattr(task, "HasAssignments", None) or ():
        control = getattr(relation, "TimeForTask", None)
        if control is not None:
            return _old_date(control.ScheduleStart), _old_date(control.ScheduleFinish)
    for relation in (*(getattr(task, "Nests", None) or ()), *(getattr(task, "Decomposes", None) or ())):
        above = relation.RelatingObject
        if above is not None and above.is_a("IfcTask") and depth < 50:
            return _dates(above, depth + 1)
    return None, None


def _old_date(value: Any) -> date | None:
    """A date of IFC2X3, which is an entity."""
    if value is None or isinstance(value, str):
        return parse_date(value)
    day = getattr(value, "DateComponent", value)
    try:
        return date(day.YearComponent, day.MonthComponent, day.DayComponent)
    except (AttributeError, TypeError, ValueError):
        return None
