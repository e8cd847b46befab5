"""What stands in the way: planned elements by name, and things that are not in the model, grouped into objects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..model.elements import BuildingModel
from ..model.raycast import RayScene
from ..model.samples import SurfaceSamples
from .missing import OCCLUDED, TURNED_AWAY
from .survey import Survey

CLUTTER_VOXEL_M = 0.15
"""Blocking returns in touching voxels of this size belong to one object."""
GRAZE = 0.1


@dataclass(frozen=True)
class Clutter:
    """A thing that is not in the model and hides a part of it."""

    name: str
    low: tuple[float, float, float]
    """Of the box around the returns that block, metres, model frame: the side towards the stations, not the whole."""
    high: tuple[float, float, float]
    hidden_area: float
    """m2 of planned surface for which it is the reason that nobody sees it."""
    stations: tuple[str, ...]


@dataclass(frozen=True)
class Blocked:
    """Per query position (N,): what blocks the view that came closest to seeing it."""

    element: NDArray[np.int32]
    """Row of ``model.elements``; -1 where nothing planned does."""
    clutter: NDArray[np.int32]
    """Row of the clutter list; -1 where none does."""


def find_occluders(
    model: BuildingModel, samples: SurfaceSamples, found: Survey, positions: NDArray[np.float64], scene: RayScene,
    names: tuple[str, ...], window: float,
) -> tuple[Blocked, tuple[Clutter, ...]]:
    """Name the occluder of every occluded sample. ``positions`` (S, 3) of the stations, local frame."""
    count = len(samples)
    element, clutter = np.full(count, -1, np.int32), np.full(count, -1, np.int32)
    state = found.best.state
    back = np.flatnonzero((state == TURNED_AWAY) & samples.exposed)
    element[back] = _first_element(scene, positions, found, samples, back)
    front = np.flatnonzero((state == OCCLUDED) & samples.exposed)
    element[front] = _planned_at(scene, positions, found, front, window)
    things = front[element[front] < 0]
    if not len(things):
        return Blocked(element, clutter), ()
    point = found.best.blocker[things]
    label = _group(point)
    area = np.bincount(label, weights=samples.area[things])
    order = np.argsort(-area, kind="stable")
    rank = np.empty(len(order), np.int32)
    rank[order] = np.arange(len(order), dtype=np.int32)
    clutter[things] = rank[label]
    objects = []
    for place, group in enumerate(order):
        own = label == group
        low, high = point[own].min(axis=0) + model.origin, point[own].max(axis=0) + model.origin
        seen_from = np.unique(found.best.station[things[own]])
        objects.append(
            Clutter(
                f"clutter {place + 1}", _triple(low), _triple(high), float(area[group]), tuple(names[s] for s in seen_from)
            )
        )
    return Blocked(element, clutter), tuple(objects)


def _first_element(
    scene: RayScene, positions: NDArray[np.float64], found: Survey, samples: SurfaceSamples, row: NDArray[np.int64]
) -> NDArray[np.int32]:
    """The first planned element between the station and the sample; its own back at the latest."""
    origin = positions[found.best.station[row]]
    ray = samples.position[row] - origin
    distance = np.linalg.norm(ray, axis=1)
    _, triangle = scene.first_hit(origin, ray / np.maximum(distance, 1e-9)[:, None], distance - 1e-4)
    return np.where(triangle >= 0, scene.element[triangle], samples.element[row]).astype(np.int32)


def _planned_at(
    scene: RayScene, positions: NDArray[np.float64], found: Survey, row: NDArray[np.int64], window: float
) -> NDArray[np.int32]:
    """(K,) the element whose planned surface the blocking return lies on, within ``window`` metres; -1 for none."""
    point = found.best.blocker[row]
    ray = point - positions[found.best.station[row]]
    ray /= np.maximum(np.linalg.norm(ray, axis=1, keepdims=True), 1e-9)
    back = window / GRAZE
    hits = scene.all_hits(point - back * ray, ray, 2 * back, most=8)
    nearest = np.full(len(row), window)
    out = np.full(len(row), -1, np.int32)
    for distance, triangle, entering in zip(hits.distance, hits.triangle, hits.entering, strict=True):
        facing = np.abs(np.einsum("ij,ij->i", ray, scene.normal[triangle]))
        with np.errstate(invalid="ignore"):
            away = np.abs(distance - back) * np.maximum(facing, 0.0)
        better = (triangle >= 0) & entering & (away < nearest)
        nearest[better] = away[better]
        out[better] = scene.element[triangle[better]]
    return out


def _group(point: NDArray[np.float64]) -> NDArray[np.int64]:
    """(N,) number of the object of each point: connected voxels."""
    voxel = np.floor(point / CLUTTER_VOXEL_M).astype(np.int64)
    used, inverse = np.unique(voxel, axis=0, return_inverse=True)
    pairs = cKDTree(used).query_pairs(1.75, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs), np.int8), (pairs[:, 0], pairs[:, 1])), shape=(len(used), len(used)))
    label = connected_components(graph, directed=False)[1]
    return np.asarray(label[inverse.ravel()], dtype=np.int64)


def _triple(values: NDArray[np.float64]) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
