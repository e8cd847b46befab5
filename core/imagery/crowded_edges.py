"""Edges that an image cannot tell apart: a frame's edge beside that of its reveal, a pixel away.

The detector finds one line for them, on any of them or between. Which one is not known, so the line is worth less.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
RESOLUTION_PX = 1.5
"""Standard deviation of the blur of lens, sensor and detector together: edges so far apart are mostly one line."""
REACH_PX = 4.0 * RESOLUTION_PX
PARALLEL = math.sin(math.radians(4.0))
LEAST_OVERLAP = 0.3
SAME_PX = 0.05
BLOCK = 512


def crowding(pixel: Vector) -> Vector:
    """(N,) how far from each edge its line may lie [px]: the distance of a neighbour times how likely it is taken for it.

    ``pixel`` (N, 4) are both ends of the edges' visible parts. Zero where an edge stands alone.
    """
    start, along = pixel[:, :2], pixel[:, 2:] - pixel[:, :2]
    length = np.linalg.norm(along, axis=1)
    along = along / length[:, None]
    normal = np.column_stack([-along[:, 1], along[:, 0]])
    middle = 0.5 * (pixel[:, :2] + pixel[:, 2:])
    out = np.zeros(len(pixel))
    for first in range(0, len(pixel), BLOCK):
        rows = slice(first, first + BLOCK)
        off = np.einsum("rni,ri->rn", middle[None] - start[rows, None], normal[rows])
        ends = [np.einsum("rni,ri->rn", pixel[None, :, s] - start[rows, None], along[rows]) for s in (slice(0, 2), slice(2, 4))]
        overlap = np.minimum(np.maximum(*ends), length[rows, None]) - np.maximum(np.minimum(*ends), 0.0)
        near = (np.abs(normal[rows] @ along.T) < PARALLEL) & (np.abs(off) < REACH_PX) & (np.abs(off) > SAME_PX)
        near &= overlap > LEAST_OVERLAP * length[rows, None]
        likely = np.exp(-0.5 * (off / RESOLUTION_PX) ** 2)
        out[rows] = np.sqrt((near * likely * off**2).max(axis=1, initial=0.0))
    return out
