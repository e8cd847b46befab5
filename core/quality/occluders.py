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
from .planned_at import planned_at
from .survey import Survey

GAP_SPACINGS = 2.0
"""Blocking returns belong to one object across gaps of so many of their usual distances,"""
GAP_M = (0.03, 0.15)
"""within these bounds: closer things cannot be told apart, larger gaps lie between things."""
FEWEST_RETURNS = 10
"""Fewer are mixed pixels and strays, not an object."""


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
    standing: RayScene, names: tuple[str, ...], window: float, spacing: float,
) -> tuple[Blocked, tuple[Clutter, ...]]:
    """Name the occluder of every occluded sample. ``positions`` (S, 3) of the stations, local frame; ``scene`` is the plan,
    ``standing`` the elements where they were found. A return within ``window`` of neither is a foreign thing's; ``spacing``
    is that of the query positions. All in metres."""
    count = len(samples)
    element, clutter = np.full(count, -1, np.int32), np.full(count, -1, np.int32)
    state = found.best.state
    back = np.flatnonzero((state == TURNED_AWAY) & samples.exposed)
    element[back] = _first_element(scene, positions, found, samples, back)
    front = np.flatnonzero((state == OCCLUDED) & samples.exposed)
    for known in (scene, standing):
        left = front[element[front] < 0]
        element[left] = planned_at(known, positions[found.best.station[left]], found.best.blocker[left], window)
    things = front[element[front] < 0]
    if not len(things):
        return Blocked(element, clutter), ()
    point = found.best.blocker[things]
    label = _group(point, _gap(found, positions, things, spacing))
    area = np.bincount(label, weights=samples.area[things])
    returns = np.bincount(label[np.unique(point, axis=0, return_index=True)[1]], minlength=len(area))
    area[returns < FEWEST_RETURNS] = 0.0
    order = np.argsort(-area, kind="stable")[: np.count_nonzero(area)]
    rank = np.full(len(area), -1, np.int32)
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


def _gap(found: Survey, positions: NDArray[np.float64], row: NDArray[np.int64], spacing: float) -> float:
    """Distance [m] across which blocking returns still belong together: the queries behind them are ``spacing`` apart, and
    closer to the station the rays to them are closer to each other."""
    reach = np.linalg.norm(found.best.blocker[row] - positions[found.best.station[row]], axis=1)
    usual = float(np.median(spacing * reach / np.maximum(found.best.distance[row], 1e-9)))
    return float(np.clip(GAP_SPACINGS * usual, *GAP_M))


def _group(point: NDArray[np.float64], gap: float) -> NDArray[np.int64]:
    """(N,) number of the object of each point: connected voxels of ``gap`` metres."""
    voxel = np.floor(point / gap).astype(np.int64)
    used, inverse = np.unique(voxel, axis=0, return_inverse=True)
    pairs = cKDTree(used).query_pairs(1.75, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs), np.int8), (pairs[:, 0], pairs[:, 1])), shape=(len(used), len(used)))
    label = connected_components(graph, directed=False)[1]
    return np.asarray(label[inverse.ravel()], dtype=np.int64)


def _triple(values: NDArray[np.float64]) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
