"""Returns just beside a planned element: their rays miss it by no more than the uncertainty, so no surface lies along them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..model.elements import BuildingModel

SHARP = np.cos(np.radians(30.0))
"""Faces that meet at less than this angle are one round surface."""
WELD_M = 1e-5
"""Corners of one element closer than this are the same."""
STEPS_A_REACH = 3.0
MOST_PLACES = 3_000_000
"""Places along edges; beyond it they lie farther apart."""


class EdgeSearch:
    """The sharp edges of all elements, asked for the nearest one."""

    def __init__(self, model: BuildingModel, reach: float, shift: NDArray[np.float64] | None = None) -> None:
        """``reach`` [m]: farthest that a return may lie from an edge; ``shift`` (E, 3) [m] as in ``RayScene``."""
        self._reach = reach
        start, end, normal, element, closed = _sharp_edges(model)
        if shift is not None:
            keep = np.isfinite(shift[element]).all(axis=1)
            start, end, normal, element, closed = start[keep], end[keep], normal[keep], element[keep], closed[keep]
            start, end = start + shift[element], end + shift[element]
        self._start, self._along, self._normal, self._element, self._closed = start, end - start, normal, element, closed
        length = np.linalg.norm(self._along, axis=1)
        step = max(reach / STEPS_A_REACH, float(length.sum()) / MOST_PLACES)
        count = np.maximum(np.ceil(length / step), 1.0).astype(np.int64) + 1
        self._edge = np.repeat(np.arange(len(start)), count)
        rank = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        share = rank / np.repeat(count - 1, count)
        self._slack = 0.5 * step
        self._tree = cKDTree(start[self._edge] + share[:, None] * self._along[self._edge]) if len(start) else None

    def nearest(
        self, point: NDArray[np.float64], ray: NDArray[np.float64]
    ) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """(N,) the element whose edge is nearest to each point (N, 3) within reach, -1 for none, and (N,) [m] how far the
        point lies from the face of that edge that the ray (N, 3) meets more squarely, along its outward normal."""
        element = np.full(len(point), -1, np.int32)
        away = np.full(len(point), np.nan, np.float32)
        if self._tree is None or not len(point):
            return element, away
        _, place = self._tree.query(point, distance_upper_bound=float(np.hypot(self._reach, self._slack)))
        row = np.flatnonzero(place < len(self._edge))
        edge = self._edge[place[row]]
        offset, along = point[row] - self._start[edge], self._along[edge]
        share = np.einsum("ij,ij->i", offset, along) / np.maximum(np.einsum("ij,ij->i", along, along), 1e-18)
        offset -= np.clip(share, 0.0, 1.0)[:, None] * along
        slope = np.einsum("ikj,ij->ik", self._normal[edge], ray[row])
        # an open surface is met from both sides
        sign = np.where(~self._closed[edge][:, None] & (slope > 0), -1.0, 1.0)
        slope *= sign
        face = slope.argmin(axis=1)
        pick = np.arange(len(row)), face
        good = (np.linalg.norm(offset, axis=1) <= self._reach) & (slope[pick] < 0)
        normal = self._normal[edge][pick] * sign[pick][:, None]
        element[row[good]] = self._element[edge][good]
        away[row[good]] = np.einsum("ij,ij->i", offset, normal)[good]
        return element, away


def _sharp_edges(
    model: BuildingModel,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.int32], NDArray[np.bool_]]:
    """Start and end (M, 3) [m], the normals (M, 2, 3) of the faces there, element (M,), whether that is closed (M,)."""
    corner = model.vertices[model.triangles]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-18)
    owner = model.triangle_element
    key = np.empty((corner.size // 3, 4), np.int64)
    key[:, 0] = np.repeat(owner, 3)
    key[:, 1:] = np.round(corner.reshape(-1, 3) / WELD_M).astype(np.int64)
    welded = np.unique(key, axis=0, return_inverse=True)[1].reshape(-1, 3)
    ends = np.stack([welded, np.roll(welded, -1, axis=1)], axis=-1).reshape(-1, 2)
    triangle = np.repeat(np.arange(len(owner)), 3)
    first = np.arange(len(ends)) % 3
    ends.sort(axis=1)
    order = np.lexsort((triangle, ends[:, 1], ends[:, 0]))
    ends, triangle, first = ends[order], triangle[order], first[order]
    begins = np.flatnonzero(np.r_[True, (ends[1:] != ends[:-1]).any(axis=1)])
    last = np.r_[begins[1:], len(ends)] - 1
    one, other = triangle[begins], triangle[last]
    sharp = (np.einsum("ij,ij->i", normal[one], normal[other]) < SHARP) | (last == begins)
    begins, one, other = begins[sharp], one[sharp], other[sharp]
    a = first[begins]
    return (
        corner[one, a], corner[one, (a + 1) % 3], np.stack([normal[one], normal[other]], axis=1),
        owner[one].astype(np.int32), model.closed[owner[one]],
    )
