"""On which planned surface does a return lie?"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..model.raycast import RayScene

GRAZE = 0.1
"""Smallest cosine with which a planned surface can explain a return."""


def planned_at(
    scene: RayScene, origin: NDArray[np.float64], point: NDArray[np.float64], window: float
) -> NDArray[np.int32]:
    """(K,) the element whose planned outer surface returns (K, 3) of stations at ``origin`` (K, 3) lie on, within ``window``
    along its normal; -1 for none. Metres, local frame."""
    ray = point - origin
    ray /= np.maximum(np.linalg.norm(ray, axis=1, keepdims=True), 1e-9)
    back = window / GRAZE
    hits = scene.all_hits(point - back * ray, ray, 2 * back, most=8)
    nearest = np.full(len(point), window)
    out = np.full(len(point), -1, np.int32)
    for distance, triangle, entering in zip(hits.distance, hits.triangle, hits.entering, strict=True):
        facing = np.abs(np.einsum("ij,ij->i", ray, scene.normal[triangle]))
        with np.errstate(invalid="ignore"):
            away = np.abs(distance - back) * facing
        better = (triangle >= 0) & entering & (away < nearest)
        nearest[better] = away[better]
        out[better] = scene.element[triangle[better]]
    return out
