"""The outer faces of voxels, as a mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..change.solids import VoxelBox

AT_ONCE = 4_000_000
"""Voxels looked at together, so that memory follows the faces and not the voxels inside."""
SIDES = np.array([[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]])


def voxel_skin(
    index: NDArray[np.int64], anchor: NDArray[np.float64], edge: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Outer faces of voxels (N, 3): vertices (V, 3) [m, frame of ``anchor``] and quads (Q, 4), outward."""
    if not len(index):
        return np.zeros((0, 3)), np.zeros((0, 4), np.int64)
    box = VoxelBox.around(index.min(axis=0), index.max(axis=0))
    return skin(np.sort(box.code(index)), box, anchor, edge)


def skin(
    code: NDArray[np.int64], box: VoxelBox, anchor: NDArray[np.float64], edge: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """The same for the numbers of voxels in a box, sorted."""
    corner_box = VoxelBox(box.low, box.size + 1)
    corners = [np.zeros((0, 4), np.int64)]
    for side in SIDES:
        axis = int(np.flatnonzero(side)[0])
        u, v = np.eye(3, dtype=np.int64)[[(axis + 1) % 3, (axis + 2) % 3]]
        for part in in_parts(code):
            open_side = box.index(part[~among(code, part + box.step(side))])
            base = open_side + np.maximum(side, 0)
            ring = [base, base + u, base + u + v, base + v]
            corners.append(np.stack([corner_box.code(c) for c in (ring if side.sum() > 0 else ring[::-1])], axis=1))
    used, inverse = np.unique(np.concatenate(corners), return_inverse=True)
    return anchor + edge * corner_box.index(used), inverse.reshape(-1, 4)


def in_parts(code: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    return np.split(code, range(AT_ONCE, len(code), AT_ONCE)) if len(code) else []


def among(known: NDArray[np.int64], code: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(N,) is each of ``code`` (N,) among ``known``, which are sorted."""
    if not len(known):
        return np.zeros(len(code), np.bool_)
    return known[np.minimum(np.searchsorted(known, code), len(known) - 1)] == code
