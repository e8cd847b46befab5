"""Which directions, and up to which range, a station measured: from its returns."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

ELEVATION_BINS = 1800
AZIMUTH_BINS = 720
STRAY_RETURNS = 20
"""So many returns outside a limit are strays, not proof of another limit."""
GAP_BINS = 8
"""4 degrees of azimuth without a single return, floor to ceiling: that sector was not scanned."""


@dataclass(frozen=True)
class FieldOfView:
    """Angles in radians, sensor frame; metres."""

    elevation_min: float
    elevation_max: float
    azimuth_gap: NDArray[np.bool_]
    """(AZIMUTH_BINS,) sectors that were not scanned, counted from azimuth 0."""
    range_max: float

    def outside(self, direction: NDArray[np.float64], margin: float, low: float, high: float) -> NDArray[np.bool_]:
        """(N,) whether directions (N, 3), sensor frame, unit, lie in a sector that was not scanned or beyond the elevations
        ``low`` to ``high``, by more than ``margin`` [rad]."""
        elevation = np.arcsin(np.clip(direction[:, 2], -1.0, 1.0))
        sector = (np.arctan2(direction[:, 1], direction[:, 0]) % (2 * math.pi) * (AZIMUTH_BINS / (2 * math.pi))).astype(int)
        return (
            (elevation < low - margin) | (elevation > high + margin) | self.azimuth_gap[np.minimum(sector, AZIMUTH_BINS - 1)]
        )


@njit(cache=True, nogil=True)
def _histograms(offsets, turn, elevation, azimuth, reach, longest):  # type: ignore[no-untyped-def]
    for i in range(len(offsets)):
        p = offsets[i]
        x = turn[0, 0] * p[0] + turn[1, 0] * p[1] + turn[2, 0] * p[2]
        y = turn[0, 1] * p[0] + turn[1, 1] * p[1] + turn[2, 1] * p[2]
        z = turn[0, 2] * p[0] + turn[1, 2] * p[1] + turn[2, 2] * p[2]
        level = math.sqrt(x * x + y * y)
        total = math.sqrt(level * level + z * z)
        e = int((math.atan2(z, level) / math.pi + 0.5) * len(elevation))
        elevation[min(max(e, 0), len(elevation) - 1)] += 1
        a = math.atan2(y, x)
        if a < 0.0:
            a += 2.0 * math.pi
        azimuth[min(int(a / (2.0 * math.pi) * len(azimuth)), len(azimuth) - 1)] += 1
        if total > reach[0]:  # keep the longest ranges, smallest first
            k = 0
            while k + 1 < longest and total > reach[k + 1]:
                reach[k] = reach[k + 1]
                k += 1
            reach[k] = total


class FieldOfViewCounter:
    """Counts the returns of one station, tile by tile."""

    def __init__(self, rotation: NDArray[np.float64]) -> None:
        self._turn = np.ascontiguousarray(rotation, dtype=np.float64)
        self._elevation = np.zeros(ELEVATION_BINS, np.int64)
        self._azimuth = np.zeros(AZIMUTH_BINS, np.int64)
        self._reach = np.zeros(STRAY_RETURNS)

    def add(self, offsets: NDArray[np.floating[Any]]) -> None:
        """Returns (N, 3) minus station, scan frame."""
        _histograms(offsets, self._turn, self._elevation, self._azimuth, self._reach, STRAY_RETURNS)

    def result(self) -> FieldOfView:
        """What was counted."""
        below, above = np.cumsum(self._elevation), np.cumsum(self._elevation[::-1])
        few = min(STRAY_RETURNS, max(int(below[-1]) // 1000, 1))
        low = int(np.searchsorted(below, few))
        high = ELEVATION_BINS - int(np.searchsorted(above, few))
        step = math.pi / ELEVATION_BINS
        return FieldOfView(
            low * step - math.pi / 2, high * step - math.pi / 2, _long_gaps(self._azimuth == 0), float(self._reach[0])
        )


def _long_gaps(empty: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The bins of runs (around the circle) of at least ``GAP_BINS`` empty ones."""
    if empty.all() or not empty.any():
        return np.zeros(len(empty), dtype=np.bool_)
    start = int(np.flatnonzero(~empty)[0])
    rolled = np.roll(empty, -start)
    edge = np.flatnonzero(np.diff(np.concatenate([[False], rolled, [False]]).astype(np.int8)))
    gap = np.zeros(len(empty), dtype=np.bool_)
    for begin, end in zip(edge[::2], edge[1::2], strict=True):
        gap[begin:end] = end - begin >= GAP_BINS
    return np.roll(gap, start)
