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
