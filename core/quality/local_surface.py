"""What the returns of one station say about the surface at each query position: density, offset, noise.

Of the returns whose rays pass within ``REACH`` point spacings of the line of sight, those on the planned surface are
fitted by a plane of their own (offset and two slopes against the planned one), so that neither deviation nor tilt of
what was built counts as noise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from ..evidence.gather import order_by_direction
from ..evidence.station_index import StationIndex, azimuth_half_width, azimuth_range, column_runs, place, row_range

REACH = 2.5
"""Point spacings around the line of sight: about 20 returns, enough for a plane and its scatter."""
GATE_M = 0.02
"""Returns this close along the normal to the nearest one may lie on its surface; the fit then narrows it."""
TRIM_SIGMAS = 3.0
LEAST_GATE_M = 0.0005
FEWEST = 6
"""Returns for a plane with a scatter."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LocalSurface:
    """Per query position (N,). Lengths in metres; NaN where there is nothing to measure."""

    rays: NDArray[np.int32]
    """Returns whose rays pass within reach, whatever they met."""
    nearest: NDArray[np.int64]
    """Row of ``index.returns`` whose ray passes closest; -1 where none is in reach."""
    nearest_dy: Array
    level: Array
    """Of the nearest return along the planned normal."""
    on_dy: Array
    """Distance of the closest ray whose return lies on the surface."""
    on: NDArray[np.int32]
    """Returns in the plane fit."""
    offset: Array
    """Of the fitted plane at the query, along the planned normal."""
    square: Array
    """Sum of squared residuals of the fit, m2, with ``on - 3`` degrees of freedom."""
    cosine: Array
    distance: Array


@njit(cache=True, nogil=True, parallel=True)
def _measure(  # type: ignore[no-untyped-def]
    query, normal, order, returns, bin_start, row_start, spacing_rad, window,
    rays, nearest, nearest_dy, level, on_dy, on, offset, square, cosine, far,
):
    rows = len(row_start) - 1
    for o in prange(len(order)):
        i = order[o]
        q, n = query[i], normal[i]
        d2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2]
        distance = math.sqrt(d2)
        far[i] = distance
        if distance <= 0.0:
            continue
        cosine[i] = -(q[0] * n[0] + q[1] * n[1] + q[2] * n[2]) / distance
        reach = REACH * spacing_rad * distance
        reach2 = reach * reach
        radius = math.asin(min(REACH * spacing_rad, 1.0))
        half = azimuth_half_width(q, radius)
        begin, end = azimuth_range(q, half)
        first, last = row_range(q, radius, rows)
        # two axes in the planned surface
        if abs(n[2]) < 0.9:
            ux, uy, uz = -n[1], n[0], 0.0
        else:
            ux, uy, uz = 0.0, -n[2], n[1]
        length = math.sqrt(ux * ux + uy * uy + uz * uz)
        ux, uy, uz = ux / length, uy / length, uz / length
        vx, vy, vz = n[1] * uz - n[2] * uy, n[2] * ux - n[0] * uz, n[0] * uy - n[1] * ux

        best, best_dy2, best_range = -1, reach2, 0.0
        best_on, best_on_dy2, best_on_away = -1, reach2, 0.0
        count = 0
        for row in range(first, last + 1):
            a, b, c, d = column_runs(begin, end, half, row, row_start, bin_start)
            for m in range(b - a + d - c):
                j = a + m if m < b - a else c + m - (b - a)
                x, y, z = place(returns, j)
                product = q[0] * x + q[1] * y + q[2] * z
                if product <= 0.0:
                    continue
                p2 = x * x + y * y + z * z
                dy2 = max(d2 - product * product / p2, 0.0)
                if dy2 > reach2:
                    continue
                count += 1
                if dy2 < best_dy2 or (dy2 == best_dy2 and p2 < best_range):
                    best, best_dy2, best_range = j, dy2, p2
                away = (x - q[0]) * n[0] + (y - q[1]) * n[1] + (z - q[2]) * n[2]
                if abs(away) <= window and (
                    dy2 < best_on_dy2 or (dy2 == best_on_dy2 and best_on >= 0 and away < best_on_away)
                ):
                    best_on, best_on_dy2, best_on_away = j, dy2, away
        rays[i] = count
        if best < 0:
            continue
        x, y, z = place(returns, best)
        nearest[i] = best
        nearest_dy[i] = math.sqrt(best_dy2)
        level[i] = (x - q[0]) * n[0] + (y - q[1]) * n[1] + (z - q[2]) * n[2]
        if best_on < 0:
            continue
        on_dy[i] = math.sqrt(best_on_dy2)

        # plane w = a0 + a1 u + a2 v: once around the nearest return's level, then trimmed
        a0, a1, a2, gate = best_on_away, 0.0, 0.0, GATE_M
        used = 0
        for _ in range(2):
            s, su, sv, suu, suv, svv, sw, swu, swv, sww = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for row in range(first, last + 1):
                a, b, c, d = column_runs(begin, end, half, row, row_start, bin_start)
                for m in range(b - a + d - c):
                    j = a + m if m < b - a else c + m - (b - a)
                    x, y, z = place(returns, j)
                    product = q[0] * x + q[1] * y + q[2] * z
                    if product <= 0.0:
                        continue
                    p2 = x * x + y * y + z * z
                    if d2 - product * product / p2 > reach2:
                        continue
                    x, y, z = x - q[0], y - q[1], z - q[2]
                    u = (x * ux + y * uy + z * uz) / reach
                    v = (x * vx + y * vy + z * vz) / reach
                    w = x * n[0] + y * n[1] + z * n[2]
                    if abs(w - a0 - a1 * u - a2 * v) > gate:
                        continue
                    s += 1.0
                    su += u
                    sv += v
                    suu += u * u
                    suv += u * v
                    svv += v * v
                    sw += w
                    swu += w * u
                    swv += w * v
                    sww += w * w
            used = int(s)
            if used < 1:
                break
            if used < FEWEST:
                a0, a1, a2 = sw / s, 0.0, 0.0
                square[i] = np.nan
                break
            mu, mv, mw = su / s, sv / s, sw / s
            cuu, cuv, cvv = suu - s * mu * mu, suv - s * mu * mv, svv - s * mv * mv
            cwu, cwv, cww = swu - s * mw * mu, swv - s * mw * mv, sww - s * mw * mw
            determinant = cuu * cvv - cuv * cuv
            if determinant < 1e-6 * cuu * cvv or determinant <= 0.0:
                a0, a1, a2 = mw, 0.0, 0.0
                square[i] = np.nan
                break
            a1 = (cwu * cvv - cwv * cuv) / determinant
            a2 = (cwv * cuu - cwu * cuv) / determinant
            a0 = mw - a1 * mu - a2 * mv
            square[i] = max(cww - a1 * cwu - a2 * cwv, 0.0)
            gate = max(TRIM_SIGMAS * math.sqrt(square[i] / (s - 3.0)), LEAST_GATE_M)
        on[i] = used
        offset[i] = a0


def measure_surface(index: StationIndex, query: Array, normal: Array, window: float) -> LocalSurface:
    """Measure at query positions (N, 3) [m] given relative to the station, with outward unit normals (N, 3).

    ``window`` [m]: returns within it of the planned surface, along the normal, lie on that surface. The result does not
    depend on the order of the queries or on threads; it does depend on returns only through sums in the order of the index.
    """
    count = len(query)
    out = LocalSurface(
        rays=np.zeros(count, np.int32), nearest=np.full(count, -1, np.int64), nearest_dy=np.full(count, np.nan),
        level=np.full(count, np.nan), on_dy=np.full(count, np.nan), on=np.zeros(count, np.int32),
        offset=np.full(count, np.nan), square=np.full(count, np.nan), cosine=np.full(count, -1.0),
        distance=np.zeros(count),
    )
    query = np.ascontiguousarray(query, dtype=np.float64)
    if len(index.returns) and count:
        _measure(
            query, np.ascontiguousarray(normal, dtype=np.float64), order_by_direction(query), index.returns,
            index.bin_start, index.row_start, index.spacing_rad, window, out.rays, out.nearest, out.nearest_dy, out.level,
            out.on_dy, out.on, out.offset, out.square, out.cosine, out.distance,
        )
    return out
