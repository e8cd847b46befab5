"""Which directions of a pose the lines do not determine, and in words which ones they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .line_pose import PoseEstimate, PosePrior

Vector = NDArray[np.float64]
WEAK = 0.5
"""A direction whose uncertainty, all known counted, is more than this share of the coarse pose's is not determined."""
LEADING = 0.9


@dataclass(frozen=True)
class WeakDirection:
    """A combination of rotation and position that keeps ``share`` of the coarse pose's uncertainty."""

    rotation: Vector
    """(3,) radians, camera frame"""
    position: Vector
    """(3,) metres, world"""
    share: float
    text: str


def weak_directions(estimate: PoseEstimate, prior: PosePrior) -> tuple[WeakDirection, ...]:
    """Eigenvectors of the pose's covariance, measured by that of the coarse pose, with large eigenvalues.

    The estimate holds the coarse pose as an observation, so a share near one means that the lines say nothing there.
    """
    scale = np.array([prior.rotation_sigma] * 3 + [prior.position_sigma] * 3)
    values, vectors = np.linalg.eigh(estimate.scaled_covariance / np.outer(scale, scale))
    out = []
    for value, vector in zip(values[::-1], vectors.T[::-1], strict=True):
        share = float(np.sqrt(max(value, 0.0)))
        if share < WEAK:
            break
        step = vector * scale * share
        out.append(WeakDirection(step[:3], step[3:], share, _words(step, vector, estimate)))
    return tuple(out)


def _words(step: Vector, vector: Vector, estimate: PoseEstimate) -> str:
    turn, shift = np.linalg.norm(vector[:3]), np.linalg.norm(vector[3:])
    camera = estimate.camera
    parts = []
    if shift > 0.3:
        along = step[3:] / np.linalg.norm(step[3:])
        parts.append(
            f"position along {_axis(along, ('x', 'y', 'z'), 'the model')}{_relative(camera.rotation @ along)} "
            f"(sigma {100 * np.linalg.norm(step[3:]):.1f} cm)"
        )
    if turn > 0.3:
        about = step[:3] / np.linalg.norm(step[:3])
        axis = _axis(about, ("right", "down", "viewing"), "the camera")
        parts.append(f"rotation about {axis} (sigma {np.degrees(np.linalg.norm(step[:3])):.2f} deg)")
    return " with ".join(parts)


def _axis(unit: Vector, names: tuple[str, str, str], of: str) -> str:
    k = int(np.abs(unit).argmax())
    if abs(unit[k]) > LEADING:
        return f"the {names[k]} axis of {of}"
    return f"({unit[0]:.2f}, {unit[1]:.2f}, {unit[2]:.2f}) of {of}"


def _relative(in_camera: Vector) -> str:
    names = ("across the view", "up and down in the view", "along the view")
    k = int(np.abs(in_camera).argmax())
    return f", {names[k]}" if abs(in_camera[k]) > LEADING else ""
