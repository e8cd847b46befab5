"""The operator, the voxels and the slider over epochs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

import ifcopenshell  # noqa: E402
import ifcopenshell.util.element  # noqa: E402
import numpy as np  # noqa: E402

from bim_verify.bim_verify_addon import change_scene, project, scene, voxel_scene  # noqa: E402
from bim_verify.bim_verify_addon.capabilities.change import CAPABILITY  # noqa: E402
from bim_verify.bim_verify_addon.headless import save_blend  # noqa: E402
from bim_verify.core import jobs  # noqa: E402
from bim_verify.core.change.results import ChangeResult  # noqa: E402
from bim_verify.core.model.elements import BuildingModel  # noqa: E402
from bim_verify.core.options import ChangeOptions  # noqa: E402
from bim_verify.core.report.palette import CHANGE_COLORS, to_linear  # noqa: E402
from bim_verify.core.report.remaining import remaining_volume  # noqa: E402
from bim_verify.core.scans.campaign import Station  # noqa: E402
from bim_verify.core.simulation.box_building import ArraySource  # noqa: E402
from bim_verify.core.simulation.scanner import Scanner, scan_station  # noqa: E402
from bim_verify.core.simulation.scene import Edit, Prop, build_scene  # noqa: E402

HALL = Prop("hall", "box", (2.0, 1.5, 1.5), (8.0, 7.0, 6.0))
"""Beams that pass through a gap in the house return from it."""


def _scan(model: BuildingModel, edits: dict[int, Edit], props: tuple[Prop, ...] = ()) -> ArraySource:
    scanner = Scanner("test", np.radians(1.5), sigma_range=0.001)
    places = np.array([[2.0, 1.5, 1.4], [1.2, 2.1, 1.2]]) - model.origin
    found = [scan_station(build_scene(model, edits, props), p, np.eye(3), scanner, k) for k, p in enumerate(places)]
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


@pytest.fixture(scope="module")
def cut(house_model: BuildingModel) -> ChangeResult:
    """In the second epoch the upper half of the north wall is gone."""
    wall = next(k for k, e in enumerate(house_model.elements) if e.name == "North")
    middle = float(np.mean([bound[wall, 2] for bound in house_model.element_bounds]))
    edit = Edit("cut", direction=(0.0, 0.0, 1.0), removed=(middle, np.inf))
    return jobs.change(
        house_model, [_scan(house_model, {}, (HALL,)), _scan(house_model, {wall: edit}, (HALL,))], None,
        ChangeOptions(voxel=0.05, sample_spacing=0.1),
    )


def _shapes(of: bpy.types.Scene) -> list[bpy.types.Object]:
    return [item for item in of.objects if voxel_scene.REMAINING_KEY in item]


def _corners(item: bpy.types.Object) -> np.ndarray:
    bpy.context.view_layer.update()
    return np.array([item.matrix_world @ vertex.co for vertex in item.data.vertices])


def test_what_is_left_of_an_element_is_a_shape_in_its_place(
    blender: bpy.types.Scene, cut: ChangeResult, changed: ChangeResult
) -> None:
    (row,) = cut.remaining
    wall = cut.elements[row]
    for _ in range(2):
        change_scene.show_change(blender, cut)
    (shape,) = _shapes(blender)
    assert shape[voxel_scene.REMAINING_KEY] == wall.global_id
    assert [c.name for c in shape.users_collection] == [voxel_scene.REMAINING]
    left, planned = _corners(shape), _corners(scene.element_objects(blender)[wall.global_id])
    np.testing.assert_allclose(left.min(axis=0), planned.min(axis=0), atol=cut.edge)
    np.testing.assert_allclose(left[:, :2].max(axis=0), planned[:, :2].max(axis=0), atol=cut.edge)
    assert left[:, 2].max() == pytest.approx(planned[:, 2].mean(), abs=3 * cut.edge)
    assert shape["remaining_m3"] == pytest.approx(remaining_volume(cut, row))
    assert shape["remaining_m3"] + shape["gone_m3"] == pytest.approx(wall.volume)
    color = np.empty(4 * len(shape.data.vertices), np.float32)
    shape.data.attributes[scene.COLOR].data.foreach_get("color", color)
    np.testing.assert_allclose(color[:3], to_linear(np.array(CHANGE_COLORS[wall.state])), atol=1e-6)
    assert not shape.hide_get()
    blender.bim_verify_change.epoch = 1
    assert shape.hide_get()
    change_scene.show_change(blender, changed, only=[])
    assert len(_shapes(blender)) == 1, "the others keep what they have"
    change_scene.show_change(blender, changed)
    assert not _shapes(blender)
    change_scene.show_change(blender, cut)
    change_scene.forget(blender)
    assert not _shapes(blender)


def test_another_model_takes_the_changes_away(blender: bpy.types.Scene, changed: ChangeResult) -> None:
    change_scene.show_change(blender, changed)
    change_scene.forget(blender)
    assert not blender.bim_verify_change.summary
    assert not any(voxel_scene.VOXEL_KEY in item for item in blender.objects)
    assert all(change_scene.state_now(item) == "" for item in scene.element_objects(blender).values())


def test_gone_voxels_are_a_surface_and_the_second_result_replaces_the_first(
    blender: bpy.types.Scene, changed: ChangeResult
) -> None:
    for _ in range(2):
        change_scene.show_change(blender, changed)
    voxels = {item[voxel_scene.VOXEL_KEY]: item for item in blender.objects if voxel_scene.VOXEL_KEY in item}
    assert sum(voxel_scene.VOXEL_KEY in item for item in blender.objects) == len(voxels)
    assert {code for code, item in voxels.items() if item.hide_get()} == {0, 1}
    blender.bim_verify_change.epoch = 1
    assert all(item.hide_get() for item in voxels.values())
    blender.bim_verify_change.epoch = 2
    assert {code for code, item in voxels.items() if item.hide_get()} == {0, 1}
    gone = voxels[3].data
    assert len(gone.polygons) > 0 and voxel_scene.STATE in gone.attributes


def test_a_blend_file_is_saved(blender: bpy.types.Scene, changed: ChangeResult, tmp_path: Path) -> None:
    save_blend(changed, tmp_path / "change.blend")
    assert (tmp_path / "change.blend").stat().st_size > 1000


@pytest.fixture
def asked(changed: ChangeResult, monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, Any, ChangeOptions]]:
    """What the operator asks the job for; it gets a comparison that is there already."""
    calls: list[tuple[Any, Any, ChangeOptions]] = []

    def change(model, epochs, reference, options, progress):  # type: ignore[no-untyped-def]
        calls.append((epochs, reference, options))
        return changed

    monkeypatch.setattr(jobs, "change", change)
    return calls


def _add_scans(scene_of: bpy.types.Scene, house: Path, names: tuple[str, ...]) -> None:
    scene_of.bim_verify.model_path = str(house)
    for name in names:
        entry = scene_of.bim_verify.scans.add()
        entry.path, entry.use = name, True


def test_the_operator_hands_over_all_that_the_command_has(
    blender: bpy.types.Scene, house: Path, tmp_path: Path, asked: list[tuple[Any, Any, ChangeOptions]]
) -> None:
    _add_scans(blender, house, ("/a.e57", "/b.e57", "/c.e57"))
    settings = blender.bim_verify_change
    (tmp_path / "r.e57").touch(), (tmp_path / "s.e57").touch()
    add = bpy.ops.bim_verify.add_reference
    assert add(directory=str(tmp_path), files=[{"name": "r.e57"}, {"name": "s.e57"}]) == {"FINISHED"}
    assert add(filepath=str(tmp_path / "r.e57")) == {"FINISHED"} and len(settings.references) == 2
    settings.voxel_mm = 5000
    assert settings.voxel_mm == 1000, "as on the command line"
    settings.voxel_mm, settings.min_points, settings.loa, settings.date = 25, 4, "40", " 2025-03-31 "
    settings.registration_known, settings.registration_sigma_mm = True, 1.5
    for grouping, epochs in (
        ("ONE", [["/a.e57", "/b.e57", "/c.e57"]]),
        ("EACH", [["/a.e57"], ["/b.e57"], ["/c.e57"]]),
        ("NUMBERED", [["/b.e57"], ["/a.e57", "/c.e57"]]),
    ):
        settings.grouping = grouping
        for scan, number in zip(blender.bim_verify.scans, (5, 2, 5), strict=True):
            scan.epoch = number
        assert bpy.ops.bim_verify.change() == {"FINISHED"}
        assert asked[-1][0] == epochs and asked[-1][1] == [str(tmp_path / "r.e57"), str(tmp_path / "s.e57")]
    options = asked[-1][2]
    assert options.voxel == pytest.approx(0.025) and options.registration_sigma == pytest.approx(0.0015)
    assert (options.min_points, options.loa, options.date) == (4, 40, "2025-03-31")
    assert bpy.ops.bim_verify.remove_reference(index=0) == {"FINISHED"}
    assert bpy.ops.bim_verify.remove_reference(index=0) == {"FINISHED"}
    settings.loa, settings.date, settings.registration_known = "NONE", "", False
    assert bpy.ops.bim_verify.change() == {"FINISHED"}
    _, reference, options = asked[-1]
    assert reference is None and (options.loa, options.date, options.registration_sigma) == (None, "", None)


def test_what_align_found_holds_for_changes_too(
    blender: bpy.types.Scene, house: Path, changed: ChangeResult, asked: list[tuple[Any, Any, ChangeOptions]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    _add_scans(blender, house, ("/a.e57", "/b.e57"))
    blender.bim_verify_change.grouping = "EACH"
    moved = []
    monkeypatch.setattr(scene, "move_scans", lambda _, transform, paths: moved.append((transform, paths)))
    assert bpy.ops.bim_verify.change() == {"FINISHED"} and asked[-1][2].align == "none" and not moved
    blender.bim_verify.align = "fine"
    frame = np.diag([1.0, 1.0, 1.0, 1.0])
    frame[0, 3] = 5.0
    monkeypatch.setattr(project, "placement", lambda *_: frame)
    assert bpy.ops.bim_verify.change() == {"FINISHED"} and asked[-1][2].align == "fine"
    assert [paths for _, paths in moved] == [["/a.e57"], ["/b.e57"]]
    np.testing.assert_allclose(moved[0][0], frame)  # this comparison itself was not aligned
    assert "from the model" in blender.bim_verify_change.summary


def test_scans_of_one_epoch_move_alone(blender: bpy.types.Scene) -> None:
    nothing = np.zeros((1, 3))
    for path in ("/a.e57", "/b.e57"):
        scene.show_scan(blender, path, path, nothing, np.zeros(1, np.int32), None)
    there = np.eye(4)
    there[:3, 3] = (1.0, 2.0, 3.0)
    scene.move_scans(blender, there, ["/b.e57"])
    place = {item[scene.SCAN_KEY]: tuple(item.matrix_world.translation) for item in scene.scan_objects(blender)}
    assert place["/a.e57"] == pytest.approx((0.0, 0.0, 0.0)) and place["/b.e57"] == pytest.approx((1.0, 2.0, 3.0))


def test_bad_settings_are_one_sentence(
    blender: bpy.types.Scene, house: Path, asked: list[tuple[Any, Any, ChangeOptions]]
) -> None:
    _add_scans(blender, house, ("/a.e57",))
    blender.bim_verify_change.date = "soon"
    with pytest.raises(RuntimeError, match="Day of the last epoch takes a day like 2025-03-31, not 'soon'"):
        bpy.ops.bim_verify.change()
    with pytest.raises(RuntimeError, match="No scan file was given"):
        bpy.ops.bim_verify.add_reference(filepath="/no/such.e57")
    assert not asked and not blender.bim_verify_change.references


def test_after_the_job_colours_slider_numbers_and_files(
    blender: bpy.types.Scene, house: Path, changed: ChangeResult, asked: list[tuple[Any, Any, ChangeOptions]], tmp_path: Path
) -> None:
    _add_scans(blender, house, ("/a.e57", "/b.e57"))
    settings = blender.bim_verify_change
    assert not bpy.ops.bim_verify.export_change.poll()
    assert bpy.ops.bim_verify.change() == {"FINISHED"}
    assert settings.summary and settings.epochs == 2 and blender.bim_verify.color_mode == change_scene.MODE
    assert any(voxel_scene.VOXEL_KEY in item for item in blender.objects)
    column = next(e for e in changed.elements if e.ifc_class == "IfcColumn")
    item = scene.element_objects(blender)[column.global_id]
    assert change_scene.state_now(item) == "DISAPPEARED"
    settings.epoch = 1
    assert change_scene.state_now(item) == "CONFIRMED" and settings.epoch_name.startswith("epoch 1")
    rows = dict(CAPABILITY.numbers(item))
    assert " % gone" in rows["Shares"] and rows["Progress"] == column.progress
    assert CAPABILITY.why(item) == column.reason
    folder = tmp_path / "out"
    assert bpy.ops.bim_verify.export_change(filepath=str(folder)) == {"FINISHED"}
    assert sorted(path.name for path in folder.iterdir()) == ["change.json", "changed.ifc", "remaining", "report", "voxels.ply"]
    assert (folder / "report" / "index.html").stat().st_size > 1000
    written = ifcopenshell.open(str(folder / "changed.ifc"))
    sets = ifcopenshell.util.element.get_psets(written.by_guid(column.global_id))
    assert sets["BimVerify_Change"]["State"] == "DISAPPEARED"
    assert bpy.ops.bim_verify.export_change(filepath=str(tmp_path / "table"), model=False, page=False, voxels=False,
                                            remaining=False) == {"FINISHED"}
    assert [path.name for path in (tmp_path / "table").iterdir()] == ["change.json"]
    with pytest.raises(RuntimeError, match="is an input"):
        blender.bim_verify.scans[0].path = str(folder / "voxels.ply")
        bpy.ops.bim_verify.export_change(filepath=str(folder))
    with pytest.raises(RuntimeError, match="Give a folder"):
        bpy.ops.bim_verify.export_change(filepath=str(folder / "change.json"))
    change_scene.forget(blender)
    assert not bpy.ops.bim_verify.export_change.poll()


def test_changes_of_the_selection_leave_the_others(
    blender: bpy.types.Scene, house: Path, changed: ChangeResult, asked: list[tuple[Any, Any, ChangeOptions]], tmp_path: Path
) -> None:
    bpy.ops.bim_verify.import_ifc(filepath=str(house))
    _add_scans(blender, house, ("/a.e57",))
    column = next(e for e in changed.elements if e.ifc_class == "IfcColumn")
    items = scene.element_objects(blender)
    with pytest.raises(RuntimeError, match="No element is selected"):
        bpy.ops.bim_verify.change(selected_only=True)
    items[column.global_id].select_set(True)
    assert bpy.ops.bim_verify.change(selected_only=True) == {"FINISHED"}
    assert [key for key, item in items.items() if change_scene.state_now(item)] == [column.global_id]
    assert bpy.ops.bim_verify.export_ifc(filepath=str(tmp_path / "out.ifc")) == {"FINISHED"}
    file = ifcopenshell.open(str(tmp_path / "out.ifc"))
    have = [e.GlobalId for e in file.by_type("IfcElement") if "BimVerify_Change" in ifcopenshell.util.element.get_psets(e)]
    assert have == [column.global_id]


def test_a_saved_scene_knows_its_epochs_and_settings(blender: bpy.types.Scene, changed: ChangeResult) -> None:
    first, last = (replace(epoch, paths=(f"/{n}.e57", f"/{n}b.e57")) for n, epoch in enumerate(changed.epochs))
    shown = replace(
        changed, epochs=(last,), reference=replace(first, name="reference"),
        options=replace(changed.options, loa=20, date="2025-03-31", registration_sigma=0.002),
    )
    assert CAPABILITY.show(blender, shown)
    settings = blender.bim_verify_change
    assert [scan.name for scan in settings.references] == ["0.e57", "0b.e57"]
    assert [(scan.name, scan.epoch) for scan in blender.bim_verify.scans] == [("1.e57", 1), ("1b.e57", 1)]
    assert (settings.grouping, settings.loa, settings.date, settings.epochs) == ("ONE", "20", "2025-03-31", 3)
    assert settings.registration_known and settings.registration_sigma_mm == pytest.approx(2.0)
