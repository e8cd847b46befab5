"""The operator, the voxels and the slider over epochs."""

from __future__ import annotations

from pathlib import Path

import pytest

bpy = pytest.importorskip("bpy")

import numpy as np  # noqa: E402

from bim_verify.bim_verify_addon import change_scene, scene  # noqa: E402
from bim_verify.bim_verify_addon.headless import save_blend  # noqa: E402
from bim_verify.core import jobs  # noqa: E402
from bim_verify.core.change.results import ChangeResult  # noqa: E402
from bim_verify.core.model.elements import BuildingModel  # noqa: E402
from bim_verify.core.options import ChangeOptions  # noqa: E402
from bim_verify.core.scans.campaign import Station  # noqa: E402
from bim_verify.core.simulation.box_building import ArraySource  # noqa: E402
from bim_verify.core.simulation.scanner import Scanner, scan_station  # noqa: E402
from bim_verify.core.simulation.scene import Edit, build_scene  # noqa: E402


def _scan(model: BuildingModel, edits: dict[int, Edit]) -> ArraySource:
    scanner = Scanner("test", np.radians(1.5), sigma_range=0.001)
    places = np.array([[2.0, 1.5, 1.4], [1.2, 2.1, 1.2]]) - model.origin
    found = [scan_station(build_scene(model, edits), p, np.eye(3), scanner, k) for k, p in enumerate(places)]
    return ArraySource(
        tuple(Station(f"S{k}", p + model.origin) for k, p in enumerate(places)), tuple(f.offset for f in found)
    )


@pytest.fixture(scope="module")
def changed(house_model: BuildingModel) -> ChangeResult:
    column = next(k for k, e in enumerate(house_model.elements) if e.ifc_class == "IfcColumn")
    return jobs.change(
        house_model, [_scan(house_model, {}), _scan(house_model, {column: Edit("remove")})], None,
        ChangeOptions(voxel=0.05, sample_spacing=0.1),
    )


def test_elements_are_coloured_epoch_by_epoch(blender: bpy.types.Scene, changed: ChangeResult) -> None:
    change_scene.show_change(blender, changed)
    settings = blender.bim_verify_change
    assert (settings.epochs, settings.epoch) == (2, 2)
    column = next(e for e in changed.elements if e.ifc_class == "IfcColumn")
    assert column.state == "DISAPPEARED"
    mesh = scene.element_objects(blender)[column.global_id].data
    color = np.empty(4 * len(mesh.vertices), np.float32)
    mesh.attributes[scene.COLOR].data.foreach_get("color", color)
    assert color[0] > color[1]
    settings.epoch = 1
    mesh.attributes[scene.COLOR].data.foreach_get("color", color)
    assert color[1] > color[0]
    settings.epoch = 9
    assert settings.epoch == 2


def test_another_model_takes_the_changes_away(blender: bpy.types.Scene, changed: ChangeResult) -> None:
    change_scene.show_change(blender, changed)
    change_scene.forget(blender)
    assert not blender.bim_verify_change.summary
    assert not any(change_scene.VOXEL_KEY in item for item in blender.objects)
    assert all(change_scene.state_now(item) == "" for item in scene.element_objects(blender).values())


def test_gone_voxels_are_a_surface_and_the_second_result_replaces_the_first(
    blender: bpy.types.Scene, changed: ChangeResult
) -> None:
    for _ in range(2):
        change_scene.show_change(blender, changed)
    voxels = {item[change_scene.VOXEL_KEY]: item for item in blender.objects if change_scene.VOXEL_KEY in item}
    assert sum(change_scene.VOXEL_KEY in item for item in blender.objects) == len(voxels)
    gone = voxels[3].data
    assert len(gone.polygons) > 0 and change_scene.STATE in gone.attributes


def test_a_blend_file_is_saved(blender: bpy.types.Scene, changed: ChangeResult, tmp_path: Path) -> None:
    save_blend(changed, tmp_path / "change.blend")
    assert (tmp_path / "change.blend").stat().st_size > 1000


def test_the_operator_hands_epochs_to_the_job(
    blender: bpy.types.Scene, house: Path, scan: Path, changed: ChangeResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def change(model, epochs, reference, options, progress):  # type: ignore[no-untyped-def]
        asked.append((epochs, reference, options.voxel))
        return changed

    monkeypatch.setattr(jobs, "change", change)
    blender.bim_verify.model_path = str(house)
    for _ in range(2):
        entry = blender.bim_verify.scans.add()
        entry.path, entry.use = str(scan), True
    blender.bim_verify_change.each_file = True
    blender.bim_verify_change.voxel_mm = 25
    assert bpy.ops.bim_verify.change() == {"FINISHED"}
    epochs, reference, voxel = asked[0]
    assert len(epochs) == 2 and reference is None and voxel == pytest.approx(0.025)
    assert blender.bim_verify_change.summary
