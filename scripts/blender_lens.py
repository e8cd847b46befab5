"""A camera of ours in a Blender scene, and its picture bent as its lens bends it: for the scripts that render photos."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import bpy
import cv2
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

if TYPE_CHECKING:
    from bim_verify.core.imagery.camera import Camera


def place_camera(camera: Camera, margin: float, clip_start_m: float) -> bpy.types.Object:
    """The scene's camera, without distortion and ``margin`` times as wide, so that the bent picture is full."""
    lens, scene = camera.interior, bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = round(margin * lens.width), round(margin * lens.height)
    data = bpy.data.cameras.new("camera")
    data.sensor_fit, data.sensor_width, data.lens = "HORIZONTAL", float(scene.render.resolution_x), lens.fx
    data.clip_start = clip_start_m
    item = bpy.data.objects.new("camera", data)
    matrix = np.eye(4)
    matrix[:3, :3] = camera.rotation.T @ np.diag([1.0, -1.0, -1.0])
    matrix[:3, 3] = camera.position
    item.matrix_world = Matrix([[float(v) for v in row] for row in matrix])
    scene.collection.objects.link(item)
    scene.camera = item
    return item


def photograph(camera: Camera, path: Path) -> NDArray[np.float64]:
    """Render with the camera that ``place_camera`` placed, and bend the picture (H, W, 3), BGR.

    A file beside ``path`` is made and removed.
    """
    lens, scene = camera.interior, bpy.context.scene
    scene.render.filepath = str(path.with_suffix(".ideal.png"))
    scene.render.image_settings.file_format = "PNG"
    bpy.ops.render.render(write_still=True)
    ideal = cv2.imread(scene.render.filepath, cv2.IMREAD_COLOR)
    Path(scene.render.filepath).unlink()
    height, width = ideal.shape[:2]
    x, y = np.meshgrid(np.arange(lens.width, dtype=np.float64), np.arange(lens.height, dtype=np.float64))
    straight = lens.undistort(np.column_stack([x.ravel(), y.ravel()]))
    u = (straight[:, 0] - lens.cx + (width - 1) / 2).reshape(x.shape).astype(np.float32)
    v = (straight[:, 1] - lens.cy + (height - 1) / 2).reshape(x.shape).astype(np.float32)
    return cv2.remap(ideal, u, v, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT).astype(np.float64)


def save(path: Path, seen: NDArray[np.float64], noise: float, rng: np.random.Generator) -> None:
    """Write the picture as JPEG with normal ``noise`` (grey values) of the sensor."""
    seen = seen + rng.normal(0, noise, seen.shape)
    cv2.imwrite(str(path), np.clip(seen, 0, 255).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, 92])
