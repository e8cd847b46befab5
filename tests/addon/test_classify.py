"""The operators that write the classified cloud and the as-built model."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bpy
import ifcopenshell
import ifcopenshell.util.placement
import laspy
import numpy as np
import pye57
import pytest

from bim_verify.bim_verify_addon import scene, update_scene
from bim_verify.bim_verify_addon.headless import save_blend
from bim_verify.bim_verify_addon.session import SESSION
from bim_verify.cli import main
from bim_verify.core import jobs
from bim_verify.core.model.elements import BuildingModel
from bim_verify.core.model.property_sets import ElementProperties, put_property_sets
from bim_verify.core.model.write_psets import PSET_NAME as VERIFICATION
from bim_verify.core.options import ClassifyOptions
from bim_verify.core.update.update import update_file

ops = bpy.ops.bim_verify


@pytest.fixture
def floor_scan(tmp_path: Path) -> Path:
    """500 points on the floor of the house, and 100 in the air."""
    random = np.random.default_rng(0)
    points = random.uniform([0.4, 0.4, 0.0], [3.0, 2.6, 0.0], (600, 3))
    points[500:, 2] = random.uniform(0.5, 1.0, 100)
    path = tmp_path / "floor.xyz"
    np.savetxt(path, points, fmt="%.6f")
    return path


def test_the_cloud_is_written(blender: bpy.types.Scene, house: Path, floor_scan: Path, tmp_path: Path) -> None:
    assert not ops.classify.poll()
    ops.import_ifc(filepath=str(house))
    ops.import_scan(filepath=str(floor_scan))
    blender.bim_verify.origin = "2,1.5,1.5"
    assert ops.classify(filepath=str(tmp_path / "out")) == {"FINISHED"}
    file = pye57.E57(str(tmp_path / "out.e57"))
    counts = {file.get_header(k).node["name"].value(): file.get_header(k).point_count for k in range(file.scan_count)}
    assert counts == {"Floor": 500, "unassigned": 100}
    assert "600 returns" in blender.bim_verify_classify.summary
    assert ops.classify(filepath=str(tmp_path / "out.laz")) == {"FINISHED"}
    assert len(laspy.read(tmp_path / "out.laz").points) == 600
    ops.import_scan(filepath=str(tmp_path / "out.laz"))
    with pytest.raises(RuntimeError, match="never written"):
        ops.classify(filepath=str(tmp_path / "out.laz"))


def test_a_blend_file_shows_the_model(house_model: BuildingModel, floor_scan: Path, tmp_path: Path) -> None:
    found = jobs.classify(house_model, [floor_scan], ClassifyOptions(origin=(2.0, 1.5, 1.5)))
    save_blend(found, tmp_path / "found.blend")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "found.blend"))
    assert len(scene.element_objects(bpy.context.scene)) == len(house_model.elements)


def test_the_updated_model_is_written(
    verified: bpy.types.Scene, house: Path, house_model: BuildingModel, tmp_path: Path
) -> None:
    key = verified.bim_verify.result_key
    found = SESSION.results[key]
    chosen = next(k for k, e in enumerate(house_model.elements) if e.name == "North")
    SESSION.results[key] = replace(
        found,
        verdicts=tuple(
            replace(v, status="DEVIATING" if k == chosen else "CONFIRMED", significant=k == chosen, displacement=0.05,
                    displacement_vector=(0.0, 0.05, 0.0))
            for k, v in enumerate(found.verdicts)
        ),
    )
    assert ops.update_model(filepath=str(tmp_path / "as_built")) == {"FINISHED"}
    before, after = (
        {w.Name: ifcopenshell.util.placement.get_local_placement(w.ObjectPlacement)[:3, 3] for w in f.by_type("IfcWall")}
        for f in (ifcopenshell.open(str(house)), ifcopenshell.open(str(tmp_path / "as_built.ifc")))
    )
    np.testing.assert_allclose(after["North"] - before["North"], [0.0, 50.0, 0.0], atol=1e-9)
    np.testing.assert_array_equal(after["South"], before["South"])


def test_the_update_is_put_back(blender: bpy.types.Scene, house: Path, tmp_path: Path) -> None:
    ops.import_ifc(filepath=str(house))
    with pytest.raises(RuntimeError, match="nothing to undo"):
        ops.undo_update(filepath=str(tmp_path / "back.ifc"))
    assert list(tmp_path.iterdir()) == []
    file = ifcopenshell.open(str(house))
    wall = next(w for w in file.by_type("IfcWall") if w.Name == "North")
    planned = ifcopenshell.util.placement.get_local_placement(wall.ObjectPlacement)
    values = {
        "Status": ("IfcLabel", "DEVIATING"), "Significant": ("IfcBoolean", True), "DisplacementX": ("IfcLengthMeasure", 0.0),
        "DisplacementY": ("IfcLengthMeasure", 0.05), "DisplacementZ": ("IfcLengthMeasure", 0.0),
    }  # fmt: skip
    put_property_sets(file, VERIFICATION, [ElementProperties(wall.GlobalId, wall.id(), values)])
    update_file(file)
    file.write(str(tmp_path / "updated.ifc"))
    ops.import_ifc(filepath=str(tmp_path / "updated.ifc"))
    assert ops.undo_update(filepath=str(tmp_path / "back")) == {"FINISHED"}
    back = ifcopenshell.open(str(tmp_path / "back.ifc")).by_guid(wall.GlobalId)
    np.testing.assert_allclose(ifcopenshell.util.placement.get_local_placement(back.ObjectPlacement), planned, atol=1e-6)
    assert "put back" in blender.bim_verify_update.summary
    with pytest.raises(RuntimeError, match="never written"):
        ops.undo_update(filepath=str(tmp_path / "updated.ifc"))


def test_a_blend_file_shows_what_an_update_moved(house: Path, tmp_path: Path) -> None:
    file = ifcopenshell.open(str(house))
    wall = next(w for w in file.by_type("IfcWall") if w.Name == "North")
    values = {
        "Status": ("IfcLabel", "DEVIATING"), "Significant": ("IfcBoolean", True), "DisplacementX": ("IfcLengthMeasure", 0.0),
        "DisplacementY": ("IfcLengthMeasure", 0.05), "DisplacementZ": ("IfcLengthMeasure", 0.0),
    }  # fmt: skip
    put_property_sets(file, VERIFICATION, [ElementProperties(wall.GlobalId, wall.id(), values)])
    file.write(str(tmp_path / "verified.ifc"))
    blend = tmp_path / "moved.blend"
    arguments = ["update", str(tmp_path / "verified.ifc"), "--out", str(tmp_path / "o.ifc"), "--blend", str(blend), "--quiet"]
    assert main(arguments) == 0
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    items = scene.element_objects(bpy.context.scene)
    moved = items[wall.GlobalId]
    before = next(i for i in bpy.context.scene.objects if i.get(update_scene.PLANNED_KEY) == wall.GlobalId)
    np.testing.assert_allclose(moved.matrix_world.translation - before.matrix_world.translation, [0, 0.05, 0], atol=1e-5)
    assert before.display_type == "WIRE"
    assert moved[update_scene.KIND_KEY] == "MOVED" and scene.COLOR in moved.data.attributes
