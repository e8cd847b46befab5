"""From where a finding is best seen: a parallel camera that looks at one element and starts where nothing hides it."""

from __future__ import annotations

from collections.abc import Callable, Iterator

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
WHOLE_M = 0.3
"""So far before an element it lies behind the plane as a whole."""


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
    middle = 0.5 * (low + high)

    def free(start: NDArray[np.float64], toward: NDArray[np.float64]) -> NDArray[np.floating]:
        return scene.first_hit(start, np.broadcast_to(toward, start.shape), 2 * MOST_REACH_M)[0]

    toward, reach = best_side(place, normal, middle, size, free)
    forward = -toward
    right = np.cross(forward, (0.0, 0.0, 1.0))
    up = np.cross(right / np.linalg.norm(right), forward)
    return Camera(middle, forward, up, view_width(size) * max(aspect, 1.0) / 1.3, reach)


def best_side(
    place: NDArray[np.float64], normal: NDArray[np.float64], middle: NDArray[np.float64], size: float,
    free: Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.floating]],
) -> tuple[NDArray[np.float64], float]:  # fmt: skip
    """From where places (N, 3) with outward normals (N, 3) are seen best: unit vector to the viewer, where the view begins.

    The latter is the distance [m] of a plane before ``middle`` (3,): what lies nearer to the viewer is cut away.
    ``free(start, toward)``: how far (N,) [m] one sees from ``start`` (N, 3) towards the viewer. ``size``: of the element [m].
    """
    best, best_score = (_toward(225, 25), 0.5 * size + WHOLE_M), 0.0
    for toward, preference in _sides():
        for reach, seen in free_sight(place, normal, middle, size, toward, free):
            score = preference * seen * (1.0 + FARTHER * min(reach / view_width(size), 3.0))
            if score > best_score + 1e-9:
                best, best_score = (toward, reach), score
    return best


def free_sight(
    place: NDArray[np.float64], normal: NDArray[np.float64], middle: NDArray[np.float64], size: float,
    toward: NDArray[np.float64], free: Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.floating]],
) -> list[tuple[float, float]]:  # fmt: skip
    """For each distance [m] at which the view can begin: how much is seen from there, in places that face the viewer."""
    width, whole = view_width(size), 0.5 * size + WHOLE_M
    facing = np.clip(normal @ toward, 0.0, FRONTAL) if np.any(normal) else np.ones(len(place))
    place, normal, facing = (part[facing > 0] for part in (place, normal, facing))
    sight = free(place + LIFT_M * normal, toward)
    behind = (middle - place) @ toward
    seen = []
    for reach in (MOST_REACH_M, 3 * width, width, *(part * whole for part in CLOSER)):
        from_plane = reach + behind
        seen.append((reach, float((facing * ((from_plane > 0) & (sight >= from_plane))).sum())))
    return seen


def view_width(size: float) -> float:
    """How much a view of an element of this size shows across, both in metres."""
    return max(SURROUNDINGS * max(size, 1e-3), LEAST_WIDTH_M)


def _sides() -> Iterator[tuple[NDArray[np.float64], float]]:
    for elevation, preference in ELEVATIONS_DEG.items():
        for azimuth in AZIMUTHS_DEG:
            yield _toward(azimuth, elevation), preference


def _toward(azimuth: float, elevation: float) -> NDArray[np.float64]:
    """From the element to the viewer, unit vector."""
    a, e = np.radians(azimuth), np.radians(elevation)
    return np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
