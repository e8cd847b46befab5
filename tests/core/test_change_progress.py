"""What the plan says of a day, how far the work has come, and whether what stands agrees with it."""

from __future__ import annotations

import dataclasses
from datetime import date

import ifcopenshell
import ifcopenshell.guid
import pytest

from bim_verify.core.change.planned import Planned, parse_date, read_planned, reversed_tasks
from bim_verify.core.change.progress import expected_state, group_progress, judge
from bim_verify.core.change.results import ElementChange, GroupProgress, State

DAY = date(2024, 6, 1)
DEMOLISH = Planned("demolish", date(2024, 1, 1), date(2024, 2, 1), "Demolish walls", "task")


@pytest.mark.parametrize(
    ("plan", "day", "found", "state", "progress"),
    [
        (Planned(), None, "CONFIRMED", "CONFIRMED", "on time"),
        (Planned(), None, "DISAPPEARED", "CONFIRMED", "not built"),
        (Planned(), None, "UNKNOWN", "CONFIRMED", "cannot tell"),
        (Planned(), None, "PARTIAL", "CONFIRMED", "not built"),
        (Planned(source="status"), None, "CONFIRMED", "CONFIRMED", "on time"),
        (Planned(source="status"), None, "DISAPPEARED", "CONFIRMED", "early"),
        (Planned(source="status"), None, "PARTIAL", "CONFIRMED", "early"),
        (Planned("build", source="status"), None, "DISAPPEARED", "NEW", "not built"),
        (Planned("build", date(2024, 5, 1), date(2024, 5, 10)), date(2024, 5, 20), "PARTIAL", "NEW", "late"),
        (Planned("build", date(2024, 5, 1), date(2024, 5, 10)), date(2024, 5, 20), "DISAPPEARED", "NEW", "late"),
        (Planned("build", date(2024, 5, 1), date(2024, 5, 10)), date(2024, 5, 20), "CONFIRMED", "NEW", "on time"),
        (Planned("build", date(2024, 6, 1), date(2024, 6, 9)), date(2024, 5, 20), "CONFIRMED", "DISAPPEARED", "early"),
        (Planned("build", date(2024, 6, 1), date(2024, 6, 9)), date(2024, 5, 20), "DISAPPEARED", "DISAPPEARED", "on time"),
        (Planned("demolish", date(2024, 5, 1), date(2024, 5, 2)), DAY, "CONFIRMED", "DISAPPEARED", "should be gone"),
        (Planned("demolish", date(2024, 6, 1), date(2024, 6, 2)), date(2024, 5, 20), "DISAPPEARED", "CONFIRMED", "early"),
        (Planned("build", date(2024, 5, 1), date(2024, 6, 2)), date(2024, 5, 20), "PARTIAL", "PARTIAL", "on time"),
        (Planned("build", date(2024, 5, 1), date(2024, 6, 2)), date(2024, 5, 1), "DISAPPEARED", "PARTIAL", "on time"),
        (Planned("demolish", date(2024, 5, 1), date(2024, 6, 2)), date(2024, 5, 1), "CONFIRMED", "PARTIAL", "on time"),
    ],
)  # fmt: skip
def test_observed_against_planned(plan: Planned, day: date | None, found: State, state: str, progress: str) -> None:
    expected = expected_state(plan, day)
    assert expected == state
    assert judge(plan, expected, found)[0] == progress


def test_dates_are_read_from_tasks() -> None:
    file = ifcopenshell.file(schema="IFC4")
    walls = [file.create_entity("IfcWall", ifcopenshell.guid.new(), Name=n) for n in "abc"]
    time = file.create_entity("IfcTaskTime", ScheduleStart="2024-03-01T08:00:00", ScheduleFinish="2024-03-05T17:00:00")
    parent = file.create_entity("IfcTask", ifcopenshell.guid.new(), Name="Walls", IsMilestone=False, TaskTime=time)
    child = file.create_entity(
        "IfcTask", ifcopenshell.guid.new(), Name="Wall a", IsMilestone=False, PredefinedType="DEMOLITION"
    )
    file.create_entity("IfcRelNests", ifcopenshell.guid.new(), RelatingObject=parent, RelatedObjects=[child])
    file.create_entity(
        "IfcRelAssignsToProcess", ifcopenshell.guid.new(), RelatedObjects=[walls[0]], RelatingProcess=child
    )
    word = file.create_entity("IfcLabel", "DEMOLISH")
    value = file.create_entity("IfcPropertyEnumeratedValue", "Status", EnumerationValues=[word])
    common = file.create_entity("IfcPropertySet", ifcopenshell.guid.new(), Name="Pset_WallCommon", HasProperties=[value])
    file.create_entity(
        "IfcRelDefinesByProperties", ifcopenshell.guid.new(), RelatedObjects=[walls[1]], RelatingPropertyDefinition=common
    )
    a, b, c = read_planned(file, [(w.id(), w.GlobalId) for w in walls])
    assert (a.act, a.start, a.finish, a.task) == ("demolish", date(2024, 3, 1), date(2024, 3, 5), "Wall a")
    assert (b.act, b.source) == ("demolish", "status")
    assert c == Planned()
    assert parse_date("not a date") is None


def an_element(state: State, plan: Planned, day: date | None = DAY, gone: float = 0.0) -> ElementChange:
    expected = expected_state(plan, day)
    progress, agrees = judge(plan, expected, state)
    return ElementChange(
        "g", "IfcWall", "w", "Ground", state, 1.0 - gone, gone, 0.0, 0.0, 1.0, gone, 1.0 - gone, None, expected, agrees,
        progress, "", standing_ratio={"UNKNOWN": None, "PARTIAL": 1.0 - gone}.get(state, float(state != "DISAPPEARED")),
    )


def groups(*rows: tuple[ElementChange, Planned, float], day: date | None = None) -> dict[tuple[str, str], GroupProgress]:
    found = group_progress([r[0] for r in rows], [r[1] for r in rows], [r[2] for r in rows], day)
    return {(g.kind, g.name): g for g in found}


@pytest.mark.parametrize(
    ("state", "gone", "complete"), [("DISAPPEARED", 1.0, 1.0), ("CONFIRMED", 0.0, 0.0), ("PARTIAL", 0.3, 0.3)]
)
def test_demolition_is_complete_when_the_element_is_gone(state: State, gone: float, complete: float) -> None:
    found = groups((an_element(state, DEMOLISH, gone=gone), DEMOLISH, 2.0))
    assert set(found) == {("storey", "Ground"), ("class", "IfcWall"), ("task", "Demolish walls")}
    for group in found.values():
        assert group.complete == pytest.approx(complete)
        assert group.planned == 1.0 and group.not_observed == 0.0 and group.elements == 1


def test_demolition_that_is_to_come_is_no_work_due() -> None:
    early = date(2023, 12, 1)
    group = groups((an_element("CONFIRMED", DEMOLISH, early), DEMOLISH, 1.0))["task", "Demolish walls"]
    assert (group.complete, group.planned) == (0.0, 0.0)
    for day, due in ((1, 0.0), (15, 14 / 31), (31, 30 / 31)):
        now = date(2024, 1, day)
        during = groups((an_element("CONFIRMED", DEMOLISH, now), DEMOLISH, 1.0), day=now)["task", "Demolish walls"]
        assert (during.complete, during.planned) == (0.0, pytest.approx(due))


def test_a_part_that_was_not_seen_is_not_observed() -> None:
    """One face of a wall tells that it stands, and nothing of the rest."""
    seen = dataclasses.replace(an_element("CONFIRMED", Planned()), confirmed_ratio=0.3, unknown_ratio=0.7)
    group = groups((seen, Planned(), 3.0), (an_element("UNKNOWN", Planned()), Planned(), 1.0))["class", "IfcWall"]
    assert group.complete == 1.0 and group.not_observed == pytest.approx((0.7 * 3.0 + 1.0) / 4.0)


def test_work_is_weighed_by_volume_and_what_was_not_observed_stands_beside() -> None:
    build = Planned("build", date(2024, 1, 1), date(2024, 2, 1), "Build", "task")
    later = Planned("build", date(2025, 1, 1), date(2025, 2, 1), "Later", "task")
    scaffold = Planned(source="status", temporary=True)
    found = groups(
        (an_element("CONFIRMED", build), build, 3.0),
        (an_element("DISAPPEARED", build), build, 1.0),
        (an_element("UNKNOWN", build), build, 4.0),
        (an_element("DISAPPEARED", later), later, 4.0),
        (an_element("DISAPPEARED", DEMOLISH), DEMOLISH, 2.0),
        (an_element("DISAPPEARED", scaffold), scaffold, 9.0),
    )
    task = found["task", "Build"]
    assert (task.complete, task.planned, task.not_observed) == (0.75, 1.0, 0.5)
    assert (found["task", "Later"].complete, found["task", "Later"].planned) == (0.0, 0.0)
    storey = found["storey", "Ground"]
    assert storey.complete == pytest.approx(5 / 10) and storey.planned == pytest.approx(6 / 10)
    assert storey.not_observed == pytest.approx(4 / 14) and storey.elements == 5


def test_nothing_observed_has_no_share() -> None:
    group = groups((an_element("UNKNOWN", Planned()), Planned(), 1.0))["class", "IfcWall"]
    assert (group.complete, group.planned, group.not_observed) == (None, None, 1.0)


BUILD_2030 = Planned("build", date(2030, 1, 1), date(2030, 2, 1), "Build", "task")
DEMOLISH_2030 = Planned("demolish", date(2030, 1, 1), date(2030, 2, 1), "Demolish", "task")


@pytest.mark.parametrize("plan", [BUILD_2030, DEMOLISH_2030])
@pytest.mark.parametrize("state", ["CONFIRMED", "DISAPPEARED", "PARTIAL"])
def test_dates_tell_nothing_without_a_day(plan: Planned, state: State) -> None:
    now = plan.on(None)
    found = an_element(state, now, None)
    assert (found.expected, found.progress, found.agrees) == ("UNKNOWN", "cannot tell", None)
    assert groups((found, now, 1.0))["task", plan.task].planned is None


def test_without_a_day_the_status_counts() -> None:
    stated = Planned("demolish", source="status")
    now = dataclasses.replace(DEMOLISH_2030, stages=(DEMOLISH_2030,), stated=stated).on(None)
    assert now == stated
    assert judge(now, expected_state(now, None), "CONFIRMED") == ("should be gone", False)


class Schedule:
    """A file with tasks."""

    def __init__(self) -> None:
        self.file = ifcopenshell.file(schema="IFC4")

    def add(self, kind: str) -> ifcopenshell.entity_instance:
        return self.file.create_entity(kind, ifcopenshell.guid.new())

    def task(
        self, name: str, *products: ifcopenshell.entity_instance, kind: str = "CONSTRUCTION", start: str | None = None,
        finish: str | None = None, duration: str | None = None,
    ) -> ifcopenshell.entity_instance:
        time = self.file.create_entity(
            "IfcTaskTime", ScheduleStart=start, ScheduleFinish=finish, ScheduleDuration=duration
        )
        task = self.file.create_entity(
            "IfcTask", ifcopenshell.guid.new(), Name=name, IsMilestone=False, PredefinedType=kind, TaskTime=time
        )
        for product in products:
            self.file.create_entity(
                "IfcRelAssignsToProcess", ifcopenshell.guid.new(), RelatedObjects=[product], RelatingProcess=task
            )
        return task

    def status(self, product: ifcopenshell.entity_instance, word: str) -> None:
        value = self.file.create_entity(
            "IfcPropertyEnumeratedValue", "Status", EnumerationValues=[self.file.create_entity("IfcLabel", word)]
        )
        self.properties(product, "Pset_WallCommon", value)

    def phases(self, product: ifcopenshell.entity_instance, name: str, phases: dict[str, str]) -> None:
        self.properties(product, name, *(
            self.file.create_entity("IfcPropertySingleValue", key, NominalValue=self.file.create_entity("IfcLabel", value))
            for key, value in phases.items()
        ))

    def properties(
        self, product: ifcopenshell.entity_instance, name: str, *values: ifcopenshell.entity_instance
    ) -> None:
        found = self.file.create_entity("IfcPropertySet", ifcopenshell.guid.new(), Name=name, HasProperties=list(values))
        self.file.create_entity(
            "IfcRelDefinesByProperties", ifcopenshell.guid.new(), RelatedObjects=[product],
            RelatingPropertyDefinition=found,
        )

    def aggregate(self, whole: ifcopenshell.entity_instance, part: ifcopenshell.entity_instance) -> None:
        self.file.create_entity("IfcRelAggregates", ifcopenshell.guid.new(), RelatingObject=whole, RelatedObjects=[part])

    def plan(self, product: ifcopenshell.entity_instance) -> Planned:
        return read_planned(self.file, [(product.id(), product.GlobalId)])[0]


def test_a_task_time_without_dates_gives_way_to_the_task_above() -> None:
    schedule = Schedule()
    wall = schedule.add("IfcWall")
    above = schedule.task("Above", start="2024-03-01", finish="2024-03-05")
    child = schedule.task("Child", wall, duration="P3D")
    schedule.file.create_entity("IfcRelNests", ifcopenshell.guid.new(), RelatingObject=above, RelatedObjects=[child])
    plan = schedule.plan(wall)
    assert (plan.task, plan.start, plan.finish) == ("Child", date(2024, 3, 1), date(2024, 3, 5))


def test_a_task_that_ends_before_it_begins_is_named_once() -> None:
    schedule = Schedule()
    walls = [schedule.add("IfcWall") for _ in range(2)]
    schedule.task("Walls", *walls, start="2024-05-09", finish="2024-05-05")
    schedule.task("Doors", walls[0], start="2024-06-01", finish="2024-06-01")
    assert list(reversed_tasks(schedule.file)) == [
        "The task Walls ends on 2024-05-05, before it begins on 2024-05-09: one of its dates is wrong."
    ]


def test_an_element_that_is_built_and_later_demolished() -> None:
    schedule = Schedule()
    wall = schedule.add("IfcWall")
    schedule.task("Remove", wall, kind="DEMOLITION", start="2025-05-01", finish="2025-05-05")
    schedule.task("Formwork", wall, start="2024-05-01", finish="2024-05-05")
    schedule.task("Concrete", wall, start="2024-05-08", finish="2024-05-12")
    plan = schedule.plan(wall)
    expected = {
        day: expected_state(plan.on(day), day)
        for day in (
            date(2024, 4, 30), date(2024, 5, 2), date(2024, 5, 6), date(2024, 5, 12), date(2025, 4, 30), date(2025, 5, 2),
            date(2025, 5, 5),
        )
    }
    assert list(expected.values()) == ["DISAPPEARED", "PARTIAL", "PARTIAL", "NEW", "NEW", "PARTIAL", "DISAPPEARED"]
    assert plan.on(date(2024, 4, 30)).act == "build" and plan.on(date(2025, 5, 2)).task == "Remove"
    assert expected_state(plan.on(None), None) == "UNKNOWN"


def test_status_is_kept_for_scans_without_a_day() -> None:
    schedule = Schedule()
    wall = schedule.add("IfcWall")
    schedule.task("Remove", wall, kind="DEMOLITION", start="2030-05-01")
    schedule.status(wall, "EXISTING")
    plan = schedule.plan(wall)
    assert plan.on(None).source == "status" and expected_state(plan.on(None), None) == "CONFIRMED"
    assert plan.on(DAY).source == "task" and plan.on(DAY).act == "demolish"


def test_tasks_of_upkeep_say_nothing_of_when_an_element_stands() -> None:
    schedule = Schedule()
    wall, other = schedule.add("IfcWall"), schedule.add("IfcWall")
    schedule.task("Repaint", wall, other, kind="MAINTENANCE", start="2030-01-01", finish="2030-02-01")
    schedule.task("Inspect", wall, kind="ATTENDANCE", start="2024-07-01")
    schedule.status(wall, "EXISTING")
    assert schedule.plan(wall).source == "status" and schedule.plan(other) == Planned()
    assert judge(schedule.plan(wall), expected_state(schedule.plan(wall), DAY), "CONFIRMED") == ("on time", True)


@pytest.mark.parametrize(
    ("schema", "kind", "own", "act"),
    [
        ("IFC4", "USERDEFINED", "Maintenance", None),
        ("IFC2X3", None, "MAINTENANCE", None),
        ("IFC4", "USERDEFINED", "Removal of formwork", None),
        ("IFC4", "CONSTRUCTION", "Removal of formwork", "build"),
        ("IFC4", "NOTDEFINED", "demolition", "demolish"),
        ("IFC2X3", None, "Dismantle", "demolish"),
        ("IFC4", "USERDEFINED", "Masonry", "build"),
    ],
)
def test_what_a_task_does_in_its_own_words(schema: str, kind: str | None, own: str, act: str | None) -> None:
    """A task that only mentions a demolition says nothing of its products."""
    schedule = Schedule()
    schedule.file = ifcopenshell.file(schema=schema)
    wall, task = schedule.add("IfcWall"), schedule.add("IfcTask")
    task.IsMilestone, task.ObjectType, task.Name = False, own, "Work"
    if kind:
        task.PredefinedType = kind
    relation = schedule.add("IfcRelAssignsToProcess")
    relation.RelatedObjects, relation.RelatingProcess = [wall], task
    plan = schedule.plan(wall)
    assert (plan.act or None, plan.source or None) == (act, act and "task")


@pytest.mark.parametrize(
    ("name", "phases", "act"),
    [
        ("Phasing", {"Phase Created": "New Construction", "Phase Demolished": "None"}, "build"),
        ("Phasing", {"Phase Created": "Existing", "Phase Demolished": "Not demolished"}, ""),
        ("Phasing", {"Phase Created": "Existing", "Phase Demolished": "2"}, "demolish"),
        ("Phasing", {"Phase Created": "Existing (renewed facade)"}, ""),
        ("Phasen", {"Phase erstellt": "Bestand", "Phase abgebrochen": "Neubau"}, "demolish"),
        ("Phasen", {"Phase erstellt": "Neubau", "Phase abgebrochen": "Keine"}, "build"),
        ("Phases", {"Phase de création": "Existant", "Phase de démolition": "Nouvelle construction"}, "demolish"),
        ("Fasering", {"Fase gebouwd": "Bestaand", "Fase gesloopt": "Nieuwbouw"}, "demolish"),
        ("Fasering", {"Fase gebouwd": "Nieuwbouw", "Fase gesloopt": "Geen"}, "build"),
        ("Vaiheet", {"Luotu": "Uusi"}, ""),
        ("RenovationAndPhasing", {"Renovation Status": "To be demolished"}, "demolish"),
        ("Bauphase", {"Erstellt": "Neubau"}, "build"),
        ("Bouwfase", {"Gebouwd": "Nieuw"}, "build"),
        ("Emphasis", {"Colour": "new blue"}, ""),
        ("Emphase", {"Couleur": "nouveau bleu"}, ""),
        ("Phasing", {"Phase Created": "New Construction", "Phase Demolished": "<varies>"}, "build"),
        ("Phasing", {"Phase Demolished": " <varies> "}, ""),
    ],
)  # fmt: skip
def test_phases_in_the_language_of_the_program_that_wrote_them(name: str, phases: dict[str, str], act: str) -> None:
    schedule = Schedule()
    wall = schedule.add("IfcWall")
    schedule.phases(wall, name, phases)
    assert schedule.plan(wall).act == act


@pytest.mark.parametrize(("word", "act"), [("DEMOLISH", "demolish"), ("EXISTING", ""), (None, "build")])
def test_a_task_without_dates_gives_way_to_the_status(word: str | None, act: str) -> None:
    schedule = Schedule()
    wall = schedule.add("IfcWall")
    schedule.task("Work", wall)
    if word:
        schedule.status(wall, word)
    assert (schedule.plan(wall).act, schedule.plan(wall).task) == (act, "Work")


def test_a_task_on_a_whole_reaches_its_parts() -> None:
    schedule = Schedule()
    stair, flight, step, storey = (
        schedule.add(kind) for kind in ("IfcStair", "IfcStairFlight", "IfcBuildingElementPart", "IfcBuildingStorey")
    )
    schedule.aggregate(storey, stair)
    schedule.aggregate(stair, flight)
    schedule.aggregate(flight, step)
    schedule.task("Storey", storey, start="2020-01-01")
    schedule.task("Stair", stair, start="2024-05-01")
    assert [schedule.plan(e).task for e in (stair, flight, step)] == ["Stair"] * 3
    schedule.task("Step", step, start="2024-06-01")
    assert [schedule.plan(e).task for e in (flight, step)] == ["Stair", "Step"]
