"""M3C2: signed distance between two clouds along given normals, with its level of detection at 95 %.

Lague, Brodu and Leroux (2013); the level of detection is eq. 6.3 of Meyer (2023):
LOD = 1.96 (sqrt(s1^2 / n1 + s2^2 / n2) + reg).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from ..errors import BimVerifyError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
QUANTILE = 1.959964
"""Of the normal distribution at 95 %, two-sided."""
FEWEST = 2


@dataclass(frozen=True)
class M3C2:
    """Per core point (N,). NaN where a cloud has too few points in the cylinder."""

    distance: Floats
    """Metres along the normal, of the second cloud from the first."""
    level: Floats
    """Metres: smaller distances are not significant at 95 %."""
    spread: Floats
    """(N, 2) standard deviations along the normal, metres"""
    count: Ints
    """(N, 2) points in the cylinder."""

    @property
    def significant(self) -> NDArray[np.bool_]:
        """(N,) the distance differs from zero at 95 %."""
        return np.abs(self.distance) > self.level


def m3c2(
    core: Floats, normal: Floats, first: Floats, second: Floats, *, radius: float, reach: float, registration: float = 0.0
) -> M3C2:
    """Compare clouds (M, 3) at core points (N, 3) along unit normals (N, 3).

    Cylinders have ``radius`` and go ``reach`` to both sides, metres; ``registration`` is the error between the clouds, metres.
    Raises BimVerifyError when a length is not larger than zero.
    """
    if not (0 < radius < math.inf and 0 < reach < math.inf and registration >= 0):
        raise BimVerifyError("M3C2 needs a radius and a reach larger than zero, and a registration error of zero or more.")
    core, normal = np.ascontiguousarray(core, dtype=np.float64), np.ascontiguousarray(normal, dtype=np.float64)
    mean, spread, count = np.empty((len(core), 2)), np.empty((len(core), 2)), np.zeros((len(core), 2), dtype=np.int64)
    for k, cloud in enumerate((first, second)):
        mean[:, k], spread[:, k], count[:, k] = _along(core, normal, np.asarray(cloud, dtype=np.float64), radius, reach)
    enough = (count >= FEWEST).all(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        level = QUANTILE * (np.sqrt((spread**2 / count).sum(axis=1)) + registration)
    distance = np.where(enough, mean[:, 1] - mean[:, 0], np.nan)
    return M3C2(distance, np.where(enough, level, np.nan), spread, count)


def _along(core: Floats, normal: Floats, cloud: Floats, radius: float, reach: float) -> tuple[Floats, Floats, Ints]:
    """Mean and standard deviation along the normal, and number, of a cloud's points in each cylinder."""
    if not len(cloud):
        nothing = np.full(len(core), np.nan)
        return nothing, nothing, np.zeros(len(core), dtype=np.int64)
    low = cloud.min(axis=0) - radius
    # cylinders are walked through in balls of twice the radius, so cells of that size keep neighbours within 27
    size = max(2.0 * radius, float((cloud.max(axis=0) - low).max()) / 1e6)
    shape = np.floor((cloud.max(axis=0) - low) / size).astype(np.int64) + 1
    key = _keys(cloud, low, size, shape)
    order = np.argsort(key, kind="stable")
    return _cylinders(core, normal, np.ascontiguousarray(cloud[order]), key[order], low, size, shape, radius, reach)


def _keys(cloud: Floats, low: Floats, size: float, shape: Ints) -> Ints:
    cell = np.floor((cloud - low) / size).astype(np.int64)
    return np.asarray((cell[:, 0] * shape[1] + cell[:, 1]) * shape[2] + cell[:, 2])


@njit(cache=True, nogil=True, parallel=True)
def _cylinders(
    core: Floats, normal: Floats, cloud: Floats, key: Ints, low: Floats, size: float, shape: Ints, radius: float, reach: float
) -> tuple[Floats, Floats, Ints]:
    mean, spread = np.full(len(core), np.nan), np.full(len(core), np.nan)
    count = np.zeros(len(core), dtype=np.int64)
    for i in prange(len(core)):
        c, n = core[i], normal[i]
        bottom, top = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
        for a in range(3):
            half = reach * abs(n[a]) + radius * np.sqrt(max(1.0 - n[a] * n[a], 0.0))
            bottom[a] = max(int(np.floor((c[a] - half - low[a]) / size)), 0)
            top[a] = min(int(np.floor((c[a] + half - low[a]) / size)), shape[a] - 1)
        number, total, square = 0, 0.0, 0.0
        for x in range(bottom[0], top[0] + 1):
            for y in range(bottom[1], top[1] + 1):
                row = (x * shape[1] + y) * shape[2]
                start = np.searchsorted(key, row + bottom[2])
                for j in range(start, len(key)):
                    if key[j] > row + top[2]:
                        break
                    dx, dy, dz = cloud[j, 0] - c[0], cloud[j, 1] - c[1], cloud[j, 2] - c[2]
                    t = dx * n[0] + dy * n[1] + dz * n[2]
                    if abs(t) <= reach and dx * dx + dy * dy + dz * dz - t * t <= radius * radius:
                        number += 1
                        change = t - total
                        total += change / number
                        square += change * (t - total)
        count[i] = number
        if number > 0:
            mean[i] = total
        if number > 1:
            spread[i] = np.sqrt(square / (number - 1))
    return mean, spread, count
