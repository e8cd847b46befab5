"""What a job owes to the scene: its inputs stay, an element being edited, another scene shown, steps beside Verify."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import ifcopenshell
import ifcopenshell.util.element
import numpy as np
import pytest

from bim_verify.bim_verify_addon import ifc_edits, scene
from bim_verify.bim_verify_addon.operators.file_browser import named
from bim_verify.bim_verify_addon.operators.verify import BIMVERIFY_OT_verify
from bim_verify.bim_verify_addon.surface_grid import make_display
from bim_verify.core import jobs
from bim_verify.core.results import VerificationResult

from ..core.factory import fabricate
from .test_jobs import FakeOperator, drive, fake_context

ops = bpy.ops.bim_verify


@pytest.mark.parametrize("kind", ["scan", "unused scan", "reference", "base of a wall"])
def test_no_file_that_the_scene_reads_is_written_to(verified: bpy.types.Scene, tmp_path: Path, kind: str) -> None:
    given = tmp_path / "given.csv"
    given.write_text("1,2,3\n")
    if "scan" in kind:
        entry = verified.bim_verify.scans.add()
        entry.path, entry.use = str(given), kind == "scan"
    elif kind == "reference":
        verified.bim_verify_change.references.add().path = str(given)
    else:
        verified.bim_verify_displacement.base = str(given)
    with pytest.raises(RuntimeError, match="is an input and is never written to"):
        ops.export_table(filepath=str(given))
    assert given.read_text() == "1,2,3\n"


def test_an_ending_is_added_and_takes_no_place_of_another() -> None:
    assert named("/x/house.v2", ".ifc") == Path("/x/house.v2.ifc")
    assert named("/x/house.IFC", ".ifc") == Path("/x/house.IFC")
    assert named("/x/report.v2") == Path("/x/report.v2")


def test_a_report_replaces_no_scan_in_its_folder(verified: bpy.types.Scene, tmp_path: Path) -> None:
    given = tmp_path / "elements.csv"
    given.write_text("1,2,3\n")
    verified.bim_verify.scans.add().path = str(given)
    with pytest.raises(RuntimeError, match="is an input and is never written to"):
        ops.report(filepath=str(tmp_path))
    assert given.read_text() == "1,2,3\n"


def test_an_element_being_edited_is_left_before_its_result_comes(verified: bpy.types.Scene) -> None:
    item = next(iter(scene.element_objects(verified).values()))
    bpy.context.view_layer.objects.active = item
    for action in (ops.verify, lambda: setattr(verified.bim_verify, "color_mode", "DEVIATION")):
        item.select_set(True)
        bpy.ops.object.mode_set(mode="EDIT")
        action()
        assert item.mode == "OBJECT"
        assert len(item.data.attributes[scene.COLOR].data) == len(item.data.vertices) > 0


def test_a_result_goes_into_the_scene_that_asked_for_it(verified: bpy.types.Scene, result: VerificationResult) -> None:
    shown: list[bpy.types.Scene] = []

    class Verify(FakeOperator):
        bl_idname, earlier, only = BIMVERIFY_OT_verify.bl_idname, None, None
        _finish, decided = BIMVERIFY_OT_verify.finish, BIMVERIFY_OT_verify.decided

        def finish(self, context: bpy.types.Context, value: int) -> str:
            shown.append(context.scene)
            return self._finish(context, (result, make_display(result, 10_000), np.eye(4)))

    asked, other = bpy.context.scene, bpy.data.scenes.new("Other")
    operator, context = Verify(lambda progress: 1), fake_context()
    context.scene = asked
    operator.start(context)
    context.scene, context.temp_override = other, bpy.context.temp_override
    assert drive(operator, context) == {"FINISHED"}
    assert shown == [asked] and not other.objects


def test_a_result_whose_scene_is_gone_is_dropped_in_one_sentence(blender: bpy.types.Scene) -> None:
    gone = bpy.data.scenes.new("Gone")
    operator, context = FakeOperator(lambda progress: 1), fake_context()
    context.scene = gone
    operator.start(context)
    bpy.data.scenes.remove(gone)
    context.scene = bpy.context.scene
    assert drive(operator, context) == {"CANCELLED"}
    assert "its scene was deleted" in operator.reports[0][1] and operator.finished == []


def test_undo_while_a_job_runs_does_not_cost_its_result(verified: bpy.types.Scene) -> None:
    bpy.ops.ed.undo_push(message="before")
    next(iter(scene.element_objects(verified).values())).location.x = 9.0
    bpy.ops.ed.undo_push(message="moved")
    operator, context = FakeOperator(lambda progress: 1), fake_context()
    context.scene = bpy.context.scene
    operator.start(context)
    assert bpy.ops.ed.undo() == {"FINISHED"}
    context.scene = bpy.context.scene
    assert drive(operator, context) == {"FINISHED"} and operator.finished == [1]


def test_decisions_made_and_taken_back_while_a_verification_runs_hold(
    verified: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept, back, *_ = scene.element_objects(verified).values()

    def decide(item: bpy.types.Object, status: str) -> None:
        bpy.ops.object.select_all(action="DESELECT")
        item.select_set(True)
        ops.decide(status=status, reason="seen", author="me")

    decide(back, "ABSENT")
    found = jobs.verify

    def verify(*given: Any, **named: Any) -> VerificationResult:
        decide(kept, "PARTIAL")
        decide(back, "COMPUTED")
        return found(*given, **named)

    monkeypatch.setattr(jobs, "verify", verify)
    assert ops.verify() == {"FINISHED"}
    assert (kept.bim_verify.decided_status, back.bim_verify.decided_status) == ("PARTIAL", "")


def put(name: str, value: str) -> Callable[[object], int]:
    def edit(file: ifcopenshell.file) -> int:
        wall = file.by_type("IfcWall")[0]
        pset = ifcopenshell.api.run("pset.add_pset", file, product=wall, name=name)
        ifcopenshell.api.run("pset.edit_pset", file, pset=pset, properties={"State": value})
        return 1

    return edit


def sets_of(path: Path) -> dict[str, dict[str, object]]:
    file = ifcopenshell.open(str(path))
    return ifcopenshell.util.element.get_psets(file.by_type("IfcWall")[0])


def test_what_other_steps_found_is_exported_too(verified: bpy.types.Scene, house: Path, tmp_path: Path) -> None:
    ifc_edits.put(bpy.context, "bim_verify.change", put("BimVerify_Change", "NEW"))
    ifc_edits.put(bpy.context, "bim_verify.quality", put("BimVerify_ScanQuality", "fine"))
    ifc_edits.put(bpy.context, "bim_verify.change", put("BimVerify_Change", "CONFIRMED"))
    ops.export_ifc(filepath=str(tmp_path / "all.ifc"))
    found = sets_of(tmp_path / "all.ifc")
    assert found["BimVerify_Change"]["State"] == "CONFIRMED" and found["BimVerify_ScanQuality"]["State"] == "fine"
    assert "BimVerify_Verification" in found


def test_it_is_exported_without_a_verification_and_forgotten_with_its_model(
    blender: bpy.types.Scene, house: Path, tmp_path: Path
) -> None:
    ops.import_ifc(filepath=str(house))
    assert not ops.export_ifc.poll()
    ifc_edits.put(bpy.context, "bim_verify.change", put("BimVerify_Change", "NEW"))
    ops.export_ifc(filepath=str(tmp_path / "changed.ifc"))
    found = sets_of(tmp_path / "changed.ifc")
    assert found["BimVerify_Change"]["State"] == "NEW" and "BimVerify_Verification" not in found
    ops.import_ifc(filepath=str(tmp_path / "changed.ifc"))
    assert not ifc_edits.kept(blender) and not ops.export_ifc.poll()


def test_two_elements_of_one_globalid_are_two_objects(
    blender: bpy.types.Scene, house: Path, tmp_path: Path, verification: Callable[[object], None], scan: Path
) -> None:
    file = ifcopenshell.open(str(house))
    first, second = file.by_type("IfcWall")[:2]
    second.GlobalId = first.GlobalId
    file.write(str(tmp_path / "twice.ifc"))
    verification(lambda model, *_: fabricate(model))
    ops.import_scan(filepath=str(scan))
    for action in (lambda: ops.import_ifc(filepath=str(tmp_path / "twice.ifc")), ops.verify, ops.verify):
        action()
        assert len(scene.element_objects(blender)) == len([o for o in blender.objects if scene.GUID_KEY in o]) == 5
    assert sum(entry.count for entry in blender.bim_verify.counts if entry.mode == "STATUS") == 5


def test_a_storey_that_is_excluded_is_left_out(verified: bpy.types.Scene, result: VerificationResult) -> None:
    (storey,) = (c for c in bpy.context.view_layer.layer_collection.children[0].children if c.name != scene.SCANS)
    storey.exclude = True
    assert ops.step_finding(mode="STATUS", category="CONFIRMED") == {"CANCELLED"}
    assert ops.select_findings(mode="STATUS", category="CONFIRMED") == {"FINISHED"}
    assert not bpy.context.selected_objects


def test_surfaces_are_refilled_and_not_replaced(verified: bpy.types.Scene) -> None:
    items = scene.element_objects(verified)
    before = {key: item.data.session_uid for key, item in items.items()}
    ops.verify()
    assert {key: item.data.session_uid for key, item in scene.element_objects(verified).items()} == before
    assert len(bpy.data.meshes) == len(items) + len(scene.scan_objects(verified))
