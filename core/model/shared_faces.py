"""Faces of two elements that lie in each other: nobody can tell whose returns they give."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..parallel import in_chunks
from .elements import BuildingModel
from .raycast import Hits, RayScene

DEPTH_M = 0.001
"""How far below its face an element is asked whether it shares that place with another."""
REACH_M, MOST_HITS = 50.0, 6
"""How far, and through how many faces, an element around a position is looked for."""
OWN_SHARE = 0.2
"""With at least this share of its exposed surface to itself, an element is judged by that alone; else (an element that is
in the model twice) it is judged by what it shares."""


def drop_shared(
    model: BuildingModel,
    scene: RayScene,
    position: NDArray[np.float64],
    normal: NDArray[np.float64],
    element: NDArray[np.int32],
    exposed: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """(N,) ``exposed`` without the positions just below which another closed element is solid too.

    Such a position is exposed, so the other element's face lies in this one's: a rafter flush with the slab around it.
    """
    shared = np.zeros(len(position), dtype=np.bool_)

    def work(part: slice) -> None:
        row = part.start + np.flatnonzero(exposed[part])
        shared[row] = inside_another(model, scene, position[row] - DEPTH_M * normal[row], -normal[row], element[row])

    in_chunks(len(position), work)
    own = np.bincount(element, weights=exposed & ~shared, minlength=len(model.elements))
    whole = np.bincount(element, weights=exposed, minlength=len(model.elements))
    enough = own >= OWN_SHARE * np.maximum(whole, 1)
    return exposed & ~(shared & enough[element])


def inside_another(
    model: BuildingModel,
    scene: RayScene,
    point: NDArray[np.float64],
    direction: NDArray[np.float64],
    element: NDArray[np.int32],
) -> NDArray[np.bool_]:
    """(N,) whether a point lies inside a closed element other than its own, seen along ``direction`` (N, 3)."""
    hits = scene.all_hits(point, direction, reach=REACH_M, most=MOST_HITS)
    return leaves_another(model, scene, hits, point, direction, element)


def leaves_another(
    model: BuildingModel,
    scene: RayScene,
    hits: Hits,
    point: NDArray[np.float64],
    direction: NDArray[np.float64],
    element: NDArray[np.int32],
) -> NDArray[np.bool_]:
    """(N,) whether rays with these ``hits`` begin inside a closed element other than their own.

    They do when the first meeting with some other element is from the inside.
    """
    inside = np.zeros(len(point), dtype=np.bool_)
    met = [np.full(len(point), -1, dtype=np.int32)]
    for triangle, entering in zip(hits.triangle, hits.entering, strict=True):
        other = np.where(triangle >= 0, scene.element[np.maximum(triangle, 0)], -1)
        first = np.all([other != earlier for earlier in met], axis=0)
        found = (other >= 0) & (other != element) & first & ~entering & model.closed[np.maximum(other, 0)] & ~inside
        row = np.flatnonzero(found)
        inside[row] = scene.leaves(other[row], point[row], direction[row])
        met.append(other)
    return inside
