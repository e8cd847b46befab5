"""Does a surface end where the element would end? A larger surface that merely passes there is something else."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .hypotheses import face_groups
from .sightings import Sightings

RING_M = 0.04
"""Distance of the outer ring from the faces' edges, metres; grows to two point spacings on coarse scans."""
RING_POINTS = 64


def ring(
    position: NDArray[np.float64], normal: NDArray[np.float64], shift: NDArray[np.float64], margin: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Positions and normals (R, 3) around the faces that a shift moves along their normal.

    position (N, 3), normal (N, 3) are the element's query positions at the shifted place. For each main face direction
    across which the shift acts, the points lie on the plane of the face, ``margin`` outside the rectangle that holds it.
    """
    group, directions = face_groups(normal, np.ones(len(normal)))
    length = float(np.linalg.norm(shift))
    points, normals = [], []
    for g, direction in enumerate(directions):
        if abs(direction @ shift) < 0.5 * length:
            continue
        face = position[group == g]
        u = np.cross(direction, [0.0, 0.0, 1.0] if abs(direction[2]) < 0.9 else [1.0, 0.0, 0.0])
        u /= np.linalg.norm(u)
        v = np.cross(direction, u)
        low = np.array([(face @ u).min(), (face @ v).min()]) - margin
        high = np.array([(face @ u).max(), (face @ v).max()]) + margin
        step = np.linspace(0.0, 1.0, RING_POINTS // 4, endpoint=False)
        a = low[0] + step * (high[0] - low[0])
        b = low[1] + step * (high[1] - low[1])
        plane = np.concatenate(
            [
                np.column_stack([a, np.full_like(a, low[1])]),
                np.column_stack([np.full_like(b, high[0]), b]),
                np.column_stack([a[::-1] + (a[1] - a[0]), np.full_like(a, high[1])]),
                np.column_stack([np.full_like(b, low[0]), b[::-1] + (b[1] - b[0])]),
            ]
        )
        level = float(np.median(face @ direction))
        points.append(plane[:, [0]] * u + plane[:, [1]] * v + level * direction)
        normals.append(np.tile(direction, (len(plane), 1)))
    if not points:
        return np.zeros((0, 3)), np.zeros((0, 3))
    return np.concatenate(points), np.concatenate(normals)


def goes_on(around: Sightings, sigma: float, outline_share: float) -> bool:
    """Whether the surface continues beyond the element's outline, so that it belongs to something larger."""
    if len(around) == 0:
        return False
    level = np.abs(around.deviation) <= max(3.0 * sigma, 0.008)
    return float(np.mean(level & ~around.explained)) > outline_share
