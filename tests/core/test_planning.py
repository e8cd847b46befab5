"""Planning: the covering problem against its optimum, limits of views, plans that are kept when simulated, files."""

from __future__ import annotations

import csv
import dataclasses
import itertools
import json
import math
from pathlib import Path

import ifcopenshell
import numpy as np
import pytest

from bim_verify.core.errors import BimVerifyError
from bim_verify.core.jobs import plan, verify
from bim_verify.core.options import VerifyOptions
from bim_verify.core.planning.cover import make_problem, shared_enough
from bim_verify.core.planning.goals import set_goals
from bim_verify.core.planning.heuristics import greedy, improve
from bim_verify.core.planning.options import PlanOptions
from bim_verify.core.planning.outputs import OBJECT_TYPE, write_plan_csv, write_plan_ifc, write_plan_json
from bim_verify.core.planning.proof import prove
from bim_verify.core.planning.report import write_plan_report
from bim_verify.core.planning.second_look import SecondLook, Views
from bim_verify.core.planning.sentences import plan_sentence
from bim_verify.core.planning.strips import face_widths
from bim_verify.core.planning.targets import Targets, pick_targets
from bim_verify.core.planning.visibility import Requirement, measured_well
from bim_verify.core.quality import prediction
from bim_verify.core.scans.campaign import Station
from bim_verify.core.simulation.box_building import ArraySource, box, building_model
from bim_verify.core.simulation.scanner import PRESETS, scan_station
from bim_verify.core.simulation.scene import build_scene
from bim_verify.core.simulation.stations_file import read_stations

from .templates import check_templates

ROOM = [
    box("floor", (-0.2, -0.2, -0.2), (6.2, 5.2, 0.0)), box("ceiling", (-0.2, -0.2, 2.8), (6.2, 5.2, 3.0)),
    box("south", (0.0, -0.2, 0.0), (6.0, 0.0, 2.8)), box("north", (0.0, 5.0, 0.0), (6.0, 5.2, 2.8)),
    box("west", (-0.2, -0.2, 0.0), (0.0, 5.2, 2.8)), box("east", (6.0, -0.2, 0.0), (6.2, 5.2, 2.8)),
    box("screen", (3.0, 0.0, 0.0), (3.1, 3.0, 2.8)),
]
SCANNER = dataclasses.replace(PRESETS["medium"], angular_step=math.radians(0.5))
OPTIONS = PlanOptions(cache=False, candidates=80, solve_seconds=10.0)


@pytest.fixture(autouse=True)
def one_table(monkeypatch: pytest.MonkeyPatch) -> None:
    """Expected errors of all sizes from one small table: making all of them takes a minute."""
    table = prediction.ErrorTable(
        np.full((len(prediction.SPACINGS_M), len(prediction.NOISES_M)), 0.001),
        np.full((len(prediction.SPACINGS_M), len(prediction.NOISES_M)), 0.002),
    )
    monkeypatch.setattr(prediction, "make_table", lambda width, height: table)
    monkeypatch.setattr(prediction, "_made", {})


def random_problem(seed: int):  # type: ignore[no-untyped-def]
    random = np.random.default_rng(seed)
    sees = random.random((9, 40)) < 0.3
    area, element = random.uniform(0.5, 2.0, 40), random.integers(0, 3, 40).astype(np.int32)
    reach = np.bincount(element[sees.any(axis=0)], weights=area[sees.any(axis=0)], minlength=3)
    return make_problem(sees, area, element, 0.8 * reach, (), shared_enough(sees, area, 0.2))


@pytest.mark.parametrize("seed", range(6))
def test_the_exact_solution_is_the_smallest_linked_one(seed: int) -> None:
    problem = random_problem(seed)
    smallest = next(
        (k for k in range(1, 10) if any(problem.satisfied(c) for c in itertools.combinations(range(9), k))), None
    )
    start = improve(problem, greedy(problem))
    proof = prove(problem, len(start), 20.0)
    assert smallest is not None
    assert problem.satisfied(start) and len(start) <= smallest + 1
    assert proof.least <= smallest
    if proof.chosen is not None:
        assert problem.satisfied(proof.chosen) and len(proof.chosen) == smallest == proof.least


def test_places_that_nothing_links_are_sites_of_their_own() -> None:
    """Two rooms behind closed doors: places of one are linked to each other, never to those of the other."""
    sees = np.zeros((6, 8), np.bool_)
    sees[0, :2] = sees[1, 2:4] = sees[2, 1:3] = True
    sees[3, 4:6] = sees[4, 6:8] = sees[5, 5:7] = True
    linked = np.eye(6, dtype=np.bool_)
    for a, b in ((0, 2), (1, 2), (3, 5), (4, 5)):
        linked[a, b] = linked[b, a] = True
    element = np.repeat([0, 1], 4).astype(np.int32)
    problem = make_problem(sees, np.ones(8), element, np.array([4.0, 4.0]), (), linked)
    everything = [0, 1, 2, 3, 4, 5]
    assert problem.satisfied(everything) and len(problem.parts(everything)) == 2
    assert not problem.satisfied([0, 1, 3, 4, 5]) and problem.loose([0, 1, 3, 4, 5]) == 1
    assert sorted(improve(problem, greedy(problem))) == everything
    proof = prove(problem, 6, 20.0)
    assert proof.optimal and proof.least == 6 and sorted(proof.chosen or []) == everything


def test_two_places_are_replaced_by_one_that_covers_what_they_alone_do() -> None:
    sees = np.array([[1, 0, 1, 0, 0], [0, 1, 0, 1, 0], [1, 1, 1, 1, 0], [0, 0, 0, 0, 1]], dtype=np.bool_)
    element = np.array([0, 0, 1, 1, 2], np.int32)
    problem = make_problem(sees, np.ones(5), element, np.array([2.0, 2.0, 1.0]), (), np.ones((4, 4), np.bool_))
    assert sorted(improve(problem, [0, 1, 3])) == [2, 3]


def test_nothing_is_asked_of_elements_that_cannot_get_a_level() -> None:
    """Ten points of 1 m2 on each of three elements, of which the place sees one, three and eight."""
    element = np.repeat(np.arange(3, dtype=np.int32), 10)
    targets = Targets(
        np.arange(30), np.zeros((30, 3)), np.zeros((30, 3)), np.ones(30), element, np.zeros((30, 3)), np.full(30, np.inf)
    )
    sees = np.concatenate([np.arange(10) < k for k in (1, 3, 8)])[None]
    goals = set_goals(0.5, 3, targets, sees, targets, sees)
    assert goals.reachable == pytest.approx([0.1, 0.3, 0.8])
    assert goals.target == pytest.approx([0.0, 0.2, 0.4])
    assert (goals.views.need[0], goals.look.target[0]) == (0.0, 0.0)


def test_known_places_cost_nothing_and_stay() -> None:
    problem = random_problem(1)
    known = dataclasses.replace(problem, known=np.array([0, 1]))
    chosen = improve(known, greedy(known))
    assert {0, 1} <= set(chosen)
    assert len(chosen) - 2 <= len(improve(problem, greedy(problem)))


def test_views_are_limited_by_range_incidence_spacing_and_what_stands_between() -> None:
    scene = build_scene(building_model(ROOM))
    point = np.array([[0.0, 2.0, 1.5], [5.999, 2.0, 1.5], [1.5, 0.0, 1.5], [0.0, 4.9, 1.5]])
    normal = np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0], [1.0, 0, 0]])
    targets = Targets(
        np.arange(4), point, normal, np.ones(4), np.arange(4, dtype=np.int32), np.zeros((4, 3)), np.full(4, np.inf)
    )
    station = np.array([2.0, 1.0, 1.5])
    free = Requirement(1.0, 1.0, math.radians(89.0), 50.0, 0.0)

    def seen(need: Requirement) -> list[bool]:
        return list(measured_well(scene, station, targets, SCANNER, need)[0])

    assert seen(free) == [True, False, True, True]
    assert seen(dataclasses.replace(free, max_incidence=math.radians(60.0))) == [True, False, True, False]
    assert seen(dataclasses.replace(free, range_max=2.0)) == [False, False, True, False]
    assert seen(dataclasses.replace(free, spacing=0.015)) == [False, False, True, False]
    assert seen(dataclasses.replace(free, bound=0.001)) == [False] * 4


def test_a_slender_face_is_measured_only_where_a_beam_as_a_whole_must_fall_on_it() -> None:
    model = building_model([box("bar", (0.0, 0.0, 0.0), (0.2, 0.03, 2.0))])
    point = np.array([[0.2, 0.01, 1.0], [0.05, 0.03, 1.0]]) - model.origin
    normal = np.array([[1.0, 0, 0], [0.0, 1, 0]])
    element = np.zeros(2, np.int32)
    across, width = face_widths(model, point, normal, element)
    assert width == pytest.approx([0.03, 0.2], abs=1e-6)
    assert np.abs(across) == pytest.approx(np.array([[0.0, 1, 0], [1.0, 0, 0]]), abs=1e-6)
    targets = Targets(np.arange(2), point, normal, np.ones(2), element, across, width)
    scene, free = build_scene(model), Requirement(1.0, 1.0, math.radians(89.0), 50.0, 0.0)
    scanner = dataclasses.replace(SCANNER, angular_step=0.01, beam_exit_diameter=0.004, beam_divergence=0.0)

    def seen(*position: float) -> bool:
        return bool(measured_well(scene, np.array(position) - model.origin, targets, scanner, free)[0][0])

    assert seen(2.7, 0.01, 1.0)  # 25 mm between beams, 4 mm of beam, 30 mm of bar
    assert not seen(2.9, 0.01, 1.0)
    assert not seen(2.0, 1.81, 1.0)  # its width is seen under 45 degrees
    assert seen(2.0, 0.01, 2.8)  # along it that does not matter


def test_a_plan_is_kept_when_it_is_simulated_and_verified(tmp_path: Path) -> None:
    model = building_model(ROOM, origin=(100.0, 200.0, 5.0))
    result = plan(model, dataclasses.replace(OPTIONS, classes=("IfcBuildingElementProxy",)))
    assert result.least <= len(result.stations) <= result.heuristic
    write_plan_json(tmp_path / "stations.json", result)
    stations = read_stations(tmp_path / "stations.json")
    assert stations.scanner == result.scanner
    assert [s.name for s in stations.stations] == [s.name for s in result.stations]
    scene, offsets, setups = build_scene(model), [], []
    for k, s in enumerate(stations.stations):
        returns = scan_station(scene, s.position - model.origin, np.eye(3), SCANNER, k)
        offsets.append(returns.offset)
        setups.append(Station(s.name, s.position))
    verified = verify(
        model, ArraySource(tuple(setups), tuple(offsets)), VerifyOptions(sigma=0.0015, sample_spacing=0.1, cache=False)
    )
    asked = [(f, v) for f, v in zip(result.forecasts, verified.verdicts, strict=True) if f.target > 0]
    assert len(asked) == len(ROOM)
    for forecast, verdict in asked:
        assert forecast.coverage >= forecast.target - 0.05
        assert verdict.coverage >= forecast.target
        assert verdict.belief_occupied == pytest.approx(forecast.belief, abs=0.1)


def second_look() -> SecondLook:
    """Four points of 1 m2 on one element; each of three places sees another one of them."""
    return SecondLook(np.eye(3, 4, dtype=np.bool_), np.ones(4), np.zeros(4, np.int32), np.array([2.5]), np.array([3.5]))


def test_what_falls_short_on_other_points_joins_the_problem_as_far_as_it_can_be_seen() -> None:
    look = second_look()
    assert look.lacking([0, 1]).all()
    assert not look.lacking([0, 1, 2]).any()
    first = Views(np.ones((3, 2), np.bool_), np.full(2, 2.0), np.zeros(2, np.int32), np.array([3.5]))
    linked = np.ones((3, 3), np.bool_)
    problem = make_problem(first.sees, first.area, first.element, first.need, (), linked)
    chosen = improve(problem, greedy(problem))
    assert len(chosen) == 1 and look.lacking(chosen).all()
    both = look.join(first, np.array([True]))
    assert both.need == pytest.approx([3.5, 3.0])  # the fourth point is seen from nowhere
    problem = make_problem(both.sees, both.area, both.element, both.need, (), linked)
    chosen = improve(problem, greedy(problem))
    assert sorted(chosen) == [0, 1, 2] and not look.lacking(chosen).any()


def test_a_plan_reaches_its_targets_on_points_that_it_was_not_made_on() -> None:
    random = np.random.default_rng(3)
    boxes = list(ROOM)
    for k in range(6):
        x, y = random.uniform([0.8, 0.8], [5.0, 4.2])
        boxes.append(box(f"box {k}", (x, y, 0.0), (x + 0.4, y + 0.4, random.uniform(0.6, 2.0))))
    result = plan(building_model(boxes), OPTIONS)
    for f in result.forecasts:
        assert f.coverage >= f.target - 1e-6, f.name


def test_a_plan_adds_to_a_campaign_what_it_lacks() -> None:
    model = building_model(ROOM)
    scene = build_scene(model)
    position = np.array([1.5, 2.5, 1.5])
    scanner = dataclasses.replace(SCANNER, angular_step=math.radians(0.4))
    source = ArraySource((Station("first", position),), (scan_station(scene, position, np.eye(3), scanner, 1).offset,))
    elements = tuple(e.global_id for e in model.elements if e.name in ("south", "east", "screen"))
    alone = plan(model, dataclasses.replace(OPTIONS, elements=elements))
    more = plan(model, dataclasses.replace(OPTIONS, elements=elements, spacing=0.06), scans=source)
    assert more.existing == ("first",)
    assert 0 < len(more.stations) <= len(alone.stations)
    assert any("AO" in s.actions for s in more.stations)
    found, gained = {f.name: f for f in more.forecasts}, [f for f in more.asked if f.reached_by > 0]
    assert gained and all(f.coverage >= f.target > f.before for f in gained)
    assert found["screen"] in gained  # the campaign saw one side of it
    assert sum(len(more.completed(k)) for k in range(len(more.stations) + 1)) == len(more.asked)
    assert all((f.loa or 0) >= 30 and f.spacing for f in more.asked)  # also of what the campaign alone measures
    sentence = plan_sentence(more)
    assert f"{len(more.stations)} more set-up" in sentence and "LOA30" in sentence
    assert all(f"{f.ifc_class} {f.name}" in sentence for f in gained)


def test_files_of_a_plan(tmp_path: Path) -> None:
    from bim_verify.core.simulation.house import write_demo_house

    write_demo_house(tmp_path / "house.ifc")
    options = dataclasses.replace(OPTIONS, classes=("IfcColumn",), solve_seconds=2.0, candidates=60)
    result = plan(tmp_path / "house.ifc", options)
    write_plan_csv(tmp_path / "plan.csv", result)
    lines = list(csv.reader((tmp_path / "plan.csv").read_text(encoding="utf-8-sig").splitlines()))
    assert len(lines) == 1 + len(result.stations)
    write_plan_ifc(tmp_path / "house.ifc", result, tmp_path / "plan.ifc")
    file = ifcopenshell.open(str(tmp_path / "plan.ifc"))
    marks = [a for a in file.by_type("IfcAnnotation") if a.ObjectType == OBJECT_TYPE]
    assert len(marks) == len(result.stations)
    check_templates(file, "BimVerify_Station")
    place = marks[0].ObjectPlacement.RelativePlacement.Location.Coordinates
    assert np.array(place) * result.model.length_unit_m == pytest.approx(result.stations[0].position)
    page = write_plan_report(tmp_path / "report", result).read_text(encoding="utf-8")
    assert "<svg" in page and "http" not in page.replace("http-equiv", "")
    write_plan_json(tmp_path / "plan.json", result)
    assert json.loads((tmp_path / "plan.json").read_text())["summary"]["stations"] == len(result.stations)


def test_no_such_elements_is_an_error() -> None:
    with pytest.raises(BimVerifyError, match="none of the elements asked for"):
        plan(building_model(ROOM), dataclasses.replace(OPTIONS, classes=("IfcPump",)))


def test_targets_stand_for_the_whole_exposed_surface() -> None:
    from bim_verify.core.model.sample_surface import sample_surface

    model = building_model(ROOM)
    samples = sample_surface(model, 0.1)
    targets = pick_targets(model, samples, np.ones(len(ROOM), np.bool_))
    exposed = np.bincount(samples.element, weights=samples.area * samples.exposed)
    assert np.bincount(targets.element, weights=targets.area) == pytest.approx(exposed)
