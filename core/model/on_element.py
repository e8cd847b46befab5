"""On which face of one given element does a point lie, whatever else lies there too?"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from .elements import BuildingModel

PARALLEL = 0.5
"""Faces less than 60 degrees apart look the same way."""
BLOCK = 64
"""Triangles close together that are passed over as one when a point lies outside their box."""
ROUNDING_M = 1e-4
"""Boxes are larger by this: no triangle that holds a point may be passed over."""


@njit(cache=True, nogil=True, inline="always")
def _on_triangle(
    x: float, y: float, z: float, nx: float, ny: float, nz: float, t: NDArray[np.float64], m: NDArray[np.float64],
    depth: float, cosine: float,
) -> bool:
    if m[0] * nx + m[1] * ny + m[2] * nz < cosine:
        return False
    dx, dy, dz = x - t[0, 0], y - t[0, 1], z - t[0, 2]
    if abs(dx * m[0] + dy * m[1] + dz * m[2]) > depth:
        return False
    for k in range(3):
        a, b = t[k], t[(k + 1) % 3]
        ex, ey, ez = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        px, py, pz = x - a[0], y - a[1], z - a[2]
        inward = (
            (m[1] * ez - m[2] * ey) * px + (m[2] * ex - m[0] * ez) * py + (m[0] * ey - m[1] * ex) * pz
        )
        if inward < -1e-9:
            return False
    return True


@njit(cache=True, nogil=True, inline="always")
def _outside(x: float, y: float, z: float, box: NDArray[np.float64], around: float) -> bool:
    """Whether a point lies farther than ``around`` [m] outside a box (6,)."""
    return bool(
        x < box[0] - around or y < box[1] - around or z < box[2] - around
        or x > box[3] + around or y > box[4] + around or z > box[5] + around
    )


@njit(cache=True, nogil=True, parallel=True)
def _on_element(
    point: NDArray[np.float64], normal: NDArray[np.float64], element: NDArray[np.int32], triangle: NDArray[np.int32],
    corner: NDArray[np.float64], facing: NDArray[np.float64], center: NDArray[np.float64], radius: NDArray[np.float64],
    start: NDArray[np.int64], order: NDArray[np.int64], first: NDArray[np.int64], box: NDArray[np.float64],
    depth: float, cosine: float,
) -> NDArray[np.int32]:
    """The first triangle of each element that holds the point; ``order``, ``first`` and ``box`` are of ``_blocks``."""
    out = np.full(len(point), -1, np.int32)
    around = depth + ROUNDING_M
    for i in prange(len(point)):
        x, y, z = point[i]
        nx, ny, nz = normal[i]
        if _on_triangle(x, y, z, nx, ny, nz, corner[triangle[i]], facing[triangle[i]], depth, cosine):
            out[i] = triangle[i]
            continue
        e = element[i]
        best = start[e + 1]
        for b in range(first[e], first[e + 1]):
            if _outside(x, y, z, box[b], around):
                continue
            begin = start[e] + (b - first[e]) * BLOCK
            for k in range(begin, min(begin + BLOCK, start[e + 1])):
                t = order[k]
                dx, dy, dz = x - center[t, 0], y - center[t, 1], z - center[t, 2]
                if t < best and dx * dx + dy * dy + dz * dz <= radius[t] and _on_triangle(
                    x, y, z, nx, ny, nz, corner[t], facing[t], depth, cosine
                ):
                    best = t
        if best < start[e + 1]:
            out[i] = best
    return out


@njit(cache=True, nogil=True)
def _distance(x: float, y: float, z: float, t: NDArray[np.float64], m: NDArray[np.float64]) -> float:
    """Of a point from the triangle t (3, 3) with unit normal m."""
    inside, nearest = True, np.inf
    for k in range(3):
        a, b = t[k], t[(k + 1) % 3]
        ex, ey, ez = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        px, py, pz = x - a[0], y - a[1], z - a[2]
        if (m[1] * ez - m[2] * ey) * px + (m[2] * ex - m[0] * ez) * py + (m[0] * ey - m[1] * ex) * pz < 0.0:
            inside = False
        along = (px * ex + py * ey + pz * ez) / max(ex * ex + ey * ey + ez * ez, 1e-30)
        along = min(max(along, 0.0), 1.0)
        dx, dy, dz = px - along * ex, py - along * ey, pz - along * ez
        nearest = min(nearest, math.sqrt(dx * dx + dy * dy + dz * dz))
    if inside:
        return abs(m[0] * (x - t[0, 0]) + m[1] * (y - t[0, 1]) + m[2] * (z - t[0, 2]))
    return nearest


@njit(cache=True, nogil=True, parallel=True)
def _near_element(
    point: NDArray[np.float64], normal: NDArray[np.float64], element: NDArray[np.int32], corner: NDArray[np.float64],
    facing: NDArray[np.float64], start: NDArray[np.int64], order: NDArray[np.int64], first: NDArray[np.int64],
    box: NDArray[np.float64], within: float, cosine: float,
) -> NDArray[np.bool_]:
    out = np.zeros(len(point), np.bool_)
    around = within + ROUNDING_M
    for i in prange(len(point)):
        x, y, z = point[i]
        nx, ny, nz = normal[i]
        e = element[i]
        for b in range(first[e], first[e + 1]):
            if out[i] or _outside(x, y, z, box[b], around):
                continue
            begin = start[e] + (b - first[e]) * BLOCK
            for k in range(begin, min(begin + BLOCK, start[e + 1])):
                t = order[k]
                m = facing[t]
                if m[0] * nx + m[1] * ny + m[2] * nz >= cosine and _distance(x, y, z, corner[t], m) <= within:
                    out[i] = True
                    break
    return out


def _blocks(
    corner: NDArray[np.float64], center: NDArray[np.float64], start: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """(order, first, box): triangles (T,) element by element, neighbours together; each element's first block (E + 1,) of
    ``BLOCK`` of them; and the blocks' boxes (B, 6), lowest and highest corner [m]."""
    count = np.diff(start)
    first = np.concatenate([[0], np.cumsum(-(-count // BLOCK))])
    order = np.arange(len(corner))
    for e in np.flatnonzero(count > BLOCK).tolist():
        own = slice(int(start[e]), int(start[e + 1]))
        order[own] = start[e] + np.argsort(_along_curve(center[own]), kind="stable")
    block = np.repeat(first[:-1], count) + (np.arange(len(corner)) - np.repeat(start[:-1], count)) // BLOCK
    box = np.empty((int(first[-1]), 6))
    if len(block):
        begin = np.flatnonzero(np.diff(block, prepend=-1))
        box[:, :3] = np.minimum.reduceat(corner[order].min(axis=1), begin)
        box[:, 3:] = np.maximum.reduceat(corner[order].max(axis=1), begin)
    return order, first, box


def _along_curve(place: NDArray[np.float64]) -> NDArray[np.int64]:
    """(N,) places along a curve through their box on which neighbours (N, 3) are close together (Morton)."""
    low, high = place.min(axis=0), place.max(axis=0)
    cell = ((place - low) / np.maximum((high - low).max(), 1e-9) * 1023).astype(np.int64)
    number = np.zeros(len(place), np.int64)
    for bit in range(10):
        for axis in range(3):
            number |= ((cell[:, axis] >> bit) & 1) << (3 * bit + axis)
    return number


def plane_crossing(
    start: NDArray[np.float64], ray: NDArray[np.float64], place: NDArray[np.float64], normal: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(N, 3) where rays from ``start`` (3,) or (N, 3) along unit vectors (N, 3) cross the planes through ``place`` (N, 3).

    ``normal`` (N, 3) of the planes; a ray that runs along its plane crosses it far away.
    """
    slope = np.einsum("ij,ij->i", ray, normal)
    along = np.einsum("ij,ij->i", place - start, normal) / np.where(np.abs(slope) < 1e-6, -1e-6, slope)
    return np.asarray(start + ray * along[:, None])


class ElementSurfaces:
    """The triangles of a model, asked element by element."""

    def __init__(self, model: BuildingModel) -> None:
        self.corner = model.vertices[model.triangles]
        normal = np.cross(self.corner[:, 1] - self.corner[:, 0], self.corner[:, 2] - self.corner[:, 0])
        self.normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
        self._center = self.corner.mean(axis=1)
        self._reach = np.linalg.norm(self.corner - self._center[:, None, :], axis=2).max(axis=1)
        self._start = model.triangle_start.astype(np.int64)
        self._order, self._first, self._box = _blocks(self.corner, self._center, self._start)

    def face_at(
        self,
        point: NDArray[np.float64],
        normal: NDArray[np.float64],
        element: NDArray[np.int32],
        triangle: NDArray[np.int32],
        depth: float,
        cosine: float = PARALLEL,
    ) -> NDArray[np.int32]:
        """(N,) the triangle of ``element`` (N,) that point (N, 3) lies on, within ``depth`` metres; -1 where there is none.

        Only faces count whose normals have at least this ``cosine`` with ``normal`` (N, 3); ``triangle`` (N,) is tried first.
        """
        return _on_element(
            np.ascontiguousarray(point), np.ascontiguousarray(normal), element, triangle, self.corner, self.normal,
            self._center, (self._reach + depth) ** 2, self._start, self._order, self._first, self._box, depth, cosine,
        )

    def near(
        self, point: NDArray[np.float64], normal: NDArray[np.float64], element: NDArray[np.int32], within: float,
        cosine: float = PARALLEL,
    ) -> NDArray[np.bool_]:
        """(N,) whether a face of ``element`` (N,), turned like ``normal`` (N, 3), is no farther than ``within`` metres from
        point (N, 3), in any direction."""
        return np.asarray(_near_element(
            np.ascontiguousarray(point), np.ascontiguousarray(normal), element, self.corner, self.normal, self._start,
            self._order, self._first, self._box, within, cosine,
        ))
