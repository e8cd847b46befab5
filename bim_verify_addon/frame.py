"""Where the model stands in the Blender scene.

Blender keeps coordinates in single precision, so a model far from zero is shown shifted. The shift (and, where Bonsai
chose one, a turn about the vertical) is stored in double precision on the scene; everything that enters or leaves
passes through it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

SCENE_KEY = "bim_verify_frame"
ORIGIN_KEY = "bim_verify_origin"
"""On each object that we make: where its own zero lies, model frame (scans: frame of the file), metres, doubles."""
PLACEMENT_KEY = "bim_verify_placement"
"""On a scan object: the 4x4 transform from its file's frame to the model frame, row by row."""
NEAR_ENOUGH_M = 1000.0
"""Up to here single precision keeps 0.1 mm, and the scene shows the file's own coordinates."""


@dataclass(frozen=True)
class ViewFrame:
    """Model frame (metres, doubles) to Blender's world: view = Rz(-angle) (model - origin)."""

    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    angle: float = 0.0
    """Radians, counter-clockwise from the model's x axis to Blender's."""

    def to_view(self, xyz: NDArray[np.float64]) -> NDArray[np.float64]:
        """(..., 3) model frame to (..., 3) Blender world, metres."""
        return (np.asarray(xyz, dtype=np.float64) - self.origin) @ self._rotation()

    def to_model(self, xyz: NDArray[np.float64]) -> NDArray[np.float64]:
        """(..., 3) Blender world to (..., 3) model frame, metres."""
        return np.asarray(xyz, dtype=np.float64) @ self._rotation().T + self.origin

    def turned(self, rotation: NDArray[np.float64]) -> NDArray[np.float64]:
        """(3, 3) rotation into the model frame, to the same into Blender's world."""
        turned: NDArray[np.float64] = self._rotation().T @ rotation
        return turned

    def _rotation(self) -> NDArray[np.float64]:
        c, s = math.cos(self.angle), math.sin(self.angle)
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def frame_for(origin: NDArray[np.float64], reach: float) -> ViewFrame:
    """The frame for something whose middle is at ``origin`` and that extends ``reach`` metres from it."""
    if float(np.abs(origin).max()) + reach <= NEAR_ENOUGH_M:
        return ViewFrame()
    x, y, z = (float(v) for v in np.round(origin))
    return ViewFrame((x, y, z))


def stored(scene: bpy.types.Scene) -> ViewFrame | None:
    """The frame of this scene; None before anything was placed."""
    values = scene.get(SCENE_KEY)
    if values is None:
        return None
    x, y, z, angle = (float(v) for v in values)
    return ViewFrame((x, y, z), angle)


def store(scene: bpy.types.Scene, frame: ViewFrame) -> None:
    """Set the frame of this scene and move everything that we placed into it."""
    scene[SCENE_KEY] = [*frame.origin, frame.angle]
    for item in scene.objects:
        if ORIGIN_KEY in item:
            place(item, frame)


def place(item: bpy.types.Object, frame: ViewFrame) -> None:
    """Put an object that carries its model-frame origin where the frame (and the placement of a scan) says."""
    origin = np.array(item[ORIGIN_KEY][:])
    turn = np.eye(3)
    if PLACEMENT_KEY in item:
        transform = np.array(item[PLACEMENT_KEY][:]).reshape(4, 4)
        turn, origin = transform[:3, :3], transform[:3, :3] @ origin + transform[:3, 3]
    matrix = np.eye(4)
    matrix[:3, :3] = frame.turned(turn)
    matrix[:3, 3] = frame.to_view(origin)
    item.matrix_world = Matrix(matrix.tolist())
