"""The evidence of one station's returns on query positions: the project's central kernel.

Every return within ``CUT`` point spacings of a query's line of sight takes part with full precision; beyond it a mass is
below 3e-8. Sums are kept in fixed point, so they do not depend on the order of returns, on tiles or on threads.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from ..progress import Progress
from ..sensing.presets import LOGISTIC, ZONE_SIGMAS, MassParameters
from .masses import FAR_FROM_STEP, level_conversion, log_one_minus, ray_masses
from .station_index import StationIndex, azimuth_half_width, azimuth_range, column_runs, place, row_range

CUT = 5.0
"""Point spacings around the line of sight: exp(-ln2 CUT^2) = 3e-8."""
NEAR_CUT = 2.2
"""Point spacings within which returns measure the local deviation: about 15 of them."""
LEAST_COSINE = math.cos(math.radians(80.0))
"""Beyond 80 degrees of incidence a return says nothing about the surface (footprint and noise grow as 1/cos)."""
LEAST_RANGE_M = 0.3
SLOPE_SPREAD = math.sqrt(0.5 / math.log(2.0))
"""Standard deviation, in point spacings, of the transverse offset along the slope under the weight exp(-kappa dy^2)."""
SMALLEST_MASS = 3e-9
ROUNDED_UP = 1.000001
SMALLEST_UNKNOWN = 1e-15
LOG_SCALE = float(1 << 36)
LENGTH_SCALE = float(1 << 40)
CLUSTER_SIGMAS = 4.0
CLUSTER_FLOOR_M = 0.004
"""Returns this close along the normal to the nearest one lie on the same surface: noise, or real unevenness of some mm."""


@dataclass(frozen=True)
class SensorModel:
    """What the masses are derived from; ``fixed`` replaces the derivation by a preset."""

    sigma: float
    """Of a return along its ray, metres."""
    model_sigma: float
    """Of the planned surface along its normal, metres (the level's sigma)."""
    fixed: MassParameters | None = None


@dataclass(frozen=True)
class StationEvidence:
    """Evidence of one station on N query positions; all arrays (N, ...)."""

    log_occ: NDArray[np.float64]
    """Sum of log(m_occ + m_unk) over the returns."""
    log_emp: NDArray[np.float64]
    log_unk: NDArray[np.float64]
    nearest: NDArray[np.int64]
    """Row of ``index.returns`` whose ray passes closest, within ``NEAR_CUT`` spacings; -1 where none does."""
    nearest_dy: NDArray[np.float64]
    """Its distance dy, metres."""
    deviation: NDArray[np.float64]
    """Mean signed distance along the normal of the surface that the nearest return lies on, metres; NaN without one."""
    count: NDArray[np.int32]
    """Returns in that mean."""
    cosine: NDArray[np.float64]
    """Cosine of the incidence angle; negative where the face is turned away."""
    distance: NDArray[np.float64]
    """Station to query, metres."""


@njit(cache=True, nogil=True, inline="always")
def mass_parameters(
    distance: float, cosine: float, spacing_rad: float, sigma: float, model_sigma: float,
    fixed_c: float, fixed_lam: float, fixed_kappa: float,
) -> tuple[float, float, float]:
    """(c, lambda, kappa) for a query at this distance and incidence.

    lambda = pi / (sqrt(3) s) with s^2 = sigma^2 + (model_sigma / cos)^2; kappa = ln2 / spacing^2; and the half-length of
    the occupied zone is widened by the slope of the surface under neighbouring rays:
    (c / lambda)^2 = (2 s)^2 + (2 * 0.85 spacing tan)^2.
    """
    if fixed_lam > 0.0:
        return fixed_c, fixed_lam, fixed_kappa
    spacing = distance * spacing_rad
    total2 = sigma * sigma + (model_sigma / cosine) ** 2
    lam = LOGISTIC / math.sqrt(total2)
    tangent2 = max(1.0 / (cosine * cosine) - 1.0, 0.0)
    half = ZONE_SIGMAS * math.sqrt(total2 + SLOPE_SPREAD * SLOPE_SPREAD * spacing * spacing * tangent2)
    return lam * half, lam, math.log(2.0) / (spacing * spacing)


@njit(cache=True, nogil=True, inline="always")
def _hidden_beyond(distance: float, cosine: float, spacing_rad: float, model_sigma: float) -> tuple[float, float]:
    """(a, b): behind a return of standard deviation s by more than a + b s [m], both of its masses are zero.

    From the derived parameters, since the root of a sum of squares is no more than the sum of their roots.
    """
    model, spacing = model_sigma / cosine, SLOPE_SPREAD * distance * spacing_rad / cosine
    per_sigma = ROUNDED_UP * (ZONE_SIGMAS + FAR_FROM_STEP / LOGISTIC)
    return per_sigma * model + ROUNDED_UP * ZONE_SIGMAS * spacing, per_sigma


@njit(cache=True, nogil=True, parallel=True)
def _gather(
    query: NDArray[np.float64], normal: NDArray[np.float64], order: NDArray[np.int64],
    returns: NDArray[np.float32], bin_start: NDArray[np.int64], row_start: NDArray[np.int64], spacing_rad: float,
    sigma: float, model_sigma: float, fixed_c: float, fixed_lam: float, fixed_kappa: float,
    own_sigma: NDArray[np.float64], converted: NDArray[np.float64],
    log_occ: NDArray[np.float64], log_emp: NDArray[np.float64], log_unk: NDArray[np.float64],
    nearest: NDArray[np.int64], nearest_dy: NDArray[np.float64], deviation: NDArray[np.float64],
    count: NDArray[np.int32], cosine_out: NDArray[np.float64], distance_out: NDArray[np.float64],
) -> None:
    rows = len(row_start) - 1
    graded = len(own_sigma) > 0
    for k in prange(len(order)):
        i = order[k]
        q, n = query[i], normal[i]
        distance2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2]
        distance = math.sqrt(distance2)
        distance_out[i] = distance
        if distance < LEAST_RANGE_M:
            continue
        cosine = -(q[0] * n[0] + q[1] * n[1] + q[2] * n[2]) / distance
        cosine_out[i] = cosine
        if cosine < LEAST_COSINE:
            continue
        c, lam, kappa = mass_parameters(
            distance, cosine, spacing_rad, sigma, model_sigma, fixed_c, fixed_lam, fixed_kappa
        )
        mass_reach2 = CUT * CUT * math.log(2.0) / kappa
        near_reach2 = (NEAR_CUT * distance * spacing_rad) ** 2
        radius = math.asin(min(math.sqrt(max(mass_reach2, near_reach2)) / distance, 1.0))
        half = azimuth_half_width(q, radius)
        begin, end = azimuth_range(q, half)
        first, last = row_range(q, radius, rows)
        hidden, per_sigma = _hidden_beyond(distance, cosine, spacing_rad, model_sigma) if graded else (0.0, 0.0)
        sum_occ = sum_emp = sum_unk = 0
        best, best_dy2, best_range = -1, near_reach2, 0.0
        outside = distance2 - 1.001 * max(mass_reach2, near_reach2)  # (q.r0)^2 of rays that pass too far away
        for row in range(first, last + 1):
            a, b, d, e = column_runs(begin, end, half, row, row_start, bin_start)
            for m in range(b - a + e - d):
                j = a + m if m < b - a else d + m - (b - a)
                x, y, z = place(returns, j)
                reach2 = x * x + y * y + z * z
                product = q[0] * x + q[1] * y + q[2] * z
                if product <= 0.0 or product * product < outside * reach2:
                    continue
                reach = math.sqrt(reach2)
                along = product / reach
                dy2 = max(distance2 - along * along, 0.0)
                if dy2 < best_dy2 or (dy2 == best_dy2 and best >= 0 and reach < best_range):
                    best, best_dy2, best_range = j, dy2, reach
                if dy2 <= mass_reach2:
                    if graded and fixed_lam <= 0.0:
                        if along - reach > hidden + per_sigma * own_sigma[j]:
                            continue
                        c, lam, kappa = mass_parameters(
                            distance, cosine, spacing_rad, own_sigma[j], model_sigma, fixed_c, fixed_lam, fixed_kappa
                        )
                    occ, emp = ray_masses(along - reach, dy2, c, lam, kappa)
                    if graded and fixed_lam > 0.0:
                        occ *= converted[j]
                        emp *= converted[j]
                    known = occ + emp
                    if known > SMALLEST_MASS:
                        log_unknown = (
                            log_one_minus(known) if known < 1e-3 else math.log(max(1.0 - occ - emp, SMALLEST_UNKNOWN))
                        )
                        sum_occ += int(log_one_minus(min(emp, 1.0 - SMALLEST_UNKNOWN)) * LOG_SCALE)
                        sum_emp += int(log_one_minus(min(occ, 1.0 - SMALLEST_UNKNOWN)) * LOG_SCALE)
                        sum_unk += int(log_unknown * LOG_SCALE)
        log_occ[i] = sum_occ / LOG_SCALE
        log_emp[i] = sum_emp / LOG_SCALE
        log_unk[i] = sum_unk / LOG_SCALE
        if best < 0:
            continue
        x, y, z = place(returns, best)
        level = (x - q[0]) * n[0] + (y - q[1]) * n[1] + (z - q[2]) * n[2]
        spread = own_sigma[best] if graded else sigma * cosine
        gate = max(CLUSTER_SIGMAS * spread, CLUSTER_FLOOR_M)
        total, members = 0, 0
        radius = math.asin(min(math.sqrt(near_reach2) / distance, 1.0))
        half = azimuth_half_width(q, radius)
        begin, end = azimuth_range(q, half)
        first, last = row_range(q, radius, rows)
        for row in range(first, last + 1):
            a, b, d, e = column_runs(begin, end, half, row, row_start, bin_start)
            for m in range(b - a + e - d):
                j = a + m if m < b - a else d + m - (b - a)
                x, y, z = place(returns, j)
                away = (x - q[0]) * n[0] + (y - q[1]) * n[1] + (z - q[2]) * n[2]
                if abs(away - level) > gate:
                    continue
                along = (q[0] * x + q[1] * y + q[2] * z) / math.sqrt(x * x + y * y + z * z)
                if along > 0.0 and distance2 - along * along <= near_reach2:
                    total += int(away * LENGTH_SCALE)
                    members += 1
        nearest[i] = best
        nearest_dy[i] = math.sqrt(best_dy2)
        deviation[i] = total / LENGTH_SCALE / max(members, 1)
        count[i] = members


AT_ONCE = 1 << 16
"""Query positions between two looks at whether the job was cancelled."""


def gather(
    index: StationIndex, query: NDArray[np.float64], normal: NDArray[np.float64], sensor: SensorModel,
    progress: Progress | None = None,
) -> StationEvidence:
    """Evidence of a station on query positions given relative to it, (N, 3) [m], with outward unit normals (N, 3).

    Returns with an accuracy of their own (tie points) are counted with it: in the masses that are derived, and by converting
    the beliefs of a preset to the level (eq. 5.24 of Meyer 2023).
    """
    count = len(query)
    fixed = sensor.fixed or MassParameters(0.0, 0.0, 0.0)
    own_sigma = np.zeros(0) if index.photo is None else np.ascontiguousarray(index.photo[:, 0])
    out = StationEvidence(
        log_occ=np.zeros(count), log_emp=np.zeros(count), log_unk=np.zeros(count),
        nearest=np.full(count, -1, np.int64), nearest_dy=np.full(count, np.nan),
        deviation=np.full(count, np.nan), count=np.zeros(count, np.int32),
        cosine=np.full(count, -1.0), distance=np.zeros(count),
    )
    query = np.ascontiguousarray(query, dtype=np.float64)
    normal = np.ascontiguousarray(normal, dtype=np.float64)
    conversion = level_conversion(own_sigma, sensor.model_sigma)
    order = order_by_direction(query) if len(index.returns) else np.zeros(0, np.int64)
    for first in range(0, len(order), AT_ONCE):
        if progress is not None:
            progress.check()
        _gather(
            query, normal, order[first : first + AT_ONCE],
            index.returns, index.bin_start, index.row_start, index.spacing_rad,
            sensor.sigma, sensor.model_sigma, fixed.c, fixed.lam, fixed.kappa, own_sigma, conversion,
            out.log_occ, out.log_emp, out.log_unk, out.nearest, out.nearest_dy, out.deviation, out.count,
            out.cosine, out.distance,
        )
    return out


def order_by_direction(query: NDArray[np.float64]) -> NDArray[np.int64]:
    """Neighbouring directions one after the other, so that the bins they share stay in the processor's cache."""
    rho = np.hypot(query[:, 0], query[:, 1])
    elevation = (np.arctan2(query[:, 2], rho) * (512 / np.pi)).astype(np.int64)
    azimuth = np.arctan2(query[:, 1], query[:, 0])
    return np.argsort(elevation * 16.0 + azimuth, kind="stable")
