"""What changed, on a small house of boxes scanned as it was built."""

from __future__ import annotations

import base64
import dataclasses
import io
import tracemalloc
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from bim_verify.core.change import solids
from bim_verify.core.change.amounts import Amount
from bim_verify.core.change.decide import Decision, element_state, partly_gone, ratios
from bim_verify.core.change.look import ElementSight
from bim_verify.core.change.results import STATES, ChangeResult, ElementChange
from bim_verify.core.change.solids import mesh_volumes, voxelise
from bim_verify.core.commands.change import summary_lines
from bim_verify.core.errors import BimVerifyError
from bim_verify.core.evidence.overlap import overlap
from bim_verify.core.evidence.own_evidence import clearly_inside, clearly_outside, shows_gone, shows_standing
from bim_verify.core.evidence.shared_surface import find_shared
from bim_verify.core.evidence.sightings import Sightings
from bim_verify.core.jobs import change
from bim_verify.core.model.elements import BuildingModel
from bim_verify.core.model.on_element import ElementSurfaces
from bim_verify.core.model.sample_surface import sample_surface
from bim_verify.core.occupancy.grid import VoxelGrid
from bim_verify.core.options import ChangeOptions
from bim_verify.core.report.change_files import change_to_json, changes_csv, write_voxels
from bim_verify.core.report.change_page import render_change_page
from bim_verify.core.report.change_views import voxel_views
from bim_verify.core.report.html import format_percent
from bim_verify.core.report.remaining import remaining_mesh
from bim_verify.core.report.remaining_view import remaining_views
from bim_verify.core.scans.campaign import Station
from bim_verify.core.sensing.loa import supported_level
from bim_verify.core.simulation.box_building import ArraySource, box, building_model
from bim_verify.core.simulation.scene import Prop

from .verify_data import PLAN, REMOVED, built, house, scan, shifted

OPTIONS = ChangeOptions(voxel=0.04, sigma=0.0013, sample_spacing=0.1, memory_gb=1.0)
HALF = {"partition": (((6.0, 0.0, 0.0), (6.2, 2.0, 3.0)),)}
CRATE = Prop("crate", "box", (9.0, 0.8, 0.3), (0.5, 0.4, 0.6))


def by_name(result: ChangeResult) -> dict[str, ElementChange]:
    return {e.name: e for e in result.elements}


@cache
def before() -> Any:
    return scan(built({"post": REMOVED, "cupboard": REMOVED}), seed=3)


@cache
def after() -> Any:
    return scan(
        built({"column": REMOVED, "plate": shifted(z=0.2), "east": shifted(x=0.08)}, (CRATE,), HALF), seed=4
    )


def dated(source: Any, day: str) -> Any:
    return dataclasses.replace(source, stations=tuple(dataclasses.replace(s, acquired=day) for s in source.stations))


@cache
def against_model() -> ChangeResult:
    return change(house(), [after()], None, OPTIONS)


@cache
def against_reference() -> ChangeResult:
    return change(house(), [after()], before(), OPTIONS)


def test_states_against_the_model() -> None:
    found = by_name(against_model())
    states = {name: e.state for name, e in found.items()}
    assert states["column"] == "DISAPPEARED"
    assert states["plate"] == "DISAPPEARED" and found["plate"].moved
    assert states["east"] == "PARTIAL" and found["east"].moved
    assert states["partition"] == "PARTIAL" and not found["partition"].moved
    assert states["buried"] == "UNKNOWN"
    for name in ("floor", "slab", "south", "north", "west", "cupboard", "post", "ceiling"):
        assert states[name] == "CONFIRMED", (name, found[name].reason)


def test_states_against_a_reference_epoch() -> None:
    states = {name: e.state for name, e in by_name(against_reference()).items()}
    assert states["post"] == "NEW" and states["cupboard"] == "NEW"
    assert states["column"] == "DISAPPEARED"
    assert states["partition"] == "PARTIAL"
    assert states["south"] == "CONFIRMED" and states["buried"] == "UNKNOWN"


def test_what_left_its_place_or_lost_a_part_is_not_built_as_planned() -> None:
    again = change(house(), [after()], after(), OPTIONS)  # no change, but the plan is still not met
    assert by_name(again)["partition"].state != "DISAPPEARED"
    for result in (against_model(), against_reference(), again):
        found = by_name(result)
        for name in ("plate", "east", "partition", "column"):
            assert (found[name].progress, found[name].agrees) == ("not built", False), name
        assert (found["south"].progress, found["south"].agrees) == ("on time", True)
        assert (found["buried"].progress, found["buried"].agrees) == ("cannot tell", None)
        kinds = {g.name: g for g in result.groups}
        assert kinds["IfcPlate"].complete == 0.0 and kinds["IfcPlate"].planned == 1.0
        assert 0.7 < kinds["IfcWall"].complete < 0.95


def test_ratios_add_up_and_follow_the_state() -> None:
    for result in (against_model(), against_reference()):
        for e in result.elements:
            total = e.confirmed_ratio + e.disappeared_ratio + e.new_ratio + e.unknown_ratio
            assert total == pytest.approx(1.0, abs=1e-9)
            assert e.disappeared_volume == pytest.approx(e.disappeared_ratio * e.volume)
    assert by_name(against_reference())["post"].new_ratio > 0.8
    assert by_name(against_model())["buried"].unknown_ratio == 1.0


def test_volume_of_a_demolished_part() -> None:
    partition = by_name(against_model())["partition"]
    assert partition.volume == pytest.approx(0.2 * 4.0 * 3.0)
    assert partition.disappeared_volume == pytest.approx(1.2, rel=0.05)
    column = by_name(against_model())["column"]
    assert column.disappeared_volume == pytest.approx(column.volume, rel=0.05)


def test_remaining_shape_is_a_closed_mesh_of_the_remaining_volume() -> None:
    result = against_model()
    row = list(PLAN).index("partition")
    assert result.remaining == (row,)
    vertices, quads = remaining_mesh(result, row)
    corner = vertices[quads]
    cross = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1]) / 2
    volume = np.einsum("ij,ij->i", corner.mean(axis=1), cross).sum() / 3
    assert np.abs(cross.sum(axis=0)).max() < 1e-6
    assert volume == pytest.approx(1.2, rel=0.08)


def test_a_new_object_is_listed_with_place_and_size() -> None:
    new = [c for c in against_model().clusters if c.kind == "NEW" and not c.inside]
    crate = min(new, key=lambda c: float(np.linalg.norm(np.array(c.center) - CRATE.center)))
    assert np.allclose(crate.center, CRATE.center, atol=0.06)
    assert np.allclose(crate.size, CRATE.size, atol=0.13)


def test_what_is_new_or_gone_of_a_planned_element_is_one_group() -> None:
    result = against_reference()
    groups = [(c.element.rstrip("_"), c.kind) for c in result.clusters if c.inside]
    assert len(groups) == len(set(groups))
    assert {("post", "NEW"), ("cupboard", "NEW"), ("column", "DISAPPEARED"), ("partition", "DISAPPEARED")} <= set(groups)
    volume = {c.element.rstrip("_"): c.volume for c in result.clusters if c.inside and c.kind == "DISAPPEARED"}
    for name in ("column", "partition", "plate"):
        assert volume[name] == pytest.approx(by_name(result)[name].disappeared_volume, rel=0.02), name
    beside = [c for c in result.clusters if c.kind == "NEW" and not c.inside]
    said = f"neither in the model nor in the reference: {len(beside)}; the largest holds {beside[0].voxels:,}."
    assert any(said in line for line in summary_lines(result))
    assert any("not in the model: " in line for line in summary_lines(against_model()))


def test_an_object_that_was_there_before_stays() -> None:
    result = change(house(), [after(), after()], None, OPTIONS)
    new = [c for c in result.clusters if c.kind == "NEW"]
    assert new and all(c.persistence == "stays" for c in new)
    assert not any("contradict" in w for w in result.warnings)
    gone = change(house(), [dated(scan(built({})), "2024-05-02"), dated(after(), "2024-04-30")], None, OPTIONS)
    crate = min(
        (c for c in gone.clusters if c.kind == "NEW"),
        key=lambda c: float(np.linalg.norm(np.array(c.center) - CRATE.center)),
    )
    assert crate.persistence == "unknown"
    assert [e.name for e in gone.epochs] == ["epoch 1", "epoch 2"]
    assert (
        "The scans' dates contradict the order given: the epoch 2 (2024-04-30) is older than the epoch 1 (2024-05-02). "
        "Give the earliest epoch first."
    ) in gone.warnings
    assert [(c.epoch, c.against) for c in gone.voxel_counts] == [
        ("epoch 2", "model"), ("epoch 2", "epoch 1"), ("epoch 1", "model")
    ]
    with_model, between, before_that = gone.voxel_counts
    assert before_that.disappeared < min(with_model.disappeared, between.disappeared) and before_that.new < between.new
    assert gone.epochs[0].states[list(PLAN).index("column")] == "CONFIRMED"
    assert gone.epochs[1].states[list(PLAN).index("column")] == "DISAPPEARED"


def test_the_same_epoch_twice_shows_no_change() -> None:
    result = change(house(), [before()], before(), OPTIONS)
    assert {e.state for e in result.elements} <= {"CONFIRMED", "UNKNOWN"}
    assert not ((result.voxels.state == 2) | (result.voxels.state == 3)).any()


def test_nothing_depends_on_threads_or_the_place_of_the_model() -> None:
    far = (500_000.0, 4_000_000.0, 100.0)
    source = scan(built({"column": REMOVED, "plate": shifted(z=0.2), "east": shifted(x=0.08)}, (CRATE,), HALF), seed=4,
                  origin=np.array(far))
    moved = change(house(far), [source], None, dataclasses.replace(OPTIONS, threads=1))
    here = against_model()
    assert [e.state for e in moved.elements] == [e.state for e in here.elements]
    assert moved.voxels.state.shape == pytest.approx(here.voxels.state.shape, rel=1e-3)


def test_nothing_depends_on_tiles() -> None:
    options = dataclasses.replace(OPTIONS, voxel=0.08)
    whole = change(house(), [after()], None, options)
    tiled = change(house(), [after()], None, dataclasses.replace(options, memory_gb=0.01))  # two tiles of each station
    assert whole.edge == tiled.edge == 0.08
    assert whole.elements == tiled.elements and whole.clusters == tiled.clusters
    for part in ("index", "state", "element"):
        assert (getattr(whole.voxels, part) == getattr(tiled.voxels, part)).all()


def with_copy(plan: BuildingModel, row: int) -> BuildingModel:
    """The model with an element of it a second time, as its last one."""
    own = slice(*plan.triangle_start[row : row + 2])
    return dataclasses.replace(
        plan,
        elements=(*plan.elements, dataclasses.replace(plan.elements[row], global_id="again", name="again", step_id=99)),
        triangles=np.concatenate([plan.triangles, plan.triangles[own]]),
        triangle_element=np.append(plan.triangle_element, np.full(own.stop - own.start, len(PLAN), np.int32)),
        closed=np.append(plan.closed, True),
        transparent=np.append(plan.transparent, plan.transparent[own]),
    )


def test_what_is_modelled_twice_is_not_told_apart() -> None:
    plan = house()
    column = list(PLAN).index("column")
    twice = with_copy(plan, column)
    for source, state in ((before(), "UNKNOWN"), (after(), "DISAPPEARED")):
        found = by_name(change(twice, [source], None, OPTIONS))
        assert found["column"].state == found["again"].state == state
        assert found["partition"].state in ("CONFIRMED", "PARTIAL")
        if state == "UNKNOWN":
            assert "again" in found["column"].reason and "column" in found["again"].reason


def with_box(plan: BuildingModel, low: tuple[float, float, float], high: tuple[float, float, float]) -> BuildingModel:
    """The model with one more box, named "added"."""
    box = Prop("", "box", tuple((np.add(low, high) / 2).tolist()), tuple(np.subtract(high, low).tolist())).corners()
    first = len(plan.vertices)
    return dataclasses.replace(
        plan,
        elements=(*plan.elements, dataclasses.replace(plan.elements[0], global_id="added", name="added", step_id=99)),
        vertices=np.concatenate([plan.vertices, box.reshape(-1, 3)]),
        triangles=np.concatenate([plan.triangles, first + np.arange(36, dtype=np.int32).reshape(-1, 3)]),
        triangle_element=np.append(plan.triangle_element, np.full(12, len(PLAN), np.int32)),
        closed=np.append(plan.closed, True),
        transparent=np.append(plan.transparent, np.zeros(12, np.bool_)),
    )


def test_a_board_that_is_gone_is_not_taken_for_the_wall_that_it_touched() -> None:
    low, high = (0.0, 1.0, 0.5), (0.018, 2.2, 1.7)
    model = with_box(house(), low, high)
    board = Prop("board", "box", (0.009, 1.6, 1.1), (0.018, 1.2, 1.2))
    there = by_name(change(model, [scan(built({}, (board,)), seed=5)], None, OPTIONS))
    assert there["added"].state == there["west"].state == "CONFIRMED"
    gone = by_name(change(model, [scan(built({}), seed=5)], None, OPTIONS))
    assert gone["added"].state == "DISAPPEARED" and gone["west"].state == "CONFIRMED", gone["added"].reason


def test_a_few_beams_do_not_tell_whether_a_small_part_stands() -> None:
    model = with_box(house(), (3.0, 2.6, 1.2), (3.02, 2.62, 1.22))
    found = by_name(change(model, [scan(built({}), seed=6)], None, OPTIONS))["added"]
    assert found.state == "UNKNOWN" and "too few" in found.reason, found.reason
    assert not shows_gone(0, 4, 0.5) and shows_gone(0, 5, 0.5) and not shows_gone(3, 5, 0.5)
    assert not shows_standing(2, 0, 0.25) and shows_standing(3, 0, 0.25) and not shows_standing(3, 0, 0.25, tried=36)


def test_beams_beside_the_outline_do_not_pass_through() -> None:
    model = with_box(house(), (3.0, 2.0, 1.2), (3.1, 2.1, 1.3))
    row, surfaces = len(PLAN), ElementSurfaces(model)
    samples = sample_surface(model, 0.02)
    of = int(np.flatnonzero((samples.element == row) & (samples.normal[:, 0] < -0.5))[0])
    station = np.array([[1.0, 2.05, 1.25]])
    for away, passes in ((0.045, True), (0.001, False), (-0.01, False)):  # inside the face's edge, at 2 m
        through = np.array([[3.0, 2.1 - away, 1.25]])
        seen = a_sighting(of, station[0] + 2.0 * (through[0] - station[0]))
        assert clearly_inside(seen, samples, station, surfaces, 0.0)[0] == passes, away


@pytest.mark.parametrize(
    "beside, registration, tells",
    [(0.03, 0.0, True), (0.006, 0.0, True), (0.003, 0.0, False), (0.006, 0.002, False), (-0.01, 0.0, False)],
)
def test_beams_whose_light_may_meet_a_moved_element_do_not_tell_that_it_stays(
    beside: float, registration: float, tells: bool
) -> None:
    """The box slid by 60 mm; at 2 m a beam has a radius of 3.3 mm."""
    model = with_box(house(), (3.0, 2.0, 1.2), (3.1, 2.1, 1.3))
    samples = sample_surface(model, 0.02)
    of = int(np.flatnonzero((samples.element == len(PLAN)) & (samples.normal[:, 0] < -0.5))[0])
    station, shift = np.array([[1.0, 2.05, 1.25]]), np.array([0.0, -0.06, 0.0])
    through = np.array([3.0, 2.04 + beside, 1.25])
    seen = a_sighting(of, station[0] + 2.0 * (through - station[0]))
    assert clearly_outside(seen, samples, station, ElementSurfaces(model), shift, registration)[0] == tells


def a_sighting(sample: int, point: np.ndarray) -> Sightings:
    one = np.ones(1)
    return Sightings(
        sample=np.array([sample], np.int32), station=np.zeros(1, np.int16), deviation=-one, count=np.ones(1, np.int32),
        cosine=one.astype(np.float32), distance=np.full(1, 2.0, np.float32), point=point[None].astype(np.float32),
        glass=np.zeros(1, np.bool_), log_masses=np.zeros((1, 3)), on_face=np.ones(1, np.bool_),
        face_normal=np.zeros((1, 3), np.float32), residual=-one, explained=np.zeros(1, np.bool_),
        photo=np.zeros((1, 0)),
    )


def test_what_edges_hide_counts_like_the_rest_of_an_element() -> None:
    sight = ElementSight("STANDS", 9.0, 0.0, 10.0, (0.0, 0.0, 0.0), "")
    found = Decision("CONFIRMED", "")
    assert ratios(found, Amount(), sight)[0] == pytest.approx(0.9)
    assert ratios(found, Amount(), dataclasses.replace(sight, silent=1.0))[0] == pytest.approx(1.0)


def test_a_part_and_its_whole_are_no_twins() -> None:
    import ifcopenshell
    import ifcopenshell.guid

    from bim_verify.core.model.parts import read_parts

    file = ifcopenshell.file(schema="IFC4")
    stair, flight, step, wall = (
        file.create_entity(kind, ifcopenshell.guid.new())
        for kind in ("IfcStair", "IfcStairFlight", "IfcBuildingElementPart", "IfcWall")
    )
    for whole, part in ((stair, flight), (flight, step)):
        file.create_entity("IfcRelAggregates", ifcopenshell.guid.new(), RelatingObject=whole, RelatedObjects=[part])
    parts = read_parts(file, [e.id() for e in (stair, step, wall)])
    assert parts == {(1, 0)}

    plan = house()
    column = list(PLAN).index("column")
    twice = with_copy(plan, column)
    samples = sample_surface(twice, 0.1)
    surfaces, nobody = ElementSurfaces(twice), np.zeros(len(twice.elements), np.bool_)
    found = find_shared(twice, samples, surfaces)
    assert found.main_partner(column, nobody) == len(PLAN) and found.main_partner(len(PLAN), nobody) == column
    doubt = found.in_doubt(len(samples), nobody)
    assert doubt[(samples.element == column) & samples.exposed].all()
    gone = nobody.copy()
    gone[len(PLAN)] = True
    assert not found.in_doubt(len(samples), gone)[samples.element == column].any() and found.main_partner(column, gone) == -1
    apart = find_shared(twice, samples, surfaces, frozenset({(len(PLAN), column)}))
    assert apart.main_partner(column, nobody) == -1


def test_where_an_element_came_from_elsewhere_it_is_new() -> None:
    model = house()
    row = list(PLAN).index("column")
    there = ElementSight("STANDS", 1.0, 0.0, 1.0, (0.0, 0.0, 0.0), "")
    for shift, states in ((5.0, ("NEW", "DISAPPEARED")), (0.1, ("PARTIAL", "PARTIAL"))):
        moved = ElementSight("MOVED", 1.0, 0.0, 1.0, (shift, 0.0, 0.0), "")
        assert element_state(model, row, there, moved, Amount(), 0.01).state == states[0]
        assert element_state(model, row, moved, there, Amount(), 0.01).state == states[1]


def test_an_element_that_stands_but_for_a_part_is_partly_gone() -> None:
    model = house()
    row = list(PLAN).index("partition")
    there = ElementSight("STANDS", 1.0, 0.0, 1.0, None, "")
    for deep, state in ((0.3, "PARTIAL"), (0.05, "CONFIRMED")):
        assert partly_gone(model, row, deep) == (state == "PARTIAL")
        assert element_state(model, row, there, None, Amount(deep=deep), 0.01).state == state


def test_solids_are_filled_and_thin_ones_kept() -> None:
    model = house()
    found = voxelise(model, VoxelGrid.for_model(model.origin, 0.05))
    volume = mesh_volumes(model)
    for row, name in enumerate(PLAN):
        if name in ("ceiling", "plate"):
            assert found.count[row] > 0
        else:
            assert found.count[row] * 0.05**3 == pytest.approx(volume[row], rel=0.13), name


def test_solids_do_not_depend_on_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    model = house()
    whole = voxelise(model, VoxelGrid.for_model(model.origin, 0.05))
    monkeypatch.setattr(solids, "BLOCK_SIDE", 7)
    monkeypatch.setattr(solids, "CELLS_AT_ONCE", 150)
    blocks = voxelise(model, VoxelGrid.for_model(model.origin, 0.05))
    assert np.array_equal(whole.element, blocks.element) and np.array_equal(whole.count, blocks.count)
    assert np.array_equal(whole.table.slot_key, blocks.table.slot_key)


def test_memory_follows_the_solid_and_not_its_box() -> None:
    """A beam of 3.6 m3 across a box of 540 m3: without blocks its voxels took 0.5 GB."""
    beam = building_model([box("beam", (0.0, 0.0, 3.0), (60.0, 0.2, 3.3))], turn=np.pi / 4)
    tracemalloc.start()
    try:
        found = voxelise(beam, VoxelGrid.for_model(beam.origin, 0.02))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert found.count[0] * 0.02**3 == pytest.approx(3.6, rel=0.1)
    assert peak < 100e6


def test_overlap_along_a_shift() -> None:
    model = house()
    row = list(PLAN).index("partition")
    assert overlap(model, row, np.array([0.05, 0.0, 0.0])) == pytest.approx(0.75)
    assert overlap(model, row, np.array([0.3, 0.0, 0.0])) == 0.0


def test_voxel_size_against_accuracy() -> None:
    assert supported_level(0.01) == 30 and supported_level(0.01, relative=True) == 20
    assert supported_level(0.005) == 40 and supported_level(0.5) is None
    result = change(house(), [after()], None, dataclasses.replace(OPTIONS, loa=40))
    assert any("LOA40" in w and "LOA20" in w for w in result.warnings)


def test_outputs_hold_what_was_found(tmp_path: Path) -> None:
    from plyfile import PlyData

    result = against_model()
    write_voxels(tmp_path / "v.ply", result)
    vertex = PlyData.read(tmp_path / "v.ply")["vertex"]
    assert [p.name for p in vertex.properties][:3] == ["x", "y", "z"]
    assert set(np.unique(vertex["state"])) <= {0, 1, 2, 3} and len(vertex["x"]) == len(result.voxels.state)
    gone = vertex["state"] == 3
    assert (vertex["red"][gone] > vertex["green"][gone]).all()
    for found in (result, against_reference()):
        main = found.voxel_counts[0]
        counted = [int((found.voxels.state == code).sum()) for code in (1, 2, 3, 0)]
        assert counted == [main.confirmed, main.new, main.disappeared, main.unknown]
    names = [(c.epoch, c.against) for c in against_reference().voxel_counts]
    assert names == [("epoch", "reference"), ("reference", "model"), ("epoch", "model")]
    data = change_to_json(result)
    assert data["elements"] == [e.global_id for e in result.elements]
    described = (Path(__file__).parents[2] / "docs" / "change.md").read_text(encoding="utf-8")
    for key in (*data, *data["summary"], *data["changes"][0], *data["epochs"][0], *data["clusters"][0], *data["progress"][0],
                *data["voxel_counts"][0]):
        assert f"`{key}`" in described or key in STATES, key
    lines = changes_csv(result).decode("utf-8-sig").splitlines()
    assert len(lines) == len(PLAN) + 1
    page = render_change_page(result)
    assert "<script" not in page and "partition" in page
    many = dataclasses.replace(result, clusters=result.clusters * 50, clusters_left_out=7)
    assert f"the JSON file has the {len(many.clusters):,} largest of" in render_change_page(many).replace("\u202f", ",")
    assert "the JSON file has all" in render_change_page(dataclasses.replace(many, clusters_left_out=0))


def test_the_report_shows_progress_without_a_plan_and_pictures_of_all_sides() -> None:
    result = against_reference()
    page = render_change_page(result)
    assert "states no plan" in page and "Not observed" in page and ">Planned<" not in page
    storey = next(g for g in result.epoch.progress if g.kind == "storey")
    unseen = format_percent(storey.not_observed)
    assert f"{format_percent(storey.complete)}<br><small>{unseen} not observed</small>" in page, "at each epoch"
    views = voxel_views(result)
    assert len(views) == 3 and page.count("data:image/png") == len(views) + len(remaining_views(result))
    above = np.asarray(Image.open(io.BytesIO(base64.b64decode(views[0].image))))
    assert above.shape == (views[0].height, views[0].width, 3)
    x, y = ((np.array([6.1, 3.0]) - result.anchor[:2]) / result.edge - result.voxels.index.min(axis=0)[:2]).astype(int)
    red, green, _ = above[views[0].height - 1 - y, x].astype(int)  # the half of the partition that is gone
    assert red > 2 * green


def test_names_are_escaped_in_the_report() -> None:
    result = against_model()
    bad = dataclasses.replace(result.elements[0], name="<img src=x onerror=alert(1)>")
    page = render_change_page(dataclasses.replace(result, elements=(bad, *result.elements[1:])))
    assert "<img src=x" not in page and "&lt;img src=x" in page


def test_scans_elsewhere_are_refused() -> None:
    with pytest.raises(BimVerifyError, match="comes near the model"):
        change(house(), [scan(built({}), origin=np.array([900.0, 0.0, 0.0]))], None, OPTIONS)


def test_scans_without_returns_are_refused() -> None:
    nothing = ArraySource((Station("S0", np.array([2.4, 1.9, 1.5])),), (np.zeros((0, 3), np.float32),), ("empty.e57",))
    for empty in (nothing, ArraySource((), (), ("empty.e57",))):
        with pytest.raises(BimVerifyError, match=r"The scans of the epoch \(empty.e57\) hold no return"):
            change(house(), [empty], None, OPTIONS)
    with pytest.raises(BimVerifyError, match="The scans of the reference"):
        change(house(), [before()], nothing, OPTIONS)
