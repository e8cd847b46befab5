"""Returns at an element's place that lie on a surface turned away from all of its faces nearby: they came from something else.

A box that stands where a chair stood, or a neighbour that moved into the place of a removed column, cuts through the faces of
what is gone. Where it does, its returns lie within the window of these faces, but not along them.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from ..model.on_element import ElementSurfaces
from ..model.samples import SurfaceSamples
from ..progress import Progress
from .collect import StationIndexes
from .gather import SensorModel
from .own_evidence import TOLD_APART_SIGMAS
from .sightings import GRAZE, Sightings
from .station_index import azimuth_half_width, azimuth_range, column_runs, place, row_range

AROUND_SPACINGS = 3.0
"""Returns whose rays are this close, in point spacings, tell how the surface is turned: about 28 on a square grid."""
FEWEST_FITTED = 8
LEAST_WIDE = 3.0
"""The returns lie on a plane, not on a line or in a heap, when they extend this many times farther along it both ways than
across."""


def find_turned(
    seen: Sightings, samples: SurfaceSamples, surfaces: ElementSurfaces, stations: StationIndexes,
    sensor: SensorModel, window: float, asked: NDArray[np.bool_],
) -> NDArray[np.int64]:
    """Rows of such returns, of those that are ``asked`` for (M,).

    ``window`` [m]: within it a return is at its place, and a face of the element is near, in any direction: a slender one that
    stands a little off returns beside its faces. Where the returns around lie on no plane (edges, slender or round things)
    nothing is said.
    """
    element = samples.element[seen.sample]
    row = np.flatnonzero(asked & (seen.station >= 0))
    if not len(row):
        return row
    normal = np.full((len(row), 3), np.nan)
    point = seen.point[row].astype(np.float64)
    for mine, _, offset, index in stations.around(seen.station[row], point, sensor, Progress(), spacings=AROUND_SPACINGS):
        normal[mine] = _normals(
            offset, index.returns, index.bin_start, index.row_start, AROUND_SPACINGS * index.spacing_rad,
            TOLD_APART_SIGMAS * sensor.sigma,
        )
    flat = np.isfinite(normal[:, 0])
    row, normal = row[flat], normal[flat]
    near = surfaces.near(point[flat], normal, element[row].astype(np.int32), window)
    return row[~near]


@njit(cache=True, nogil=True, parallel=True)
def _normals(
    asked: NDArray[np.float64], returns: NDArray[np.float32], bin_start: NDArray[np.int64], row_start: NDArray[np.int64],
    radius: float, flat: float,
) -> NDArray[np.float64]:
    """(N, 3) normals, towards the station, of the planes that the returns around lie on; NaN where they lie on none.

    asked (N, 3) returns and ``returns`` [m, from the station]; radius [rad]; they scatter less than ``flat`` [m] about it.
    """
    rows = len(row_start) - 1
    out = np.full((len(asked), 3), np.nan)
    for i in prange(len(asked)):
        p = asked[i]
        distance = math.sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2])
        reach = radius * distance
        mean, moment, count = np.zeros(3), np.zeros((3, 3)), 0
        half = azimuth_half_width(p, radius)
        begin, end = azimuth_range(p, half)
        first, last = row_range(p, radius, rows)
        for row in range(first, last + 1):
            a, b, c, d = column_runs(begin, end, half, row, row_start, bin_start)
            for k in range(b - a + d - c):
                x, y, z = place(returns, a + k if k < b - a else c + k - (b - a))
                dx, dy, dz = x - p[0], y - p[1], z - p[2]
                along = (dx * p[0] + dy * p[1] + dz * p[2]) / distance
                if dx * dx + dy * dy + dz * dz - along * along > reach * reach or abs(along) > reach / GRAZE:
                    continue
                q = (dx, dy, dz)
                for m in range(3):
                    mean[m] += q[m]
                    for n in range(3):
                        moment[m, n] += q[m] * q[n]
                count += 1
        if count < FEWEST_FITTED:
            continue
        for m in range(3):
            for n in range(3):
                moment[m, n] = moment[m, n] / count - mean[m] * mean[n] / (count * count)
        spread, axes = np.linalg.eigh(moment)
        thickness = math.sqrt(max(spread[0], 0.0))
        if thickness > flat or math.sqrt(max(spread[1], 0.0)) < LEAST_WIDE * thickness:
            continue
        facing = -1.0 if axes[0, 0] * p[0] + axes[1, 0] * p[1] + axes[2, 0] * p[2] > 0.0 else 1.0
        for m in range(3):
            out[i, m] = facing * axes[m, 0]
    return out
