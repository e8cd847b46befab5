"""Where else could an element stand? Candidate shifts from what was seen before and behind its planned faces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .sightings import SEARCH_M

BIN_M = 0.005
LEAST_GROUP_SHARE = 0.15
"""A deviation counts when it is shared by at least this part of what was seen of the faces of one direction."""
FACE_COSINE = 0.97
MOST_FACES = 6


def face_groups(normal: NDArray[np.float64], weight: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Group of each normal (M,) (-1: none of the main directions) and the main directions (G, 3), heaviest first."""
    group = np.full(len(normal), -1, dtype=np.int64)
    directions: list[NDArray[np.float64]] = []
    free = np.ones(len(normal), dtype=np.bool_)
    bins = _direction_bin(normal)
    while free.any() and len(directions) < MOST_FACES:
        if not (weight[free] > 0).any():
            break
        heaviest = int(np.argmax(np.bincount(bins[free], weight[free])))
        seed = normal[free & (bins == heaviest)].mean(axis=0)
        seed /= np.linalg.norm(seed)
        member = free & (normal @ seed > FACE_COSINE)
        if not member.any():
            break
        mean = (normal[member] * weight[member, None]).sum(axis=0)
        group[member] = len(directions)
        directions.append(mean / np.linalg.norm(mean))
        free &= ~member
    return group, np.array(directions).reshape(-1, 3)


def _direction_bin(normal: NDArray[np.float64]) -> NDArray[np.int64]:
    """(M,) number of the cell, an eighth wide along each axis, that each unit normal (M, 3) falls into."""
    x, y, z = np.clip(np.round(np.nan_to_num(normal) * 8).astype(np.int64) + 8, 0, 16).T
    cell: NDArray[np.int64] = (x * 17 + y) * 17 + z
    return cell


def candidate_shifts(
    deviation: NDArray[np.float64],
    normal: NDArray[np.float64],
    weight: NDArray[np.float64],
    usable: NDArray[np.bool_],
    beyond: float,
) -> NDArray[np.float64]:
    """Shifts (K, 3) [m] worth a test: peaks of the deviations of each face direction, farther than ``beyond``.

    deviation (M,), normal (M, 3), weight (M,) of all sightings of one element; ``usable`` (M,) those that no other
    element explains.
    """
    group, directions = face_groups(normal, weight)
    edges = np.arange(-SEARCH_M, SEARCH_M + BIN_M, BIN_M)
    shifts = []
    for g, direction in enumerate(directions):
        of = group == g
        near = of & usable & (np.abs(deviation) < SEARCH_M)
        if not near.any():
            continue
        histogram = np.histogram(deviation[near], edges, weights=weight[near])[0]
        smooth = np.convolve(histogram, np.ones(3), mode="same")
        total = weight[of].sum()
        for _ in range(2):
            peak = int(np.argmax(smooth))
            if smooth[peak] < LEAST_GROUP_SHARE * total:
                break
            inside = near & (np.abs(deviation - 0.5 * (edges[peak] + edges[peak + 1])) < 1.5 * BIN_M)
            level = float(np.average(deviation[inside], weights=weight[inside]))
            if abs(level) > beyond:
                shifts.append(level * direction)
            smooth[max(peak - 4, 0) : peak + 5] = 0
    return np.array(shifts).reshape(-1, 3)
