"""Small pieces of surface: returns by voxel, each voxel with its middle, normal and roughness."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from ..errors import BimVerifyError
from .cloud import Cloud

Array = NDArray[np.float64]

LEAST_RETURNS = 6
LEVELS = 3
"""Voxels with fewer returns than LEAST_RETURNS are put together into voxels of twice the edge, this often."""
MOST_VOXELS_AXIS = 2**20


@dataclass(frozen=True)
class Surfels:
    """One row a piece of surface, local frame, metres."""

    position: Array
    """(M, 3)"""
    normal: Array
    """(M, 3) unit vectors, turned to the stations that saw it."""
    roughness: Array
    """(M,) standard deviation of the returns along the normal."""
    planarity: Array
    """(M,) variance along the normal over that of the plane's weaker direction: small on a surface, large on an edge."""
    area: Array
    """(M,) of the voxel's face, m2."""
    count: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.position)

    def where(self, chosen: NDArray[np.bool_] | NDArray[np.int64]) -> Surfels:
        """Some of the rows."""
        return Surfels(
            self.position[chosen], self.normal[chosen], self.roughness[chosen], self.planarity[chosen],
            self.area[chosen], self.count[chosen],
        )


def make_surfels(cloud: Cloud, edge: float = 0.06) -> Surfels:
    """Surfels of ``edge`` metres, larger where the returns are too thin for a normal."""
    points, station = cloud.points, cloud.station
    parts = []
    for level in range(LEVELS):
        if len(points) < LEAST_RETURNS:
            break
        size = edge * 2**level
        low = points.min(axis=0).astype(np.float64) - size
        grid = (np.ptp(points, axis=0).astype(np.float64) / size + 3).astype(np.int64)
        if grid.max() > MOST_VOXELS_AXIS:
            raise BimVerifyError(
                f"The returns reach over {np.ptp(points, axis=0).max():.0f} m, too far for a building; cut the scans first."
            )
        key = _keys(points, low, size, grid)
        order = np.argsort(key, kind="stable")
        key = key[order]
        start = np.concatenate([[0], np.flatnonzero(np.diff(key)) + 1, [len(key)]])
        enough = np.diff(start) >= LEAST_RETURNS
        first, last = start[:-1][enough], start[1:][enough]
        values = _moments(points, station, cloud.stations, order, first, last)
        parts.append((*values, np.full(len(first), size * size), last - first))
        if level + 1 < LEVELS:
            rest = np.repeat(~enough, np.diff(start))
            points, station = points[order[rest]], station[order[rest]]
    if not parts:
        return Surfels(*(np.zeros((0, 3)),) * 2, *(np.zeros(0),) * 3, np.zeros(0, np.int64))
    return Surfels(*(np.concatenate(column) for column in zip(*parts, strict=True)))


@njit(parallel=True, cache=True, nogil=True)
def _keys(points, low, size, grid):  # type: ignore[no-untyped-def]
    out = np.empty(len(points), np.int64)
    for i in prange(len(points)):
        x = np.int64((points[i, 0] - low[0]) / size)
        y = np.int64((points[i, 1] - low[1]) / size)
        z = np.int64((points[i, 2] - low[2]) / size)
        out[i] = (x * grid[1] + y) * grid[2] + z
    return out


@njit(parallel=True, cache=True, nogil=True)
def _moments(points, station, stations, order, first, last):  # type: ignore[no-untyped-def]
    count = len(first)
    position, normal = np.empty((count, 3)), np.empty((count, 3))
    roughness, planarity = np.empty(count), np.empty(count)
    for v in prange(count):
        mean, view, s = np.zeros(3), np.zeros(3), np.zeros((3, 3))
        n = last[v] - first[v]
        base = points[order[first[v]]]
        for k in range(first[v], last[v]):
            p = points[order[k]]
            o = stations[station[order[k]]]
            dx, dy, dz = o[0] - p[0], o[1] - p[1], o[2] - p[2]
            length = np.sqrt(dx * dx + dy * dy + dz * dz) + 1e-12
            view[0] += dx / length
            view[1] += dy / length
            view[2] += dz / length
            for a in range(3):
                da = np.float64(p[a]) - np.float64(base[a])
                mean[a] += da
                for b in range(a, 3):
                    s[a, b] += da * (np.float64(p[b]) - np.float64(base[b]))
        for a in range(3):
            mean[a] /= n
        for a in range(3):
            for b in range(a, 3):
                s[a, b] = s[a, b] / n - mean[a] * mean[b]
                s[b, a] = s[a, b]
        values, vectors = np.linalg.eigh(s)
        dot = vectors[0, 0] * view[0] + vectors[1, 0] * view[1] + vectors[2, 0] * view[2]
        sign = 1.0 if dot >= 0 else -1.0
        for a in range(3):
            position[v, a] = np.float64(base[a]) + mean[a]
            normal[v, a] = sign * vectors[a, 0]
        roughness[v] = np.sqrt(max(values[0], 0.0))
        planarity[v] = max(values[0], 0.0) / max(values[1], 1e-12)
    return position, normal, roughness, planarity
