"""Faces of two elements that lie in each other: nobody can tell whose returns they give."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .elements import BuildingModel
from .raycast import RayScene

SAME_PLACE_M = 0.001
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
    """(N,) ``exposed`` without the positions at which a face of another closed element lies and faces the same way."""
    shared = np.zeros(len(position), dtype=np.bool_)
    for begin in range(0, len(position), 1_000_000):
        row = begin + np.flatnonzero(exposed[begin : begin + 1_000_000])
        start = position[row] + SAME_PLACE_M * normal[row]
        hits = scene.all_hits(start, -normal[row], 2 * SAME_PLACE_M, most=4)
        for triangle, entering in zip(hits.triangle, hits.entering, strict=True):
            other = scene.element[np.maximum(triangle, 0)]
            shared[row] |= (triangle >= 0) & entering & (other != element[row]) & model.closed[other]
    own = np.bincount(element, weights=exposed & ~shared, minlength=len(model.elements))
    whole = np.bincount(element, weights=exposed, minlength=len(model.elements))
    enough = own >= OWN_SHARE * np.maximum(whole, 1)
    return exposed & ~(shared & enough[element])
