"""Photos in Blender: cameras stand where they were found, see what the images show, and carry their state."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector
from PIL import Image

from bim_verify.bim_verify_addon import overlay, photo_scene, project
from bim_verify.bim_verify_addon.capabilities import CAPABILITIES
from bim_verify.bim_verify_addon.session import SESSION
from bim_verify.core.imagery.cameras_file import CameraList, KnownCamera, camera_to_plain, read_cameras
from bim_verify.core.imagery.coregistration import CoregistrationResult
from bim_verify.core.jobs import coregister as job
from bim_verify.core.model.elements import BuildingModel
from bim_verify.core.simulation.photo import photograph

from ..core.photo_data import LENS, camera, room

ops = bpy.ops.bim_verify


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A photo and its cameras file with a coarse pose."""
    folder = tmp_path_factory.mktemp("photos")
    Image.fromarray(photograph(room(), camera())).save(folder / "room.png")
    coarse = camera().moved(np.radians([0.5, -0.4, 0.3]), np.array([0.08, -0.05, 0.06]))
    (folder / "cameras.json").write_text(json.dumps({"cameras": [camera_to_plain(coarse)]}))
    return folder


@pytest.fixture(scope="module")
def result(files: Path) -> CoregistrationResult:
    coarse = KnownCamera(camera().moved(np.radians([0.5, -0.4, 0.3]), np.array([0.08, -0.05, 0.06])))
    return job.coregister(room(), [files / "room.png"], CameraList((coarse,)))


def test_the_operator_places_cameras_with_their_images(
    blender: bpy.types.Scene, house: Path, files: Path, result: CoregistrationResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = {}

    def stand_in(model: BuildingModel, images: list[Path], cameras: CameraList, *_: object) -> CoregistrationResult:
        given["images"], given["cameras"] = images, cameras
        return result

    monkeypatch.setattr(job, "coregister", stand_in)
    ops.import_ifc(filepath=str(house))
    ops.coregister(filepath=str(files / "cameras.json"))
    assert SESSION.job is None
    assert [p.name for p in given["images"]] == ["room.png"] and len(given["cameras"].cameras) == 1
    item = next(i for i in blender.objects if i.type == "CAMERA")
    assert item["bim_verify_state"] == "REFINED" and blender.camera == bpy.context.view_layer.objects.active == item
    assert item["note"].startswith("Position to ") and "lines" in item["note"]
    assert Path(item.data.background_images[0].image.filepath).name == "room.png"
    assert "1 of 1 images" in blender[photo_scene.SUMMARY_KEY]
    step = next(c.step for c in CAPABILITIES if c.name == "photos")
    assert step.state(blender).done
    edges = next(i for i in blender.objects if i.name.endswith("edges"))
    kept = [m for m in result.registrations[0].matches if m.kept]
    residual = np.empty(len(edges.data.vertices), np.float32)
    edges.data.attributes[photo_scene.RESIDUAL].data.foreach_get("value", residual)
    assert np.allclose(residual, np.repeat([abs(m.residual) for m in kept], 6))
    corners = np.array([v.co for v in edges.data.vertices]) + edges.matrix_world.translation
    for k, match in enumerate(kept):  # a bar lies along its edge
        ends = corners[6 * k : 6 * k + 6].reshape(2, 3, 3).mean(axis=1)
        assert np.allclose(ends, match.edge + result.model.origin, atol=1e-4)
    titles = dict(overlay.legends(blender))
    assert titles["Photos"].ramp.ticks[-1] == (1.0, "3 px")


def test_placed_photos_are_written(
    blender: bpy.types.Scene, house: Path, files: Path, result: CoregistrationResult, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(job, "coregister", lambda *_: result)
    ops.import_ifc(filepath=str(house))
    assert not ops.export_cameras.poll()
    ops.coregister(filepath=str(files / "cameras.json"))
    assert ops.export_cameras(filepath=str(tmp_path / "photos")) == {"FINISHED"}
    assert sorted(p.name for p in (tmp_path / "photos").iterdir()) == ["cameras_refined.json", "coregistration.json", "report"]
    again = read_cameras(tmp_path / "photos" / "cameras_refined.json").cameras[0].camera
    assert np.allclose(again.position, result.registrations[0].camera.position + result.model.origin)
    assert "</html>" in (tmp_path / "photos" / "report" / "index.html").read_text(encoding="utf-8")
    lines = json.loads((tmp_path / "photos" / "coregistration.json").read_text())["cameras"][0]["lines"]
    assert len(lines) == len(result.registrations[0].matches)
    (files / "cameras_refined.json").write_text((files / "cameras.json").read_text())
    ops.coregister(filepath=str(files / "cameras_refined.json"))
    with pytest.raises(RuntimeError, match="cameras_refined"):  # the file that the photos were placed from
        ops.export_cameras(filepath=str(files))
    SESSION.photos.clear()
    assert not ops.export_cameras.poll()


def test_before_and_after_are_two_cameras(blender: bpy.types.Scene, result: CoregistrationResult) -> None:
    assert photo_scene.show(blender, result)
    after, before = (photo_scene.pose_of(blender, "room.png", given=given) for given in (False, True))
    assert after is not None and before is not None and blender.camera == after
    bpy.context.view_layer.update()
    moved = np.array(before.matrix_world.translation) - np.array(after.matrix_world.translation)
    found = result.registrations[0]
    assert np.allclose(moved, found.coarse.camera.position - found.camera.position, atol=1e-5)
    assert ops.look_through(image="room.png", given=True) == {"FINISHED"} and blender.camera == before
    assert ops.look_through() == {"FINISHED"} and blender.camera == after
    with pytest.raises(RuntimeError, match=r"no camera of other\.png"):
        ops.look_through(image="other.png")


def test_a_dense_cloud_is_no_scan(blender: bpy.types.Scene) -> None:
    settings = blender.bim_verify
    for path, dense, stations in (("/there/project.json", False, 48), ("/there/dense.ply", True, 1)):
        entry = settings.scans.add()
        entry.path, entry.name, entry.dense, entry.stations = path, Path(path).name, dense, stations
    assert project.scan_paths(settings) == [str(Path("/there/project.json"))]
    assert project.options(settings).dense == (str(Path("/there/dense.ply")),)
    step = next(c.step for c in CAPABILITIES if c.name == "scans")
    assert step.state(blender).text.endswith("48 stations")
    settings.scans[0].use = False
    assert not step.state(blender).done and "Dense" in step.state(blender).text


def test_a_shown_camera_sees_points_where_the_image_has_them(
    blender: bpy.types.Scene, result: CoregistrationResult
) -> None:
    assert photo_scene.show(blender, result)
    blender.render.resolution_x, blender.render.resolution_y = LENS.width, LENS.height
    item = next(i for i in blender.objects if i.type == "CAMERA")
    bpy.context.view_layer.update()
    straight = replace(result.camera(0), interior=replace(LENS, distortion=(0.0,) * 5))
    for place in ((2.0, 3.9, 1.0), (4.4, 1.5, 1.9), (3.0, 3.9, 2.0)):
        seen = world_to_camera_view(blender, item, Vector(place))
        pixel = straight.project(np.array([place]))[0]
        assert seen[0] * LENS.width - 0.5 == pytest.approx(pixel[0], abs=0.3)
        assert (1 - seen[1]) * LENS.height - 0.5 == pytest.approx(pixel[1], abs=0.3)


def test_without_images_beside_the_file_it_says_so(blender: bpy.types.Scene, house: Path, tmp_path: Path) -> None:
    (tmp_path / "cameras.json").write_text(json.dumps({"cameras": [camera_to_plain(camera())]}))
    ops.import_ifc(filepath=str(house))
    with pytest.raises(RuntimeError, match="lies beside it"):
        ops.coregister(filepath=str(tmp_path / "cameras.json"))


def test_labels_without_endings_and_sub_folders_find_their_images(
    blender: bpy.types.Scene, house: Path, files: Path, result: CoregistrationResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = {}

    def stand_in(model: BuildingModel, images: list[Path], cameras: CameraList, *_: object) -> CoregistrationResult:
        given["images"] = images
        return result

    monkeypatch.setattr(job, "coregister", stand_in)
    (files / "labels.json").write_text(json.dumps({"cameras": [camera_to_plain(camera("some/folder/room"))]}))
    ops.import_ifc(filepath=str(house))
    ops.coregister(filepath=str(files / "labels.json"))
    assert [p.name for p in given["images"]] == ["room.png"]
