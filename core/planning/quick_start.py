"""Pose-quality vectors: each face stands for itself by one vector, and places are ranked without looking at its points.

T3's notion: a vector on the middle of a face, along its normal, as long as the quality that it needs; the place that
answers most of the vectors comes first.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..simulation.scanner import Scanner
from ..simulation.scene import Scene
from .targets import Targets
from .visibility import SIGHT_TOLERANCE_M, Requirement

Array = NDArray[np.float64]
CELL_M = 2.0


def pose_quality_vectors(targets: Targets, need: Requirement) -> tuple[Array, Array]:
    """(origin (F, 3), vector (F, 3)): one for each face of an element and each 2 m of it.

    The length is area over wanted spacing squared: the returns that the face needs.
    """
    key = np.column_stack([
        targets.element, np.round(targets.normal * 4), np.floor(targets.position / CELL_M)
    ]).astype(np.int64)
    _, first, inverse = np.unique(key, axis=0, return_index=True, return_inverse=True)
    inverse = inverse.ravel()
    area = np.bincount(inverse, weights=targets.area)
    place = np.column_stack([np.bincount(inverse, weights=targets.area * targets.position[:, k]) for k in range(3)])
    # a point of the face itself, closest to its middle: the middle of a ring lies on no face
    middle = place / area[:, None]
    away = np.linalg.norm(targets.position - middle[inverse], axis=1)
    order = np.lexsort((away, inverse))
    nearest = order[np.searchsorted(inverse[order], np.arange(len(first)))]
    wanted = area / min(need.spacing, 1.0) ** 2
    return targets.position[nearest], targets.normal[nearest] * wanted[:, None]


def quick_start(
    scene: Scene, positions: Array, targets: Targets, scanner: Scanner, need: Requirement, most: int = 60
) -> list[int]:
    """Places (rows of ``positions`` (C, 3)) in the order of how much of the vectors they answer, none twice answered."""
    origin, vector = pose_quality_vectors(targets, need)
    length = np.linalg.norm(vector, axis=1)
    normal = vector / length[:, None]
    answers = np.zeros((len(positions), len(origin)))
    for k, position in enumerate(positions):
        ray = origin - position
        distance = np.linalg.norm(ray, axis=1)
        ray /= np.maximum(distance, 1e-9)[:, None]
        cosine = -np.einsum("ij,ij->i", ray, normal)
        spacing = distance * scanner.angular_step / np.maximum(cosine, 1e-6)
        good = (cosine > math.cos(need.max_incidence)) & (distance <= need.range_max) & (spacing <= need.spacing)
        at = np.flatnonzero(good)
        good[at] = scene.cast(position, ray[at]).distance > distance[at] - SIGHT_TOLERANCE_M
        answers[k] = np.where(good, length * cosine, 0.0)
    chosen: list[int] = []
    left = np.ones(len(origin), dtype=np.bool_)
    while len(chosen) < most:
        gain = answers[:, left].sum(axis=1)
        best = int(np.argmax(gain))
        if gain[best] <= 0:
            break
        chosen.append(best)
        left &= answers[best] <= 0
    return chosen
