"""With Bonsai: its file is verified and receives the property sets, its false origin holds, its meshes are left alone."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import ifcopenshell
import ifcopenshell.util.element
import numpy as np
import pytest

from bim_verify.bim_verify_addon import bonsai, frame, scene
from bim_verify.bim_verify_addon.known import known_object
from bim_verify.core.results import VerificationResult

from .stand_in_bonsai import IfcStore, bonsai_holding

ops = bpy.ops.bim_verify
Verification = Callable[[Callable[..., VerificationResult]], None]


def pset(file: Any, global_id: str) -> dict[str, Any]:
    return ifcopenshell.util.element.get_psets(file.by_guid(global_id)).get("BimVerify_Verification", {})


def test_without_bonsai_every_question_is_none(blender: bpy.types.Scene) -> None:
    assert bonsai.live_file() is None
    assert bonsai.live_path() == ""
    assert bonsai.view_frame(blender) is None
    assert bonsai.global_id(bpy.data.objects.new("x", None)) is None
    assert list(bonsai.objects(["x"])) == []


def test_bonsai_without_a_project_counts_as_absent(blender: bpy.types.Scene, house: Path) -> None:
    with bonsai_holding(house) as ifc:
        ifc.file = None
        assert bonsai.live_file() is None
        assert bonsai.view_frame(blender) is None
        assert bonsai.global_id(bpy.data.objects[0]) is None


def test_its_project_is_taken_and_its_objects_are_not_doubled(blender: bpy.types.Scene, house: Path) -> None:
    with bonsai_holding(house):
        before = set(bpy.data.objects.keys())
        assert ops.import_ifc() == {"FINISHED"}
        assert set(bpy.data.objects.keys()) == before
        assert blender.bim_verify.model_path == str(house)
        assert blender.bim_verify.model_summary.startswith("5 elements")


def test_verify_writes_into_the_file_in_memory_only(
    blender: bpy.types.Scene, house: Path, scan: Path, result: VerificationResult, verification: Verification, tmp_path: Path
) -> None:
    on_disk = house.read_bytes()
    seen: list[Any] = []
    verification(lambda model, *_: seen.append(model) or result)
    with bonsai_holding(house) as ifc:
        wall = next(e for e in ifc.file.by_type("IfcWall"))
        wall.Name = "renamed and not saved"
        ops.import_scan(filepath=str(scan))
        assert ops.verify() == {"FINISHED"}
        assert "renamed and not saved" in {e.name for e in seen[0].elements}
        for verdict in result.verdicts:
            assert pset(ifc.file, verdict.global_id)["Status"] == verdict.status
        assert ops.export_ifc(filepath=str(tmp_path / "out.ifc")) == {"FINISHED"}
    assert house.read_bytes() == on_disk
    written = ifcopenshell.open(str(tmp_path / "out.ifc"))
    assert "renamed and not saved" in {e.Name for e in written.by_type("IfcWall")}
    assert all(pset(written, v.global_id)["Status"] == v.status for v in result.verdicts)


def test_its_meshes_are_left_alone_and_hidden_behind_the_result(
    blender: bpy.types.Scene, house: Path, scan: Path, result: VerificationResult, verification: Verification
) -> None:
    verification(lambda *_: result)
    with bonsai_holding(house) as ifc:
        theirs = list(bpy.data.objects)
        ops.import_scan(filepath=str(scan))
        ops.verify()
        ours = scene.element_objects(blender)
        assert len(ours) == len(result.verdicts)
        for item in theirs:
            assert len(item.data.vertices) == 0
            assert item.hide_get()
            assert "bv_color" not in item.data.attributes
        ops.show_results(planned=True)
        assert not any(item.hide_get() for item in theirs)
        assert all(item.hide_get() for item in ours.values())
        wall = ifc.get_object(ifc.file.by_type("IfcWall")[0])
        bpy.context.view_layer.objects.active = wall
        found = known_object(bpy.context)
        assert found is not None
        assert found["GlobalId"] == bonsai.global_id(wall)
        ops.select_findings(category="CONFIRMED")
        confirmed = {v.global_id for v in result.verdicts if v.status == "CONFIRMED"}
        assert {bonsai.global_id(o) for o in bpy.context.selected_objects} == confirmed


def test_results_and_scans_get_its_false_origin(
    blender: bpy.types.Scene, house: Path, scan: Path, result: VerificationResult, verification: Verification
) -> None:
    verification(lambda *_: result)
    offset_m, angle = np.array([500_000.0, 4_000_000.0, 12.0]), math.radians(30)
    with bonsai_holding(house, offset=tuple(1000 * offset_m), angle=angle):
        ops.import_scan(filepath=str(scan))
        ops.verify()
        expected = frame.ViewFrame((500_000.0, 4_000_000.0, 12.0), angle)
        stored = frame.stored(blender)
        assert stored is not None
        assert stored.origin == pytest.approx(expected.origin)
        assert stored.angle == pytest.approx(angle)
        bpy.context.view_layer.update()
        (cloud,) = scene.scan_objects(blender)
        shown = np.array([cloud.matrix_world @ v.co for v in cloud.data.vertices])
        there = expected.to_view(np.loadtxt(scan))
        assert np.abs(np.sort(shown, axis=0) - np.sort(there, axis=0)).max() < 0.5  # single precision at 4000 km


def test_edits_are_steps_of_its_own_undo(
    blender: bpy.types.Scene, house: Path, scan: Path, result: VerificationResult, verification: Verification
) -> None:
    verification(lambda *_: result)
    blender.bim_verify.display_vertices = 10_000
    with bonsai_holding(house) as ifc:
        ops.import_scan(filepath=str(scan))
        ops.verify()
        absent = next(v.global_id for v in result.verdicts if v.status == "ABSENT")
        item = ifc.get_object(ifc.file.by_guid(absent))
        item.hide_set(False)
        for other in bpy.context.selected_objects:
            other.select_set(False)
        item.select_set(True)
        assert ops.decide(status="CONFIRMED", reason="seen on site", author="me") == {"FINISHED"}
        assert IfcStore.steps == ["BIM_VERIFY_OT_verify", "BIM_VERIFY_OT_decide"]
        psets = ifcopenshell.util.element.get_psets(ifc.file.by_guid(absent))
        assert psets["BimVerify_Decision"]["Reason"] == "seen on site"
        ifc.file.undo()
        psets = ifcopenshell.util.element.get_psets(ifc.file.by_guid(absent))
        assert "BimVerify_Decision" not in psets
        assert psets["BimVerify_Verification"]["Status"] == "ABSENT"
        ifc.file.undo()
        assert pset(ifc.file, absent) == {}
        ifc.file.redo()
        assert pset(ifc.file, absent)["Status"] == "ABSENT"
