"""A bundle in Blender: cameras and tie points stand where the adjustment puts them, and the project is written."""

from __future__ import annotations

import json
from pathlib import Path

import bpy
import numpy as np
import pytest

from bim_verify.bim_verify_addon import bundle_scene, overlay
from bim_verify.bim_verify_addon.capabilities import CAPABILITIES
from bim_verify.bim_verify_addon.session import SESSION
from bim_verify.core.imagery.bundle_project import read_project

from ..core.imagery_data import bundle
from ..core.test_imagery_imports import as_json

ops = bpy.ops.bim_verify


@pytest.fixture
def project_file(tmp_path: Path) -> Path:
    content = as_json(bundle(3)[0])
    content["observations"] = [row for row in content["observations"] if row[1] != 70 or row[0] == 0]
    (tmp_path / "block.json").write_text(json.dumps(content))
    return tmp_path / "block.json"


def test_the_operator_adjusts_writes_and_shows(blender: bpy.types.Scene, project_file: Path) -> None:
    ops.bundle(filepath=str(project_file))
    assert SESSION.job is None
    written = project_file.with_name("block_adjusted.json")
    adjusted = read_project(written)
    assert json.loads(written.read_text())["points_left_out"] == [70]
    points = next(i for i in blender.objects if i.name == "Tie points")
    bpy.context.view_layer.update()
    corners = np.array([points.matrix_world @ v.co for v in points.data.vertices])
    assert np.allclose(corners, adjusted.points, atol=1e-4) and len(corners) == 79
    sigma = np.empty(79, np.float32)
    points.data.attributes[bundle_scene.SIGMA].data.foreach_get("value", sigma)
    assert 0 < sigma.min() < sigma.max() < 0.01
    cameras = {i.name: i for i in blender.objects if i.type == "CAMERA"}
    for camera in adjusted.cameras:
        assert np.allclose(cameras[camera.name].matrix_world.translation, camera.position, atol=1e-4)
        assert cameras[camera.name]["note"].startswith("Position to ")
    assert "8 photos and 79 tie points" in blender[bundle_scene.SUMMARY_KEY]
    step = next(c.step for c in CAPABILITIES if c.name == "photos")
    assert step.state(blender).done
    assert dict(overlay.legends(blender))["Photos"].ramp.ticks[-1] == (1.0, "10 mm")
    ops.bundle(filepath=str(project_file), adjusted=str(project_file.with_name("other.json")))
    assert project_file.with_name("other.json").is_file()
    assert sum(i.type == "CAMERA" for i in blender.objects) == 8


def test_the_project_itself_is_never_written_to(blender: bpy.types.Scene, project_file: Path) -> None:
    before = project_file.read_bytes()
    with pytest.raises(RuntimeError):
        ops.bundle(filepath=str(project_file), adjusted=str(project_file))
    assert project_file.read_bytes() == before


def test_what_is_missing_is_said(blender: bpy.types.Scene, project_file: Path, house: Path) -> None:
    with pytest.raises(RuntimeError, match="no model to tie"):
        ops.bundle(filepath=str(project_file), on_model=True)
    ops.import_ifc(filepath=str(house))
    with pytest.raises(RuntimeError, match="lies beside it"):
        ops.bundle(filepath=str(project_file), on_model=True)
