"""Where rays meet the face of a wall: returns on it, rays that went through it, and those stopped in front of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from ..planes.cloud import Cloud

Array = NDArray[np.float64]

BAND_M = 0.012
"""Least half-width of the band about the face whose returns lie on it."""
BEFORE = 0.5
"""Share of the band before the face."""
GRAZING_COS = 0.08
HIDDEN_M = 6.0
"""A return this far before a face still hides it."""
CHUNK = 65_536


@dataclass(frozen=True)
class Crossings:
    """Rays at one face: places along the wall and heights [m], how far behind the face they ended, which return it was."""

    u: Array
    z: Array
    depth: Array
    """(N,) metres behind the face; about 0 for a return on it, negative for one in front that hides it."""
    end_u: Array
    end_z: Array
    """(N,) place of the return itself."""
    row: NDArray[np.int64]
    """(N,) rows of the cloud."""

    def on_face(self, band: float) -> NDArray[np.bool_]:
        """(N,) the return lies on the face. A leaf that stands open a centimetre before it does not."""
        return (self.depth >= -BEFORE * band) & (self.depth <= band)

    def __len__(self) -> int:
        return len(self.u)


def cross(
    cloud: Cloud, normal: Array, offset: float, along: Array, u: tuple[float, float], z: tuple[float, float],
    band: float = BAND_M,
) -> Crossings:
    """Rays towards the part u, z of the upright plane ``normal`` . (x, y) = ``offset`` from the side of the normal.

    Rays that end in front of it are followed to it, up to HIDDEN_M.
    """
    chunks = -(-len(cloud.points) // CHUNK)
    counts = np.zeros(chunks, dtype=np.int64)
    arguments = (
        cloud.points, cloud.station, cloud.stations, np.ascontiguousarray(normal), float(offset),
        np.ascontiguousarray(along), u[0], u[1], z[0], z[1], band, HIDDEN_M, GRAZING_COS, CHUNK,
    )
    nothing, rows = np.zeros((0, 5)), np.zeros(0, dtype=np.int64)
    _cross(*arguments, counts, np.zeros(chunks, dtype=np.int64), nothing, rows, False)
    begin = np.concatenate([[0], np.cumsum(counts)])
    values, rows = np.empty((int(begin[-1]), 5)), np.empty(int(begin[-1]), dtype=np.int64)
    _cross(*arguments, counts, begin[:-1], values, rows, True)
    return Crossings(values[:, 0], values[:, 1], values[:, 2], values[:, 3], values[:, 4], rows)


@njit(parallel=True, cache=True, nogil=True)
def _cross(  # type: ignore[no-untyped-def]
    points, station, stations, n, c, along, u0, u1, z0, z1, band, hidden, grazing, chunk, counts, begin, values, rows, write
):
    front = np.empty(len(stations))
    for s in range(len(stations)):
        front[s] = stations[s, 0] * n[0] + stations[s, 1] * n[1] - c
    for k in prange(len(counts)):
        count = 0
        for i in range(k * chunk, min((k + 1) * chunk, len(points))):
            o = station[i]
            if front[o] < 0.05:
                continue
            p = points[i]
            d = p[0] * n[0] + p[1] * n[1] - c
            if d > hidden or d > front[o] - 0.05:
                continue
            t = 1.0
            if d < -band or d > band:
                t = front[o] / (front[o] - d)
            dx, dy, dz = p[0] - stations[o, 0], p[1] - stations[o, 1], p[2] - stations[o, 2]
            u = (stations[o, 0] + t * dx) * along[0] + (stations[o, 1] + t * dy) * along[1]
            if u < u0 or u > u1:
                continue
            z = stations[o, 2] + t * dz
            if z < z0 or z > z1:
                continue
            length = np.sqrt(dx * dx + dy * dy + dz * dz)
            if (front[o] - d) < grazing * length:
                continue
            if write:
                at = begin[k] + count
                values[at, 0] = u
                values[at, 1] = z
                values[at, 2] = -d
                values[at, 3] = p[0] * along[0] + p[1] * along[1]
                values[at, 4] = p[2]
                rows[at] = i
            count += 1
        if not write:
            counts[k] = count
