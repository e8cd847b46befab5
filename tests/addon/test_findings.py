"""After the verdicts: exports, decisions, walking through findings, undo of the result, points as geometry nodes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import bpy
import ifcopenshell
import numpy as np
import pytest
from bcf.bcfxml import load
from mathutils import Vector

from bim_verify.bim_verify_addon import overlay, point_display, project, scene, verdicts
from bim_verify.bim_verify_addon.operators import import_ifc, import_scan
from bim_verify.bim_verify_addon.sight import look_at_all, sight
from bim_verify.core.errors import Cancelled
from bim_verify.core.model.decisions import decisions_in
from bim_verify.core.options import VerifyOptions
from bim_verify.core.results import VerificationResult

from .scene_facts import status_counts

ops = bpy.ops.bim_verify
Verification = Callable[[Callable[..., VerificationResult]], None]


def select(found: bpy.types.Scene, status: str) -> bpy.types.Object:
    item = next(o for o in scene.element_objects(found).values() if o.bim_verify.status == status)
    for other in bpy.context.selected_objects:
        other.select_set(False)
    item.select_set(True)
    bpy.context.view_layer.objects.active = item
    return item


@pytest.mark.parametrize(
    ("operator", "name", "written"),
    [
        ("export_bcf", "f", "f.bcf"),
        ("export_ids", "f.ids", "f.ids"),
        ("export_table", "f", "f.xlsx"),
        ("export_table", "f.csv", "f.csv"),
        ("export_templates", "f", "f.ifc"),
        ("report", "f", "f/index.html"),
    ],
)
def test_every_export_writes_its_file(
    verified: bpy.types.Scene, tmp_path: Path, operator: str, name: str, written: str
) -> None:
    assert getattr(ops, operator)(filepath=str(tmp_path / name)) == {"FINISHED"}
    assert (tmp_path / written).stat().st_size > 100
    assert written.split("/")[0] in verified.bim_verify.exported_path


@pytest.mark.parametrize("operator", ["export_bcf", "export_ids", "export_table", "export_templates", "report"])
def test_exports_say_what_is_wrong(verified: bpy.types.Scene, house: Path, tmp_path: Path, operator: str) -> None:
    for path in ("", str(house)) if operator == "export_templates" else ("",):
        with pytest.raises(RuntimeError, match=r"No file name|never written"):
            getattr(ops, operator)(filepath=path)
    (tmp_path / "file").write_text("x")
    with pytest.raises(RuntimeError, match="Cannot"):
        getattr(ops, operator)(filepath=str(tmp_path / "file" / "x"))
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_a_cancelled_export_leaves_neither_file_nor_folder(
    verified: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from bim_verify.core.report import html

    def stopped(*_: object, **__: object) -> str:
        raise Cancelled

    monkeypatch.setattr(html, "render_page", stopped)
    assert ops.report(filepath=str(tmp_path / "report")) == {"CANCELLED"}
    assert list(tmp_path.iterdir()) == []


def test_bcf_of_the_selection_has_its_topics_only(verified: bpy.types.Scene, tmp_path: Path) -> None:
    item = select(verified, "ABSENT")
    assert ops.export_bcf(filepath=str(tmp_path / "f.bcf"), selected_only=True, version="2.1") == {"FINISHED"}
    with load(tmp_path / "f.bcf") as book:
        (topic,) = book.topics.values()
        (view,) = topic.viewpoints.values()
        assert view.get_selected_guids() == [item["GlobalId"]]
    for other in bpy.context.selected_objects:
        other.select_set(False)
    with pytest.raises(RuntimeError, match="No element is selected"):
        ops.export_bcf(filepath=str(tmp_path / "g.bcf"), selected_only=True)


def test_report_table_and_ids_of_the_selection(verified: bpy.types.Scene, tmp_path: Path) -> None:
    item = select(verified, "ABSENT")
    for operator, name in (("report", "r"), ("export_table", "t.csv"), ("export_ids", "i.ids")):
        assert getattr(ops, operator)(filepath=str(tmp_path / name), selected_only=True) == {"FINISHED"}
    (line,) = (tmp_path / "t.csv").read_text(encoding="utf-8-sig").splitlines()[1:]
    assert item["GlobalId"] in line
    page = (tmp_path / "r" / "index.html").read_text(encoding="utf-8")
    others = {o["GlobalId"] for o in scene.element_objects(verified).values()} - {item["GlobalId"]}
    assert item["GlobalId"] in page and not any(other in page for other in others)
    assert "This holds for 1 of 5 elements, those that were selected." in page
    check = (tmp_path / "i.ids").read_text(encoding="utf-8")
    assert item.bim_verify.ifc_class.upper() in check and not any(other in check for other in others)


def test_a_decision_colours_counts_and_goes_into_the_ifc(
    verified: bpy.types.Scene, result: VerificationResult, tmp_path: Path
) -> None:
    item = select(verified, "ABSENT")
    with pytest.raises(RuntimeError, match="needs a reason"):
        ops.decide(status="CONFIRMED", reason=" ")
    assert ops.decide(status="CONFIRMED", reason="seen <on> site", author="me") == {"FINISHED"}
    assert verdicts.status(item) == "CONFIRMED"
    assert item.bim_verify.status == "ABSENT"
    counts = dict(status_counts(verified))
    assert (counts["ABSENT"], counts["CONFIRMED"]) == (result.count("ABSENT") - 1, result.count("CONFIRMED") + 1)
    assert "seen <on> site" in " ".join(overlay.numbers(bpy.context))
    ops.export_ifc(filepath=str(tmp_path / "out.ifc"))
    (decision,) = decisions_in(tmp_path / "out.ifc").values()
    assert (decision.status, decision.computed, decision.author) == ("CONFIRMED", "ABSENT", "me")

    ops.verify()  # a re-run keeps it
    assert verdicts.status(scene.element_objects(verified)[item["GlobalId"]]) == "CONFIRMED"
    select(verified, "ABSENT")
    ops.decide(status="COMPUTED")
    assert dict(status_counts(verified))["ABSENT"] == result.count("ABSENT")
    ops.export_ifc(filepath=str(tmp_path / "back.ifc"))
    assert decisions_in(tmp_path / "back.ifc") == {}


def test_decisions_in_the_imported_file_are_found_again(verified: bpy.types.Scene, tmp_path: Path) -> None:
    item = select(verified, "DEVIATING")
    ops.decide(status="CONFIRMED", reason="accepted", author="me")
    ops.export_ifc(filepath=str(tmp_path / "out.ifc"))
    verdicts.store(item, None)
    ops.import_ifc(filepath=str(tmp_path / "out.ifc"))
    ops.verify()
    assert verdicts.status(scene.element_objects(verified)[item["GlobalId"]]) == "CONFIRMED"

    for other in verified.objects:  # taken back, the file of before no longer counts
        other.select_set(other == item)
    ops.decide(status="COMPUTED")
    ops.export_ifc(filepath=str(tmp_path / "back.ifc"))
    assert decisions_in(tmp_path / "back.ifc") == {} and decisions_in(tmp_path / "out.ifc") != {}
    ops.verify()
    assert verdicts.status(item) == "DEVIATING"
    ops.decide(status="ABSENT", reason="gone", author="me")
    ops.verify()
    assert verdicts.status(item) == "ABSENT"


def test_stepping_goes_round_the_class(verified: bpy.types.Scene, result: VerificationResult) -> None:
    for o in scene.element_objects(verified).values():
        o.bim_verify.status = "DEVIATING" if o.bim_verify.status in ("DEVIATING", "PARTIAL", "ABSENT") else o.bim_verify.status
    seen = []
    for _ in range(4):
        assert ops.step_finding(category="DEVIATING") == {"FINISHED"}
        assert list(bpy.context.selected_objects) == [bpy.context.active_object]
        seen.append(bpy.context.active_object.name)
    assert len(set(seen[:3])) == 3
    assert seen[3] == seen[0]
    ops.step_finding(category="DEVIATING", direction="PREVIOUS")
    assert bpy.context.active_object.name == seen[2]
    with pytest.raises(RuntimeError, match="There is no class"):
        ops.step_finding(category="NO SUCH")


def test_a_finding_is_looked_at_from_where_it_is_seen(verified: bpy.types.Scene) -> None:
    column = next(o for o in scene.element_objects(verified).values() if o.bim_verify.ifc_class == "IfcColumn")
    for other in scene.element_objects(verified).values():
        other.hide_set(other != column)
    bpy.context.view_layer.update()
    south, size = Vector((0.0, -1.0, 0.0)), column.dimensions.length
    seen = sight(bpy.context, column, south)
    assert seen.toward == south
    assert seen.distance == seen.begins == pytest.approx(2.2 * size, rel=0.05)

    def screen(toward: Vector, away: float) -> None:
        mesh = bpy.data.meshes.new("screen")
        across, up = toward.orthogonal(), toward.cross(toward.orthogonal())
        corners = [seen.middle + away * toward + 99 * side for side in (across + up, across - up, -2 * across)]
        mesh.from_pydata(corners, [], [(0, 1, 2)])
        verified.collection.objects.link(bpy.data.objects.new("screen", mesh))
        bpy.context.view_layer.update()

    screen(south, 3.0 * size)  # a wall behind the viewer
    assert sight(bpy.context, column, south) == seen
    screen(south, 0.6 * size)  # a wall before it: from another side
    other = sight(bpy.context, column, south)
    assert other.toward.dot(south) < 0.5
    assert other.distance == seen.distance
    for toward in (Vector((1, 0, 0)), Vector((-1, 0, 0)), Vector((0, 1, 0)), Vector((0, 0, 1)), Vector((0, 0, -1))):
        screen(toward, 0.6 * size)
    room = sight(bpy.context, column, south)  # a small room: from as far away, through its wall
    assert room.distance == seen.distance
    assert 0.0 < room.begins < 1.1 * size


def test_isolating_hides_the_others_and_brings_them_back(verified: bpy.types.Scene) -> None:
    items = scene.element_objects(verified)
    ops.isolate_findings(category="ABSENT")
    assert {o.bim_verify.status for o in items.values() if not o.hide_get()} == {"ABSENT"}
    ops.isolate_findings(category="ABSENT")
    assert not any(o.hide_get() for o in items.values())
    ops.isolate_findings(category="PARTIAL")
    ops.isolate_findings(show_all=True)
    assert not any(o.hide_get() for o in items.values())


def test_verdicts_for_the_selection_leave_the_others(
    verified: bpy.types.Scene, result: VerificationResult, verification: Verification
) -> None:
    from dataclasses import replace

    item = select(verified, "CONFIRMED")
    changed = replace(result, verdicts=tuple(replace(v, status="PARTIAL") for v in result.verdicts))
    verification(lambda *_: changed)
    ops.verify(selected_only=True)
    for v in result.verdicts:
        expected = "PARTIAL" if v.global_id == item["GlobalId"] else v.status
        assert scene.element_objects(verified)[v.global_id].bim_verify.status == expected
    kept = project.result(verified)
    assert kept is not None
    assert sum(v.status == "PARTIAL" for v in kept.verdicts) == result.count("PARTIAL") + 1


def test_the_selection_alone_is_computed_where_the_rest_is_known(
    verified: bpy.types.Scene, result: VerificationResult, verification: Verification
) -> None:
    from dataclasses import replace

    asked: list[tuple[str, ...]] = []

    def found(model: object, paths: object, options: VerifyOptions, progress: object) -> VerificationResult:
        asked.append(options.only)
        nothing = replace(result.evidence, m_occ=np.zeros_like(result.evidence.m_occ))
        return replace(result, evidence=nothing, options=options)

    verification(found)
    item = select(verified, "CONFIRMED")
    verified.bim_verify.spacing_mm = 1000 * result.options.sample_spacing
    ops.verify(selected_only=True)
    kept = project.result(verified)
    assert kept is not None
    own = result.samples.element == [v.global_id for v in result.verdicts].index(item["GlobalId"])
    assert not kept.evidence.m_occ[own].any()
    assert np.array_equal(kept.evidence.m_occ[~own], result.evidence.m_occ[~own])
    assert kept.options.only == ()
    verified.bim_verify.spacing_mm += 10  # other positions: nothing to put it into
    ops.verify(selected_only=True)
    assert asked == [(item["GlobalId"],), ()]


def test_the_result_follows_what_the_scene_says(verified: bpy.types.Scene, result: VerificationResult) -> None:
    first = verified.bim_verify.result_key
    ops.verify()
    assert verified.bim_verify.result_key != first
    verified.bim_verify.result_key = first  # what undo does
    assert project.result(verified) is not None
    verified.bim_verify.result_key = ""
    assert not ops.export_ifc.poll()
    assert not ops.export_bcf.poll()


def test_points_and_voxels_become_geometry(blender: bpy.types.Scene, scan: Path) -> None:
    ops.import_scan(filepath=str(scan))
    (cloud,) = scene.scan_objects(blender)
    shown = cloud.evaluated_get(bpy.context.evaluated_depsgraph_get())
    assert shown.modifiers[point_display.MODIFIER].node_group.name == point_display.POINTS
    blender.bim_verify.point_size_mm = 20
    assert bpy.data.node_groups[point_display.POINTS].nodes["Size"].outputs[0].default_value == pytest.approx(0.01)
    mesh = bpy.data.meshes.new("v")
    mesh.vertices.add(3)
    mesh.attributes["position"].data.foreach_set("vector", np.arange(9, dtype=np.float32))
    scene.set_attribute(mesh, "bv_color", "FLOAT_COLOR", np.tile([1.0, 0.0, 0.0, 1.0], (3, 1)))
    item = bpy.data.objects.new("v", mesh)
    blender.collection.objects.link(item)
    point_display.show_as_voxels(item, 0.1)
    made = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    assert made.modifiers[point_display.MODIFIER].node_group.name == f"{point_display.VOXELS} 100 mm"
    assert made.modifiers[point_display.MODIFIER].node_group.nodes["Size"].outputs[0].default_value == pytest.approx(0.05)
    assert tuple(item.color) == pytest.approx((1.0, 0.0, 0.0, 1.0))


def test_an_emulated_view_is_given_fewer_points_unless_someone_says_how_many(
    blender: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = blender.bim_verify
    assert point_display.points_shown(settings) == settings.display_points == 1_000_000
    monkeypatch.setattr(point_display, "emulated", lambda: True)
    assert point_display.points_shown(settings) == point_display.MOST_EMULATED
    settings.display_points = 2_000_000
    assert point_display.points_shown(settings) == 2_000_000


def test_another_model_takes_the_findings_of_the_first_away(verified: bpy.types.Scene, house: Path, tmp_path: Path) -> None:
    ops.import_ifc(filepath=str(house))  # the same again: they still hold
    assert dict(status_counts(verified))["ABSENT"]
    assert ops.export_bcf.poll()
    item = select(verified, "ABSENT")
    ops.decide(status="CONFIRMED", reason="seen", author="me")
    revised = ifcopenshell.open(str(house))
    revised.by_type("IfcWall")[0].Name = "revised"
    revised.write(str(tmp_path / "revised.ifc"))
    ops.import_ifc(filepath=str(tmp_path / "revised.ifc"))
    assert status_counts(verified) == []
    assert not ops.export_bcf.poll()
    assert not ops.step_finding.poll()
    assert item["GlobalId"] in verdicts.decisions(verified)


@pytest.mark.parametrize("model_first", [True, False])
def test_only_the_first_import_moves_the_view(
    blender: bpy.types.Scene, house: Path, scan: Path, monkeypatch: pytest.MonkeyPatch, model_first: bool
) -> None:
    looked: list[int] = []
    for operators in (import_ifc, import_scan):
        monkeypatch.setattr(operators, "look_at_all", lambda _, items: looked.append(len(items)))
    steps = [lambda: ops.import_ifc(filepath=str(house)), lambda: ops.import_scan(filepath=str(scan))]
    for step in steps if model_first else reversed(steps):
        assert step() == {"FINISHED"}
        assert looked == [5 if model_first else 1]


def test_the_first_thing_in_a_scene_is_looked_at_as_a_whole(
    blender: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bim_verify.bim_verify_addon.sight.bpy", SimpleNamespace(app=SimpleNamespace(background=False)))
    items = []
    for x in (0.0, 300.0):
        mesh = bpy.data.meshes.new("cube")
        mesh.from_pydata([(x, 0, 0), (x + 100, 0, 0), (x, 0, 20)], [], [(0, 1, 2)])
        items.append(bpy.data.objects.new("cube", mesh))
        blender.collection.objects.link(items[-1])
    bpy.context.view_layer.update()
    region = SimpleNamespace(view_perspective="CAMERA", view_location=None, view_distance=0.0)
    space = SimpleNamespace(region_3d=region, lens=50.0, clip_end=1000.0)
    areas = [SimpleNamespace(type="VIEW_3D", spaces=SimpleNamespace(active=space)), SimpleNamespace(type="OUTLINER")]
    look_at_all(SimpleNamespace(window=SimpleNamespace(screen=SimpleNamespace(areas=areas))), items)
    assert region.view_perspective == "PERSP"
    assert tuple(region.view_location) == pytest.approx((200.0, 0.0, 10.0))
    assert 400.0 < region.view_distance < 700.0
    assert space.clip_end > region.view_distance + 400.0
