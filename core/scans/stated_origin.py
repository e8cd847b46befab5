"""Is a scanner position of 0, 0, 0 true? Exporters of merged clouds write an identity pose as if one scanner had seen all.

From its scanner a return hides what lies behind it, so returns in nearly the same direction lie at nearly the same range,
but for edges and foliage. Seen from a place where no scanner stood, walls stand behind walls.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .campaign import ScanSource, Station

CELL_DEG = 0.25
BEHIND_RATIO, BEHIND_M = 1.05, 0.3
"""A return lies behind another of its cell beyond this multiple of the range and these metres: more than slope and noise."""
MOST_BEHIND = 0.2
"""Measured: 0 to 2 % on real and simulated set-ups, 35 to 84 % on merged ones."""
FEWEST = 200
"""Returns that share their cell with another; with fewer nothing is said."""
_ROWS, _COLUMNS = round(180 / CELL_DEG), round(360 / CELL_DEG)


def is_identity(station: Station) -> bool:
    """Whether the stated pose is exactly none."""
    return station.known and not station.position.any() and bool((station.rotation == np.eye(3)).all())


def impossible_stations(source: ScanSource, also: Collection[int] = ()) -> dict[int, float]:
    """Stations at 0, 0, 0, and those of the numbers ``also``, from which nobody can have seen their returns, and the share that
    others would have hidden.

    Reads the source twice, but only when it has a station with an identity pose, or there are others to ask.
    """
    doubted = {index for index, station in enumerate(source.stations) if is_identity(station)} | set(also)
    if not doubted:
        return {}
    nearest = {index: np.full(_ROWS * _COLUMNS, np.inf) for index in doubted}
    count = {index: np.zeros(_ROWS * _COLUMNS, np.int64) for index in doubted}
    for index, offsets in _returns(source, doubted):
        _note_nearest(offsets, nearest[index], count[index])
    behind = dict.fromkeys(doubted, 0)
    for index, offsets in _returns(source, doubted):
        behind[index] += _count_behind(offsets, nearest[index])
    shares = {}
    for index in sorted(doubted):
        told = int(count[index][count[index] > 1].sum())
        if told >= FEWEST and behind[index] > MOST_BEHIND * told:
            shares[index] = behind[index] / told
    return shares


def _returns(source: ScanSource, stations: set[int]) -> Iterable[tuple[int, NDArray[np.float64]]]:
    return ((block.station, block.offsets) for block in source.blocks() if block.station in stations)


@njit(cache=True, nogil=True)
def _cell(x: float, y: float, z: float, distance: float) -> int:
    row = int((math.asin(min(max(z / distance, -1.0), 1.0)) / math.pi + 0.5) * _ROWS)
    column = int((math.atan2(y, x) / (2 * math.pi) + 0.5) * _COLUMNS)
    return min(row, _ROWS - 1) * _COLUMNS + min(column, _COLUMNS - 1)


@njit(cache=True, nogil=True)
def _note_nearest(offsets: NDArray[np.float64], nearest: NDArray[np.float64], count: NDArray[np.int64]) -> None:
    for i in range(len(offsets)):
        x, y, z = offsets[i, 0], offsets[i, 1], offsets[i, 2]
        distance = math.sqrt(x * x + y * y + z * z)
        if distance > 0.0:
            cell = _cell(x, y, z, distance)
            nearest[cell] = min(nearest[cell], distance)
            count[cell] += 1


@njit(cache=True, nogil=True)
def _count_behind(offsets: NDArray[np.float64], nearest: NDArray[np.float64]) -> int:
    behind = 0
    for i in range(len(offsets)):
        x, y, z = offsets[i, 0], offsets[i, 1], offsets[i, 2]
        distance = math.sqrt(x * x + y * y + z * z)
        if distance > 0.0 and distance > BEHIND_RATIO * nearest[_cell(x, y, z, distance)] + BEHIND_M:
            behind += 1
    return behind
