"""Which part of a picture lies inside a solid that the cutting plane goes through."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..model.elements import BuildingModel
from .camera import Camera

WELD_M = 1e-4
"""Ends of segments closer than this are one corner."""


def cut_mask(model: BuildingModel, camera: Camera, size: tuple[int, int]) -> NDArray[np.int32]:
    """(H, W) row of the solid element that the plane z = ``camera.cut_z`` cuts at each pixel; -1 where it cuts none.

    ``size`` is (W, H). Each element's outline in the plane is filled by the even-odd rule, so touching faces of
    neighbours do not matter.
    """
    width, height = size
    mask = np.full((height, width), -1, dtype=np.int32)
    if camera.cut_z is None:
        return mask
    segment, owner = _outline(model, camera.cut_z)
    if not len(segment):
        return mask
    pixels = camera.project(segment.reshape(-1, 3), size).reshape(-1, 2, 2)
    start = np.searchsorted(owner, np.unique(owner)).astype(np.int64)
    _fill(mask, pixels, owner, np.append(start, len(owner)))
    return mask


def _outline(model: BuildingModel, z: float) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Segments (K, 2, 3) in which elements meet the plane in closed outlines, and their elements (K,), ascending."""
    corner = model.vertices[model.triangles]
    above = corner[:, :, 2] > z
    crossing = above.any(axis=1) & ~above.all(axis=1)
    corner, above, owner = corner[crossing], above[crossing], model.triangle_element[crossing]
    alone = np.argmax(above == (above.sum(axis=1) == 1)[:, None], axis=1)
    row = np.arange(len(corner))
    tip = corner[row, alone]
    ends = []
    for turn in (1, 2):
        base = corner[row, (alone + turn) % 3]
        share = (z - tip[:, 2]) / (base[:, 2] - tip[:, 2])
        ends.append(tip + share[:, None] * (base - tip))
    return _closed_only(np.stack(ends, axis=1).reshape(-1, 2, 3), owner)


def _closed_only(
    segment: NDArray[np.float64], owner: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Without the twins of two-sided sheets, and without elements whose outline does not close."""
    grid = np.rint(segment[:, :, :2] / WELD_M).astype(np.int64)
    swap = (grid[:, 0, 0] > grid[:, 1, 0]) | ((grid[:, 0, 0] == grid[:, 1, 0]) & (grid[:, 0, 1] > grid[:, 1, 1]))
    grid[swap] = grid[swap][:, ::-1]
    _, first = np.unique(np.column_stack([owner, grid.reshape(-1, 4)]), axis=0, return_index=True)
    segment, owner, grid = segment[first], owner[first], grid[first]
    ends = np.column_stack([np.repeat(owner, 2), grid.reshape(-1, 2)])
    node, count = np.unique(ends, axis=0, return_counts=True)
    closes = ~np.isin(owner, node[count % 2 == 1, 0])
    return segment[closes], owner[closes]


@njit(cache=True, nogil=True)
def _fill(
    mask: NDArray[np.int32], segment: NDArray[np.float64], owner: NDArray[np.int32], start: NDArray[np.int64]
) -> None:
    height, width = mask.shape
    for group in range(len(start) - 1):
        first, last = start[group], start[group + 1]
        low, high = 1e18, -1e18
        for k in range(first, last):
            low = min(low, segment[k, 0, 1], segment[k, 1, 1])
            high = max(high, segment[k, 0, 1], segment[k, 1, 1])
        crossing = np.empty(last - first)
        for row in range(max(0, int(np.floor(low))), min(height, int(np.ceil(high)) + 1)):
            y = row + 0.5
            count = 0
            for k in range(first, last):
                y0, y1 = segment[k, 0, 1], segment[k, 1, 1]
                if (y0 <= y) != (y1 <= y):
                    x0, x1 = segment[k, 0, 0], segment[k, 1, 0]
                    crossing[count] = x0 + (y - y0) / (y1 - y0) * (x1 - x0)
                    count += 1
            ordered = np.sort(crossing[:count])
            for pair in range(0, count - 1, 2):
                left = max(0, int(np.ceil(ordered[pair] - 0.5)))
                right = min(width, int(np.ceil(ordered[pair + 1] - 0.5)))
                for column in range(left, right):
                    mask[row, column] = owner[first]
