"""The facade operators: rectangles before the photo, corrected by hand, written as a model."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bpy
import ifcopenshell
import numpy as np
import pytest

from bim_verify.bim_verify_addon import facade_scene

from ..core.facade_data import photo_of

ops = bpy.ops.bim_verify


@pytest.fixture
def read(blender: bpy.types.Scene, tmp_path: Path) -> list[bpy.types.Object]:
    """The rectangles of a facade that was read."""
    photo = photo_of(tmp_path, 1)
    corners = ",".join(f"{v:.1f}" for v in photo.corners.ravel())
    assert ops.facade(filepath=str(photo.path), corners=corners, width=photo.plan.width) == {"FINISHED"}
    return [i for i in blender.objects if facade_scene.BOX_KEY in i]


def test_corrections_are_written(blender: bpy.types.Scene, read: list[bpy.types.Object], tmp_path: Path) -> None:
    count = len(read)
    assert count > 5
    assert "windows" in blender.bim_verify_facade.summary
    windows = sorted((i for i in read if i[facade_scene.KIND_KEY] == "window"), key=lambda i: (-i.location.z, i.location.x))
    for item in read:  # what drawing the panel of a selected rectangle does
        assert item.bim_verify_facade.kind == item[facade_scene.KIND_KEY].upper()
    moved, gone = windows[0], windows[1]
    before = {(round(b.x0, 3), round(b.z0, 3)) for b in facade_scene.read_mockup(blender).facades[0].boxes}
    moved.location.x += 0.25
    moved.scale.x = 0.5
    bpy.data.objects.remove(gone)
    path = tmp_path / "corrected.ifc"
    assert ops.write_facade(filepath=str(path)) == {"FINISHED"}
    file = ifcopenshell.open(str(path))
    assert len(file.by_type("IfcWindow")) + len(file.by_type("IfcDoor")) == count - 1
    after = {(round(b.x0, 3), round(b.z0, 3)) for b in facade_scene.read_mockup(blender).facades[0].boxes}
    assert len(after - before) == 1
    assert len(before - after) == 2
    widths = sorted(w.OverallWidth for w in file.by_type("IfcWindow"))
    assert np.isclose(widths[0], 0.5 * widths[-1], atol=0.15)


def test_nothing_left_is_said(blender: bpy.types.Scene, read: list[bpy.types.Object], tmp_path: Path) -> None:
    for item in read:
        bpy.data.objects.remove(item)
    with pytest.raises(RuntimeError, match="No window or door is left"):
        ops.write_facade(filepath=str(tmp_path / "none.ifc"))
    assert not (tmp_path / "none.ifc").exists()


def test_bad_corners_leave_the_scene(blender: bpy.types.Scene, tmp_path: Path) -> None:
    photo = photo_of(tmp_path, 1)
    with pytest.raises(RuntimeError, match="four corners"):
        ops.facade(filepath=str(photo.path), corners="1,2,3", width=10.0)
    assert facade_scene.DATA_KEY not in blender


def test_a_straight_top_becomes_arched_and_back(blender: bpy.types.Scene, read: list[bpy.types.Object]) -> None:
    item = next(i for i in read if not facade_scene.rise_of(i))
    choice = item.bim_verify_facade
    assert choice.shape == "RECTANGULAR"
    choice.shape = "ARCHED"
    assert choice.rise == pytest.approx(0.2 * item.dimensions.x)
    choice.shape = "RECTANGULAR"
    assert choice.rise == 0.0


def test_what_the_pattern_gave_stays_inferred_until_it_is_moved(
    blender: bpy.types.Scene, read: list[bpy.types.Object]
) -> None:
    made = facade_scene.read_mockup(blender)
    boxes = made.facades[0].boxes
    made.facades[0].boxes = (replace(boxes[0], inferred=True), *boxes[1:])
    facade_scene.show_mockup(blender, made)
    assert [b.inferred for b in facade_scene.read_mockup(blender).facades[0].boxes].count(True) == 1
    next(i for i in blender.objects if facade_scene.INFERRED_KEY in i).location.z += 0.1
    assert not any(b.inferred for b in facade_scene.read_mockup(blender).facades[0].boxes)


def test_several_photos_stand_on_a_footprint_in_map_coordinates(blender: bpy.types.Scene, tmp_path: Path) -> None:
    photos = [photo_of(tmp_path, seed, size=600) for seed in (3, 9)]
    w = [p.plan.width for p in photos]
    corners = ";".join(",".join(f"{v:.1f}" for v in p.corners.ravel()) for p in photos)
    east, north = 691000.0, 5334000.0
    ring = [(east, north), (east + w[0], north), (east + w[0], north + w[1]), (east, north + w[1])]
    blender.bim_verify_facade.footprint = " ".join(f"{x},{y}" for x, y in ring)
    done = ops.facade(
        directory=str(tmp_path), files=[{"name": p.path.name} for p in photos], corners=corners, crs="EPSG:25832",
    )  # fmt: skip
    assert done == {"FINISHED"}
    assert {i[facade_scene.BOX_KEY] for i in blender.objects if facade_scene.BOX_KEY in i} == {0, 1}
    path = tmp_path / "house.ifc"
    assert ops.write_facade(filepath=str(path)) == {"FINISHED"}
    file = ifcopenshell.open(str(path))
    assert {v.RelatingBuildingElement.Name for v in file.by_type("IfcRelVoidsElement")} == {"Wall 1", "Wall 2"}
    (conversion,) = file.by_type("IfcMapConversion")
    assert (conversion.Eastings, conversion.Northings, conversion.TargetCRS.Name) == (east, north, "EPSG:25832")
    with pytest.raises(RuntimeError, match="footprint"):
        ops.facade(directory=str(tmp_path), files=[{"name": p.path.name} for p in photos], footprint="")


def test_the_report_shows_the_corrected_rectangles(
    blender: bpy.types.Scene, read: list[bpy.types.Object], tmp_path: Path
) -> None:
    (picture,) = facade_scene.read_pictures(blender)
    assert picture.std() > 10
    bpy.data.objects.remove(read[0])
    assert ops.write_facade(filepath=str(tmp_path / "made.ifc"), with_report=True) == {"FINISHED"}
    page = (tmp_path / "made_report" / "index.html").read_text()
    assert page.count("data:image/jpeg;base64,") == 2
    assert "Facade -&gt; split(z)" in page
    photo = tmp_path / "photo.ifc"
    data = blender[facade_scene.DATA_KEY]
    blender[facade_scene.DATA_KEY] = data.replace(next(tmp_path.glob("*.png")).name, photo.name)
    photo.write_text("an input")
    with pytest.raises(RuntimeError, match="is an input"):
        ops.write_facade(filepath=str(photo))
    blender[facade_scene.DATA_KEY] = data
    bpy.data.objects.remove(next(i for i in blender.objects if facade_scene.PHOTO_KEY in i))
    with pytest.raises(RuntimeError, match="was deleted"):
        ops.write_facade(filepath=str(tmp_path / "again.ifc"), with_report=True)
    assert not (tmp_path / "again.ifc").exists()
