"""Returns beside an element whose place beams pass: a bar that stands a little off is missed by the beams that should meet it.

Of a wall that is 9 mm off most beams still tell, within the tolerance of its place. A bar of 10 mm has then left them all: they
pass its planned place, and others return from it beside that.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from ..model.parts import Parts
from ..model.raycast import RayScene
from ..model.samples import SurfaceSamples
from ..progress import Progress
from .as_found import AsFound
from .own_evidence import TOLD_APART_SIGMAS
from .scenery import Scenery
from .shared_surface import on_others
from .sightings import BEYOND, GRAZE, Sightings, hits_around
from .station_index import azimuth_half_width, azimuth_range, column_runs, row_range
from .station_index import place as place_of


def passed_beside(
    scenery: Scenery, seen: Sightings, samples: SurfaceSamples, as_found: AsFound, scene: RayScene, window: float, parts: Parts,
    asked: NDArray[np.bool_], progress: Progress,
) -> NDArray[np.int64]:
    """Rows of beams that pass an element ``asked`` for (E,) where it may stand beside: the return of their station that is
    nearest to the passed position is no farther than ``window`` [m] from it, in any direction, and nothing planned explains it.

    Along the normal such a return would be at the place. ``scene``: everything where it was found.
    """
    element = samples.element[seen.sample].astype(np.int64)
    row = np.flatnonzero(asked[element] & seen.on_face & (seen.state(window) == BEYOND) & (seen.station >= 0))
    near = _nearest(scenery, seen, row, samples, window, progress)
    found = np.isfinite(near[:, 0])
    row, near = row[found], near[found]
    distance = np.linalg.norm(near - samples.position[seen.sample[row]], axis=1)
    explained, sigma, origins = np.zeros(len(row), np.bool_), scenery.sensor.sigma, scenery.origins(seen.rows(row))
    for away, triangle in hits_around(scene, origins, near, scenery.explain_within):
        explained |= (scene.element[triangle] != element[row]) & (away + sigma < distance)
    far = np.flatnonzero(distance > (TOLD_APART_SIGMAS + 1.0) * sigma)  # a board's back hides the wall that it lies on
    back = origins[far] - near[far]
    back /= np.maximum(np.linalg.norm(back, axis=1, keepdims=True), 1e-9)
    on, _, _ = on_others(
        scenery.model, scenery.surfaces, near[far], back, element[row[far]].astype(np.int32), TOLD_APART_SIGMAS * sigma, parts,
        GRAZE, as_found.shift,
    )
    explained[far[on]] = True
    return row[~explained]


def _nearest(
    scenery: Scenery, seen: Sightings, row: NDArray[np.int64], samples: SurfaceSamples, window: float, progress: Progress
) -> NDArray[np.float64]:
    """(K, 3) of each ``row`` (K,) its station's return nearest to the position, within ``window`` [m]; NaN: there is none."""
    near = np.full((len(row), 3), np.nan)
    if not len(row):
        return near
    place = samples.position[seen.sample[row]]
    around = scenery.stations.around(seen.station[row], place, scenery.sensor, progress, within=window)
    for mine, station, offset, index in around:
        found = _nearest_return(offset, index.returns, index.bin_start, index.row_start, window)
        some = found >= 0
        near[mine[some]] = index.returns[found[some]].astype(np.float64) + scenery.stations.position[station]
    return near


@njit(cache=True, nogil=True, parallel=True)
def _nearest_return(
    asked: NDArray[np.float64], returns: NDArray[np.float32], bin_start: NDArray[np.int64], row_start: NDArray[np.int64],
    within: float,
) -> NDArray[np.int64]:
    """(N,) of the returns the nearest to each place ``asked`` for (N, 3), both from the station [m]; -1 beyond ``within``."""
    rows = len(row_start) - 1
    out = np.full(len(asked), -1, np.int64)
    for i in prange(len(asked)):
        p = asked[i]
        distance = math.sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2])
        radius = math.asin(min(within / distance, 1.0))
        nearest = within * within
        half = azimuth_half_width(p, radius)
        begin, end = azimuth_range(p, half)
        first, last = row_range(p, radius, rows)
        for row in range(first, last + 1):
            a, b, c, d = column_runs(begin, end, half, row, row_start, bin_start)
            for k in range(b - a + d - c):
                j = a + k if k < b - a else c + k - (b - a)
                x, y, z = place_of(returns, j)
                dx, dy, dz = x - p[0], y - p[1], z - p[2]
                away = dx * dx + dy * dy + dz * dz
                if away < nearest:
                    nearest = away
                    out[i] = j
    return out
