"""From where a finding is best seen: a parallel camera that looks at one element and starts where nothing hides it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..model.elements import BuildingModel
from ..model.raycast import RayScene
from ..report.camera import Camera

AZIMUTHS_DEG = tuple(range(15, 375, 30))
ELEVATIONS_DEG = {25.0: 1.0, 55.0: 1.0, 8.0: 0.95, 85.0: 0.85, -25.0: 0.75, -55.0: 0.75, -85.0: 0.75}
"""Above the horizon, and how much a view from there counts: a person finds the way best from obliquely above."""
FRONTAL = 0.7
"""Cosine of the view on a surface beyond which it is not seen any better."""
PROBES = 96
"""Places on the element that are looked at from each side."""
SURROUNDINGS = 2.2
"""Width of the view, in sizes of the element: enough around it to know where one is."""
LEAST_WIDTH_M = 1.5
MOST_REACH_M = 30.0
CLOSER = (1.0, 0.5, 0.25, 0.125)
"""Where the picture may begin, in parts of the distance from which the whole element lies behind its plane."""
FARTHER = 0.05
"""How much more a view counts for each width that it begins farther away: the surroundings help to find the place."""
LIFT_M = 0.005


def finding_camera(
    model: BuildingModel, row: int, probes: NDArray[np.float64], normals: NDArray[np.float64], scene: RayScene,
    aspect: float,
) -> Camera:  # fmt: skip
    """The camera for element ``row``, local frame.

    ``probes`` (N, 3) are places on its surface with outward ``normals`` (N, 3). Of all sides, from above and from below,
    the one is taken from which most of them are in free sight, and the picture begins as far away as the sight reaches:
    for a ceiling that is a plane inside the room.
    """
    corners = model.vertices[model.triangles[model.triangle_start[row] : model.triangle_start[row + 1]]].reshape(-1, 3)
    low, high = corners.min(axis=0), corners.max(axis=0)
    size = float(np.linalg.norm(high - low))
    step = max(len(probes) // PROBES, 1)
    place, normal = probes[::step], normals[::step]
    if not len(place):
        place, normal = 0.5 * (low + high)[None], np.zeros((1, 3))
    width = max(SURROUNDINGS * max(size, 1e-3), LEAST_WIDTH_M)
    middle, whole = 0.5 * (low + high), 0.5 * size + 0.3
    reaches = (MOST_REACH_M, 3 * width, width, *(part * whole for part in CLOSER))
    best, best_score = (-_toward(225, 25), whole), 0.0
    start = place + LIFT_M * normal
    for elevation, preference in ELEVATIONS_DEG.items():
        for azimuth in AZIMUTHS_DEG:
            toward = _toward(azimuth, elevation)
            facing = np.clip(normal @ toward, 0.0, FRONTAL) if np.any(normal) else np.ones(len(place))
            free, _ = scene.first_hit(start, np.broadcast_to(toward, start.shape), 2 * MOST_REACH_M)
            behind = (middle - place) @ toward
            for reach in reaches:
                from_plane = reach + behind
                seen = float((facing * ((from_plane > 0) & (free >= from_plane))).sum())
                score = preference * seen * (1.0 + FARTHER * min(reach, 3 * width) / width)
                if score > best_score + 1e-9:
                    best, best_score = (-toward, reach), score
    forward, reach = best
    right = np.cross(forward, (0.0, 0.0, 1.0))
    up = np.cross(right / np.linalg.norm(right), forward)
    return Camera(middle, forward, up, width * max(aspect, 1.0) / 1.3, reach)


def _toward(azimuth: float, elevation: float) -> NDArray[np.float64]:
    """From the element to the viewer, unit vector."""
    a, e = np.radians(azimuth), np.radians(elevation)
    return np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
