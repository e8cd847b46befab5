"""Cameras: interior orientation with distortion, and pose.

The camera frame has x to the right of the image, y down and z forward; pixel coordinates have the centre of the first
pixel at (0, 0).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
PHOTOGRAMMETRIC = np.diag([1.0, -1.0, -1.0])
"""From the photogrammetric camera frame (x right, y up, z backward) to this one, and back."""
MOST_ROUNDS = 100
FRAME_POINTS = 17
MOST_BEYOND = 0.5
"""Share of an image's size by which its ideal pixels may reach beyond it."""


@dataclass(frozen=True)
class Interior:
    """Interior orientation in pixels, with Brown's distortion (radial k1, k2, k3; tangential p1, p2)."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)
    """(k1, k2, p1, p2, k3), of coordinates divided by the focal length."""

    @property
    def matrix(self) -> Vector:
        """K (3, 3)."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def distort(self, ideal: Vector) -> Vector:
        """Pixels (N, 2) as the lens images them, of ideal ones (N, 2)."""
        x, y = (ideal[:, 0] - self.cx) / self.fx, (ideal[:, 1] - self.cy) / self.fy
        k1, k2, p1, p2, k3 = self.distortion
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        dx = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
        dy = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
        return np.column_stack([dx * self.fx + self.cx, dy * self.fy + self.cy])

    def undistort(self, pixels: Vector) -> Vector:
        """Ideal pixels (N, 2) of those in the image (N, 2)."""
        pixels = np.asarray(pixels, dtype=np.float64)
        if not any(self.distortion):
            return pixels
        ideal = pixels
        for _ in range(MOST_ROUNDS):
            left = pixels - self.distort(ideal)
            ideal = ideal + left
            if np.abs(left).max(initial=0.0) < 1e-9:
                break
        return ideal

    def scaled(self, scale: float) -> Interior:
        """The interior with ``scale`` times the focal length that bends each ideal pixel into the same pixel as before."""
        k1, k2, p1, p2, k3 = self.distortion
        bent = (k1 * scale**2, k2 * scale**4, p1 * scale, p2 * scale, k3 * scale**6)
        return replace(self, fx=self.fx * scale, fy=self.fy * scale, distortion=bent)

    @property
    def ideal_frame(self) -> Vector:
        """(2, 2) least and largest ideal pixel that the image shows: a barrel lens shows more than ``width`` by ``height``."""
        along = np.linspace(0.0, 1.0, FRAME_POINTS)
        low, high = np.zeros(FRAME_POINTS), np.ones(FRAME_POINTS)
        border = np.concatenate([np.column_stack(pair) for pair in ((along, low), (along, high), (low, along), (high, along))])
        size = np.array([self.width - 1, self.height - 1], dtype=np.float64)
        ideal = self.undistort(border * size)
        ideal = np.where(np.isfinite(ideal), ideal, border * size)
        return np.clip(np.stack([ideal.min(axis=0), ideal.max(axis=0)]), -MOST_BEYOND * size, (1.0 + MOST_BEYOND) * size)


@dataclass(frozen=True)
class Camera:
    """One image's interior orientation and pose: point in the camera frame = rotation @ (point - position)."""

    name: str
    interior: Interior
    rotation: Vector
    """(3, 3) world to camera."""
    position: Vector
    """(3,) projection centre, metres, world frame."""

    @property
    def matrix(self) -> Vector:
        """P (3, 4) = K R [I | -X0], of ideal pixels."""
        return self.interior.matrix @ np.column_stack([self.rotation, -self.rotation @ self.position])

    def in_camera(self, points: Vector) -> Vector:
        """Points (N, 3) of the world in the camera frame, metres."""
        return (np.asarray(points, dtype=np.float64) - self.position) @ self.rotation.T

    def project(self, points: Vector) -> Vector:
        """Ideal pixels (N, 2) of points (N, 3) in front of the camera; NaN for those that are not."""
        seen = self.in_camera(points)
        with np.errstate(divide="ignore", invalid="ignore"):
            flat = np.where(seen[:, 2:] > 0.0, seen[:, :2] / seen[:, 2:], np.nan)
        return flat * [self.interior.fx, self.interior.fy] + [self.interior.cx, self.interior.cy]

    def rays(self, pixels: Vector) -> Vector:
        """Unit directions (N, 3) in the world of pixels (N, 2) as the lens bends them."""
        lens = self.interior
        ideal = lens.undistort(pixels)
        ray = np.column_stack([(ideal - [lens.cx, lens.cy]) / [lens.fx, lens.fy], np.ones(len(ideal))]) @ self.rotation
        return np.asarray(ray / np.linalg.norm(ray, axis=1, keepdims=True))

    def moved(self, rotation: Vector, translation: Vector) -> Camera:
        """Turned by the rotation vector (3,) [rad] in the camera frame, and shifted by (3,) [m] in the world."""
        return replace(
            self, rotation=rotation_matrix(rotation) @ self.rotation, position=self.position + np.asarray(translation)
        )


def rotation_matrix(vector: Vector) -> Vector:
    """Rotation (3, 3) about ``vector`` by its length in radians (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    if angle < 1e-300:
        return np.eye(3)
    x, y, z = np.asarray(vector, dtype=np.float64) / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross)


def rotation_vector(rotation: Vector) -> Vector:
    """The inverse of ``rotation_matrix`` (3,), radians."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(rotation).as_rotvec(), dtype=np.float64)


def from_omega_phi_kappa(omega: float, phi: float, kappa: float) -> Vector:
    """World-to-camera rotation (3, 3) of photogrammetric angles [rad].

    Rx(omega) Ry(phi) Rz(kappa) turns the photogrammetric camera frame (y up, z backward) into the world.
    """
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_euler("XYZ", [omega, phi, kappa]).as_matrix()
    return np.asarray(PHOTOGRAMMETRIC @ turn.T)


def to_omega_phi_kappa(rotation: Vector) -> tuple[float, float, float]:
    """Photogrammetric angles [rad] of a world-to-camera rotation (3, 3)."""
    from scipy.spatial.transform import Rotation

    omega, phi, kappa = Rotation.from_matrix((PHOTOGRAMMETRIC @ rotation).T).as_euler("XYZ")
    return float(omega), float(phi), float(kappa)
