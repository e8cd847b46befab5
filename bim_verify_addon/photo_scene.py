"""Photos in the scene: cameras with their images behind, and the model's edges that fixed them, coloured by residual."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from ..core.imagery.camera import PHOTOGRAMMETRIC, Camera
from ..core.report import palette
from . import frame, project, scene
from .colors import Legend, scale_of
from .materials import surface_material

if TYPE_CHECKING:
    from ..core.imagery.coregistration import CoregistrationResult
    from ..core.imagery.register_image import ImageRegistration

PHOTOS = "Photos"
PHOTO_KEY = "bim_verify_photo"
"""On everything that stands for a photo: the image's name."""
AS_GIVEN = "as given"
"""State of the camera that stands where the cameras file puts it."""
SUMMARY_KEY = "bim_verify_photos"
"""On the scene: what the last registration found, in one sentence."""
RESULT_KEY = "bim_verify_photos_result"
"""On the scene: key of the registration in ``session.SESSION.photos``."""
CAMERAS_KEY = "bim_verify_photos_cameras"
"""On the scene: path of the cameras file that the photos were placed from."""
RESIDUAL = "bv_residual"
"""Per vertex of the matched edges: distance of the image line from the projected edge, pixels."""
RESIDUAL_STOPS = ("#56b4e9", "#f0e442", "#d55e00")
"""From no residual to the worst: told apart by lightness and hue, on photos and on grey models."""
WORST_PX = 3.0
"""Residual with the last colour."""
BAR_M = 0.02
"""Radius of the bars that matched edges are drawn as: views colour faces, and not lines."""


def show_photos(target: bpy.types.Scene, result: CoregistrationResult) -> str:
    """Two cameras per image (as given, as placed) and its matched edges; what was there before is replaced."""
    from ..core.imagery.coregistration import state_of

    clear(target)
    if not scene.element_objects(target):
        scene.show_model(target, result.model)
    place = frame.stored(target) or frame.ViewFrame()
    states = [state_of(found) for found in result.registrations]
    for index, (path, found) in enumerate(zip(result.images, result.registrations, strict=True)):
        name = Path(path).name
        lens = result.camera(index).interior
        for label, pose, state, note in (
            (name, result.camera(index), states[index], _note(found)),
            (f"{name} {AS_GIVEN}", replace(found.coarse.camera, interior=lens), AS_GIVEN, "The pose of the cameras file"),
        ):
            item = camera_object(label, pose, pose.position + result.model.origin, place, path)
            _keep(target, item, name)
            item["bim_verify_state"], item["note"] = state, note
        _edges(target, name, found, result.model.origin, place)
    if target.camera is None or PHOTO_KEY in target.camera:
        target.camera = pose_of(target, Path(result.images[0]).name)
    scene.show_colors_in_views()
    target[SUMMARY_KEY] = f"{result.placed} of {len(states)} images are placed on the model."
    return str(target[SUMMARY_KEY])


def pose_of(target: bpy.types.Scene, name: str, *, given: bool = False) -> bpy.types.Object | None:
    """The camera of the image ``name``, as placed or as given; None where there is none (any more)."""
    cameras = (i for i in target.objects if i.type == "CAMERA" and i.get(PHOTO_KEY) == name)
    return next((i for i in cameras if (i["bim_verify_state"] == AS_GIVEN) == given), None)


def _note(found: ImageRegistration) -> str:
    """How well an image is placed: standard deviations, how many lines fixed it, what stayed open."""
    from ..core.imagery.coregistration import is_placed, sigmas

    said = [found.note] if found.note else []
    if found.covariance is not None and is_placed(found):
        rotation, position = sigmas(found.covariance)
        used = sum(match.kept for match in found.matches)
        said.append(
            f"Position to {1000 * position:.1f} mm, direction to {np.degrees(rotation):.3f} degrees (one sigma), "
            f"by {used} lines"
        )
    return ". ".join([*said, *(f"Not determined: {w.text}" for w in found.weak)])


def clear(target: bpy.types.Scene) -> None:
    """Take away what stands for photos."""
    scene.remove(*(item for item in target.objects if PHOTO_KEY in item))


def show(target: bpy.types.Scene, result: object) -> bool:
    """Show a co-registration in an empty scene (``--blend``); False when it is none."""
    from ..core.imagery.coregistration import CoregistrationResult

    if not isinstance(result, CoregistrationResult):
        return False
    target.bim_verify.model_path = str(Path(result.model.path).resolve())
    project.adopt_frame(target, result.model)
    show_photos(target, result)
    return True


def camera_object(
    label: str, camera: Camera, position: NDArray[np.float64], place: frame.ViewFrame, path: str | Path | None
) -> bpy.types.Object:
    """A camera at ``position`` (3,) in the model frame, with the image at ``path`` behind it; not yet in a collection.

    Blender's camera has no distortion: the image behind it fits in the middle, and its border only about.
    """
    lens = camera.interior
    data = bpy.data.cameras.new(label)
    data.sensor_fit = "HORIZONTAL" if lens.width >= lens.height else "VERTICAL"
    size = max(lens.width, lens.height)
    data.sensor_width = data.sensor_height = 36.0
    data.lens = 36.0 * lens.fx / size
    data.shift_x = ((lens.width - 1) / 2 - lens.cx) / size
    data.shift_y = (lens.cy - (lens.height - 1) / 2) / size
    data.clip_start, data.display_size = 0.05, 0.3
    if path is not None and Path(path).is_file():
        back = data.background_images.new()
        back.image = bpy.data.images.load(str(Path(path).resolve()), check_existing=True)
        back.alpha, back.display_depth = 0.5, "FRONT"  # so that it is seen on the model in every shading
        data.show_background_images = True
    item = bpy.data.objects.new(label, data)
    matrix = np.eye(4)
    matrix[:3, :3] = place.turned(camera.rotation.T @ PHOTOGRAMMETRIC)
    matrix[:3, 3] = place.to_view(position)
    item.matrix_world = Matrix(matrix.tolist())
    return item


def _edges(
    target: bpy.types.Scene, name: str, found: ImageRegistration, origin: NDArray[np.float64], place: frame.ViewFrame
) -> None:
    """The matched edges as bars that carry the residuals."""
    kept = [m for m in found.matches if m.kept]
    if not kept:
        return
    ends = np.array([m.edge for m in kept], dtype=np.float64)
    middle = ends.reshape(-1, 3).mean(axis=0)
    corners, faces = _bars(ends - middle)
    mesh = bpy.data.meshes.new(f"{name} edges")
    mesh.from_pydata(corners.tolist(), [], faces.tolist())
    residual = np.repeat(np.array([abs(m.residual) for m in kept]), len(corners) // len(kept)).astype(np.float32)
    scene.set_attribute(mesh, RESIDUAL, "FLOAT", residual)
    color = np.ones((len(residual), 4), dtype=np.float32)
    color[:, :3] = palette.to_linear(palette.ramp_color(residual, 0.0, WORST_PX, RESIDUAL_STOPS))
    scene.set_attribute(mesh, scene.COLOR, "FLOAT_COLOR", color)
    scene.make_active_color(mesh)
    mesh.materials.append(surface_material(scene.COLOR))
    item = bpy.data.objects.new(f"{name} edges", mesh)
    item.show_in_front = True
    item[frame.ORIGIN_KEY] = [float(v) for v in middle + origin]
    frame.place(item, place)
    _keep(target, item, name)


def legend(target: bpy.types.Scene) -> Legend | None:
    """What the colours of matched edges mean, while there are any."""
    if not any(RESIDUAL in item.data.attributes for item in target.objects if PHOTO_KEY in item and item.type == "MESH"):
        return None
    return Legend((), scale_of(0.0, WORST_PX, unit="px", stops=RESIDUAL_STOPS))


def _bars(ends: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Lines (N, 2, 3) as three-sided bars: corners (6 N, 3), those of a line together, and sides (3 N, 4)."""
    along = ends[:, 1] - ends[:, 0]
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    across = np.cross(along, np.where(np.abs(along[:, 2:]) < 0.9, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]))
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
    third = np.cross(along, across)
    turn = np.arange(3) * (2 * np.pi / 3)
    ring = BAR_M * (np.cos(turn)[:, None] * across[:, None] + np.sin(turn)[:, None] * third[:, None])
    corners = (ends[:, :, None] + ring[:, None]).reshape(-1, 3)
    side = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [2, 0, 3, 5]])
    return corners, (6 * np.arange(len(ends))[:, None, None] + side).reshape(-1, 4)


def _keep(target: bpy.types.Scene, item: bpy.types.Object, name: str) -> None:
    item[PHOTO_KEY] = name
    scene.collection(target, PHOTOS).objects.link(item)
