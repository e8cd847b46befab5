"""On which face of one given element does a point lie, whatever else lies there too?"""

from __future__ import annotations

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from .elements import BuildingModel

PARALLEL = 0.5
"""Faces less than 60 degrees apart look the same way."""


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


@njit(cache=True, nogil=True, parallel=True)
def _on_element(
    point: NDArray[np.float64], normal: NDArray[np.float64], element: NDArray[np.int32], triangle: NDArray[np.int32],
    corner: NDArray[np.float64], facing: NDArray[np.float64], center: NDArray[np.float64], radius: NDArray[np.float64],
    start: NDArray[np.int64], depth: float, cosine: float,
) -> NDArray[np.int32]:
    out = np.full(len(point), -1, np.int32)
    for i in prange(len(point)):
        x, y, z = point[i]
        nx, ny, nz = normal[i]
        if _on_triangle(x, y, z, nx, ny, nz, corner[triangle[i]], facing[triangle[i]], depth, cosine):
            out[i] = triangle[i]
            continue
        for t in range(start[element[i]], start[element[i] + 1]):
            dx, dy, dz = x - center[t, 0], y - center[t, 1], z - center[t, 2]
            if dx * dx + dy * dy + dz * dz <= radius[t] and _on_triangle(
                x, y, z, nx, ny, nz, corner[t], facing[t], depth, cosine
            ):
                out[i] = t
                break
    return out


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
            self._center, (self._reach + depth) ** 2, self._start, depth, cosine,
        )
