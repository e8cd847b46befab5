"""What a person does to our objects, links or copies: a result comes whole all the same, or not at all."""

from __future__ import annotations

from pathlib import Path

import bpy
import ifcopenshell
import pytest

from bim_verify.bim_verify_addon import bonsai, scene
from bim_verify.bim_verify_addon.session import SESSION

from .test_jobs import FakeOperator, drive, fake_context

ops = bpy.ops.bim_verify


def select(*items: bpy.types.Object) -> None:
    bpy.ops.object.select_all(action="DESELECT")
    for item in items:
        item.select_set(True)
        bpy.context.view_layer.objects.active = item


def statuses(of: bpy.types.Scene) -> list[str]:
    return [item.bim_verify.status for item in scene.element_objects(of).values()]


def test_an_element_that_is_no_mesh_any_more_gets_a_new_object(verified: bpy.types.Scene) -> None:
    key, item = next(iter(scene.element_objects(verified).items()))
    name = item.name
    select(item)
    bpy.ops.object.convert(target="CURVE")
    assert bpy.data.objects[name].type == "CURVE"
    verified.bim_verify.color_mode = "DEVIATION"
    assert ops.verify() == {"FINISHED"}
    assert scene.element_objects(verified)[key].name != name and all(statuses(verified))


def test_a_foreign_attribute_of_our_name_gives_way(verified: bpy.types.Scene) -> None:
    mesh = next(iter(scene.element_objects(verified).values())).data
    mesh.attributes.remove(mesh.attributes[scene.DEVIATION])
    mesh.attributes.new(scene.DEVIATION, "INT", "FACE")
    verified.bim_verify.color_mode = "DEVIATION"
    assert ops.verify() == {"FINISHED"}
    assert (mesh.attributes[scene.DEVIATION].data_type, mesh.attributes[scene.DEVIATION].domain) == ("FLOAT", "POINT")


def test_linked_elements_are_left_alone(
    verified: bpy.types.Scene, house: Path, scan: Path, tmp_path: Path
) -> None:
    library = tmp_path / "library.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(library))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    here = bpy.context.scene
    with bpy.data.libraries.load(str(library), link=True) as (found, taken):
        taken.collections = [name for name in found.collections if name == scene.ROOT]
    here.collection.children.link(taken.collections[0])
    linked = [item for item in here.objects if item.library is not None]
    before = [item.bim_verify.status for item in linked]
    for run in (lambda: ops.import_ifc(filepath=str(house)), lambda: ops.import_scan(filepath=str(scan)), ops.verify):
        assert run() == {"FINISHED"}
    assert len(scene.element_objects(here)) == len(before) - len(scene.scan_objects(here)) and all(statuses(here))
    assert [item.bim_verify.status for item in linked] == before


def test_of_copies_the_first_one_is_the_element(verified: bpy.types.Scene) -> None:
    key, item = next(iter(scene.element_objects(verified).items()))
    select(item)
    bpy.ops.object.duplicate()
    copy = bpy.context.view_layer.objects.active
    copy.location.x += 5.0
    place = tuple(copy.location)
    assert copy != item and scene.element_objects(verified)[key] == item
    select(copy)
    ops.decide(status="PARTIAL", reason="seen", author="me")
    assert item.bim_verify.decided_status == "PARTIAL"
    ops.verify()
    assert tuple(copy.location) == place


def test_of_two_elements_with_one_global_id_the_selected_one_is_decided_on(verified: bpy.types.Scene) -> None:
    first, other, *_ = scene.element_objects(verified).values()
    other[scene.SECOND_KEY] = f"{first[scene.GUID_KEY]} #7"
    other[scene.GUID_KEY] = first[scene.GUID_KEY]
    select(other)
    ops.decide(status="PARTIAL", reason="seen", author="me")
    assert (first.bim_verify.decided_status, other.bim_verify.decided_status) == ("", "PARTIAL")


def test_a_linked_copy_of_a_scene_gets_objects_of_its_own(verified: bpy.types.Scene, house: Path) -> None:
    before = {key: (item.name, item.bim_verify.status) for key, item in scene.element_objects(verified).items()}
    bpy.ops.scene.new(type="LINK_COPY")
    copy = bpy.context.scene
    assert copy != verified and len(scene.element_objects(copy)) == len(before)
    assert ops.import_ifc(filepath=str(house)) == {"FINISHED"}
    ours, theirs = set(scene.element_objects(copy).values()), set(scene.element_objects(verified).values())
    assert len(ours) == len(before) and not ours & theirs
    assert {key: (item.name, item.bim_verify.status) for key, item in scene.element_objects(verified).items()} == before


def test_the_selection_alone_is_verified_only_where_the_rest_is_known(verified: bpy.types.Scene) -> None:
    item = next(iter(scene.element_objects(verified).values()))
    SESSION.clear()
    select(item)
    for thing in scene.element_objects(verified).values():
        thing.bim_verify.reason = "old"
    assert ops.verify(selected_only=True) == {"FINISHED"}
    assert all(thing.bim_verify.reason != "old" for thing in scene.element_objects(verified).values())


def test_a_scan_under_another_spelling_is_no_second_one(
    verified: bpy.types.Scene, scan: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(scan.parent)
    other = tmp_path / "other.xyz"
    other.symlink_to(scan)
    for path in (scan.name, str(other), str(scan.parent / "." / scan.name)):
        assert ops.import_scan(filepath=path) == {"FINISHED"}
    assert len(verified.bim_verify.scans) == len(scene.scan_objects(verified)) == 1


def test_a_result_for_another_project_of_bonsai_is_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    files = iter([object(), object(), object()])
    monkeypatch.setattr(bonsai, "live_file", lambda: next(files))
    operator, context = FakeOperator(lambda progress: 1), fake_context()
    operator.start(context)
    assert drive(operator, context) == {"CANCELLED"}
    assert "another one now" in operator.reports[0][1] and operator.finished == []


def test_a_storey_called_like_a_collection_of_ours_has_its_own(
    blender: bpy.types.Scene, house: Path, scan: Path, tmp_path: Path
) -> None:
    file = ifcopenshell.open(str(house))
    for storey in file.by_type("IfcBuildingStorey"):
        storey.Name = scene.SCANS
    file.write(str(tmp_path / "scans.ifc"))
    ops.import_ifc(filepath=str(tmp_path / "scans.ifc"))
    ops.import_scan(filepath=str(scan))
    of_scan = scene.scan_objects(blender)[0].users_collection
    assert not any(set(item.users_collection) & set(of_scan) for item in scene.element_objects(blender).values())
