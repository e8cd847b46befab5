"""Where a scanner can stand, and which stands see a building best."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.elements import BuildingModel
from .scene import Scene

HEIGHTS_M = (1.2, 1.45, 1.7)
"""Of the scanner's centre above the floor."""
HEAD_ROOM_M = 0.25
FOOT_RADIUS_M = 0.2
"""A tripod's feet need the same floor all around."""
ELBOW_ROOM_M = 0.45
LEVEL_COS = 0.985
OUTSIDE_M = (3.0, 6.0, 10.0)
"""Distances from the building's bounding rectangle."""
STEEPEST_COS = 0.2
"""A surface met at more than 78 degrees from its normal is hardly measured."""
FARTHEST_M = 30.0
NEAREST_M = 0.5
SIGHT_TOLERANCE_M = 0.003
NO_FLOOR_CLASSES = ("IfcRoof", "IfcFurniture", "IfcFurnishingElement", "IfcWindow", "IfcDoor", "IfcRailing")
UP, DOWN = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0])


@dataclass(frozen=True)
class StandPoints:
    """Candidate set-ups."""

    position: NDArray[np.float64]
    """(N, 3) of the scanner's centre, metres, scene frame."""
    floor: NDArray[np.float64]
    """(N,) height of the floor below, metres."""


def find_stand_points(model: BuildingModel, scene: Scene, *, count: int = 160, seed: int = 0) -> StandPoints:
    """Up to ``count`` places on walkable ground in ``scene`` (built from ``model``): level, free, with head room.

    Ground is any level surface that is wide enough, except on top of the building; around the building, and where the
    model has no floor at all, it is the level of the lowest doors (or of the lowest point). A quarter lies outside.
    """
    random = np.random.default_rng((seed, 1))
    inside = _keep_free(scene, _on_floors(model, scene, random, count * 12))
    outside = _keep_free(scene, _around(model, scene, random, count * 2))
    if not len(inside):
        spot = random.uniform(model.bounds[0], model.bounds[1], (count * 12, 3))
        spot[:, 2] = ground_level(model)
        inside = _keep_free(scene, spot)
    inside = inside[: count - count // 4]
    floor = np.concatenate([inside, outside[: count - len(inside)]])
    height = random.choice(HEIGHTS_M, len(floor))
    return StandPoints(floor + height[:, None] * UP, floor[:, 2])


def choose_stations(
    scene: Scene,
    stands: StandPoints,
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    weight: NDArray[np.float64],
    *,
    stations: int | None,
    least_gain: float = 0.015,
    most: int = 12,
) -> NDArray[np.int64]:
    """Rows of ``stands`` that together see most of the (N, 3) surface points, greedily; a fixed number if ``stations``.

    Otherwise stations are added until the next one would add less than ``least_gain`` of what all of them could see.
    """
    sees = np.stack([visible_from(scene, p, points, normals) for p in stands.position])
    reachable = weight[sees.any(axis=0)].sum()
    left = np.ones(len(points), dtype=np.bool_)
    chosen: list[int] = []
    for _ in range(min(stations or most, len(sees))):
        gain = sees[:, left] @ weight[left]
        if stations is not None and chosen and gain.max() <= 0:
            gain = sees @ weight  # everything is seen: take the next best view as a second look
        gain[chosen] = -1.0
        best = int(np.argmax(gain))
        if stations is None and chosen and gain[best] < least_gain * reachable:
            break
        chosen.append(best)
        left &= ~sees[best]
    return np.array(chosen, dtype=np.int64)


def visible_from(
    scene: Scene, position: NDArray[np.float64], points: NDArray[np.float64], normals: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """(N,) the point of a surface is in line of sight of ``position`` (3,), near and steep enough to be measured."""
    ray = points - position
    distance = np.linalg.norm(ray, axis=1)
    ray /= np.maximum(distance, 1e-9)[:, None]
    facing = -np.einsum("ij,ij->i", ray, normals) > STEEPEST_COS
    facing &= (distance < FARTHEST_M) & (distance > NEAREST_M)
    at = np.flatnonzero(facing)
    facing[at] = scene.cast(position, ray[at]).distance > distance[at] - SIGHT_TOLERANCE_M
    return facing


def ground_level(model: BuildingModel) -> float:
    """Height [m, local frame] of the lowest door's sill, or of the lowest point where there are no doors."""
    start = model.triangle_start
    sills = [
        float(model.vertices[model.triangles[start[row] : start[row + 1]]][..., 2].min())
        for row, element in enumerate(model.elements)
        if element.ifc_class == "IfcDoor"
    ]
    return min(sills, default=float(model.bounds[0, 2]))


def near_walls(
    scene: Scene, floor: NDArray[np.float64], reach: float = 3.0
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Per place (N, 3) on a floor: level unit vector (N, 3) to the nearest upright surface; its distance (N,) [m]."""
    nearest = np.full(len(floor), np.inf)
    towards = np.zeros((len(floor), 3))
    start = floor + 0.4 * UP
    for side in _level_directions(24):
        ahead = scene.cast(start, np.broadcast_to(side, floor.shape))
        wall = ahead.distance < np.minimum(nearest, reach)
        normal = scene.normal[ahead.triangle] * np.array([1.0, 1.0, 0.0])
        normal *= -np.sign(normal @ side)[:, None]
        length = np.linalg.norm(normal, axis=1)
        wall &= length > 0.9
        towards[wall] = -normal[wall] / length[wall, None]
        nearest[wall] = ahead.distance[wall]
    return towards, nearest


def pick_spread(position: NDArray[np.float64], count: int, apart: float) -> list[int]:
    """The first ``count`` rows of (N, 3) that keep ``apart`` metres from each other."""
    kept: list[int] = []
    for row in range(len(position)):
        if len(kept) == count:
            break
        if all(np.linalg.norm(position[row] - position[other]) >= apart for other in kept):
            kept.append(row)
    return kept


def _level_directions(count: int) -> NDArray[np.float64]:
    turn = np.arange(count) * (2 * math.pi / count)
    return np.stack([np.cos(turn), np.sin(turn), np.zeros(count)], axis=1)


def _on_floors(
    model: BuildingModel, scene: Scene, random: np.random.Generator, count: int
) -> NDArray[np.float64]:
    """Random places on level surfaces that face up, in proportion to their area; not on top of the building."""
    a, b, c = (scene.corners[:, i] for i in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    no_floor = np.ones(len(scene.names), dtype=np.bool_)
    no_floor[: len(model.elements)] = [e.ifc_class in NO_FLOOR_CLASSES for e in model.elements]
    area = np.where((scene.normal[:, 2] > LEVEL_COS) & ~no_floor[scene.owner], area, 0.0)
    if area.sum() <= 0:
        return np.zeros((0, 3))
    triangle = random.choice(len(area), count, p=area / area.sum())
    u, v = random.random((2, count))
    fold = u + v > 1
    u, v = np.where(fold, 1 - u, u)[:, None], np.where(fold, 1 - v, v)[:, None]
    place = a[triangle] + u * (b[triangle] - a[triangle]) + v * (c[triangle] - a[triangle])
    low, high = model.bounds
    covered = np.isfinite(scene.cast(place + 0.05 * UP, np.broadcast_to(UP, place.shape)).distance)
    return place[covered | (place[:, 2] < low[2] + 0.4 * (high[2] - low[2]))]


def _around(
    model: BuildingModel, scene: Scene, random: np.random.Generator, count: int
) -> NDArray[np.float64]:
    """Places outside the building's bounding rectangle, on the ground (on a real surface if one is near that level)."""
    low, high = model.bounds
    center, half = (low + high)[:2] / 2, (high - low)[:2] / 2
    angle = random.uniform(0, 2 * math.pi, count)
    out = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    reach = np.min(half / np.maximum(np.abs(out), 1e-9), axis=1) + random.choice(OUTSIDE_M, count)
    place = np.column_stack([center + out * reach[:, None], np.full(count, ground_level(model))])
    down = scene.cast(place + UP, np.broadcast_to(DOWN, place.shape)).distance
    place[:, 2] += np.where(down < 2.0, 1.0 - np.where(np.isfinite(down), down, 1.0), 0.0)
    return place


def _keep_free(scene: Scene, floor: NDArray[np.float64]) -> NDArray[np.float64]:
    """Places on the floor with room for tripod, scanner and operator, in the order given."""
    if not len(floor):
        return floor
    up = scene.cast(floor + 0.02 * UP, np.broadcast_to(UP, floor.shape))
    inside_solid = (up.triangle >= 0) & (scene.normal[up.triangle, 2] > 0)
    free = (up.distance > max(HEIGHTS_M) + HEAD_ROOM_M) & ~inside_solid
    down = scene.cast(floor + UP, np.broadcast_to(DOWN, floor.shape)).distance
    for side in _level_directions(12):
        for height in (0.3, 1.0, 1.7):
            free &= scene.cast(floor + height * UP, np.broadcast_to(side, floor.shape)).distance > ELBOW_ROOM_M
        foot = scene.cast(floor + UP + FOOT_RADIUS_M * side, np.broadcast_to(DOWN, floor.shape)).distance
        with np.errstate(invalid="ignore"):
            free &= (np.abs(foot - down) < 0.05) | (np.isinf(down) & np.isinf(foot))
    return floor[free]
