"""A model far away is shown near zero, and nothing is lost on the way."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import bpy
import ifcopenshell.util.geolocation
import numpy as np
import pytest

from bim_verify.bim_verify_addon import frame, project, scene
from bim_verify.bim_verify_addon.session import SESSION
from bim_verify.core.model.elements import BuildingModel
from bim_verify.core.results import VerificationResult


def test_frame_is_the_false_origin_that_ifcopenshell_computes() -> None:
    view = frame.ViewFrame((500_000.25, 4_000_000.5, 30.0), math.radians(17.0))
    p = np.array([500_012.5, 4_000_003.125, 33.0])
    expected = ifcopenshell.util.geolocation.enh2xyz(*p, *view.origin, math.cos(view.angle), math.sin(view.angle))
    assert np.allclose(view.to_view(p), expected, atol=1e-9)
    assert np.allclose(view.to_model(view.to_view(p)), p, atol=1e-9)


def test_frame_is_kept_in_double_precision(blender: bpy.types.Scene) -> None:
    chosen = frame.ViewFrame((500_000.123456789, -4_000_000.987654321, 1.0), 0.1)
    frame.store(blender, chosen)
    assert frame.stored(blender) == chosen


def test_near_models_keep_their_coordinates(blender: bpy.types.Scene, house_model: BuildingModel) -> None:
    project.adopt_frame(blender, house_model)
    assert frame.stored(blender) == frame.ViewFrame()


def test_far_model_and_scan_meet_near_zero(blender: bpy.types.Scene, house_model: BuildingModel) -> None:
    far = np.array([600_000.0, 5_300_000.0, 400.0])
    model = replace(house_model, origin=house_model.origin + far)
    project.adopt_frame(blender, model)
    scene.show_model(blender, model)
    cloud = house_model.vertices + model.origin
    item = scene.show_scan(blender, "x.e57", "x", cloud, np.zeros(len(cloud), np.int32), None)
    bpy.context.view_layer.update()

    def world(thing: bpy.types.Object) -> np.ndarray:
        return np.array([thing.matrix_world @ v.co for v in thing.data.vertices])

    assert np.abs(world(item)).max() < 10
    walls = np.concatenate([world(o) for o in scene.element_objects(blender).values()])
    nearest = np.linalg.norm(walls[:, None] - world(item)[None], axis=2).min(axis=1)
    assert nearest.max() < 1e-5
    view = frame.stored(blender)
    assert view is not None
    back = view.to_model(world(item))
    assert np.abs(back - cloud).max() < 1e-5


def test_everything_moves_when_the_frame_changes(blender: bpy.types.Scene, house_model: BuildingModel) -> None:
    project.adopt_frame(blender, house_model)
    scene.show_model(blender, house_model)
    before = {g: o.matrix_world.translation.copy() for g, o in scene.element_objects(blender).items()}
    frame.store(blender, frame.ViewFrame((10.0, 20.0, 30.0), math.radians(90)))
    bpy.context.view_layer.update()
    for identifier, item in scene.element_objects(blender).items():
        x, y, z = before[identifier] - type(before[identifier])((10.0, 20.0, 30.0))
        assert tuple(item.matrix_world.translation) == pytest.approx((y, -x, z), abs=1e-5)
        assert item.rotation_euler.z == pytest.approx(-math.pi / 2)


def test_aligned_scan_goes_where_the_transform_says(blender: bpy.types.Scene, result: VerificationResult) -> None:
    frame.store(blender, frame.ViewFrame((1.0, 2.0, 3.0), 0.3))
    points = np.random.default_rng(1).uniform(-5, 5, (50, 3))
    item = scene.show_scan(blender, "a.e57", "a", points, np.zeros(50, np.int32), None)
    c, s = math.cos(0.7), math.sin(0.7)
    transform = np.array([[c, -s, 0, 4], [s, c, 0, 5], [0, 0, 1, 6], [0, 0, 0, 1]], dtype=float)
    scene.move_scans(blender, transform)
    bpy.context.view_layer.update()
    shown = np.array([item.matrix_world @ v.co for v in item.data.vertices])
    view = frame.stored(blender)
    assert view is not None
    expected = view.to_view(points @ transform[:3, :3].T + transform[:3, 3])
    assert np.abs(shown - expected).max() < 1e-5


@pytest.mark.parametrize("known", [True, False])
def test_scans_added_later_lie_where_the_model_puts_them(
    verified: bpy.types.Scene, scan: Path, monkeypatch: pytest.MonkeyPatch, known: bool
) -> None:
    """In a scene that was renamed, and in a file that was opened again."""
    asked: list[BuildingModel | None] = []
    monkeypatch.setattr(project, "placement", lambda model, *_: asked.append(model) or np.eye(4))
    verified.name = "Another name"
    if not known:
        SESSION.clear()
    assert bpy.ops.bim_verify.import_scan(filepath=str(scan)) == {"FINISHED"}
    assert [model.content_hash for model in asked if model is not None] == [verified.bim_verify.verified_model]


def test_without_its_model_a_scan_is_shown_where_its_file_puts_it(
    verified: bpy.types.Scene, scan: Path, tmp_path: Path
) -> None:
    SESSION.clear()
    verified.bim_verify.model_path = str(tmp_path / "gone.ifc")
    assert bpy.ops.bim_verify.import_scan(filepath=str(scan)) == {"FINISHED"}
    assert len(scene.scan_objects(verified)) == 1
