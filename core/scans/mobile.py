"""Clouds of mobile scanners that carry, with every point, where the scanner was: each stretch of its path is a station.

Everything after the readers knows stations. The path is cut into cubes of ``STRETCH_M``; the points that were measured
from one cube become the returns of one station in the middle of the places they were measured from. Where a return ends
stays exact; where its ray began is off by no more than half a cube's diagonal, which at half the distance moves it half as
far.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from .campaign import ReturnBlock, Station
from .scan_file import Columns, ScanFile, scan_frame_setup

STRETCH_M = 1.0
MOST_STATIONS = 5000
_BLOCK = 262_144


class MobileFile(ScanFile):
    """A file whose points know the scanner's place, as a campaign of stretches in the order they were first used.

    Points without a finite place are dropped. Raises BimVerifyError when the path cannot be cut into stretches.
    """

    def __init__(self, file: ScanFile) -> None:
        self._file = file
        self.format = file.format
        cells: dict[tuple[int, int, int], int] = {}
        count: list[int] = []
        total: list[NDArray[np.float64]] = []
        for columns in file.columns(0, _BLOCK, False):
            place, cell, first, inverse = _cells(columns)
            number = np.bincount(inverse, minlength=len(cell))
            for k in np.argsort(first, kind="stable"):
                key = (int(cell[k, 0]), int(cell[k, 1]), int(cell[k, 2]))
                if key not in cells:
                    cells[key] = len(count)
                    count.append(0)
                    total.append(np.zeros(3))
                count[cells[key]] += int(number[k])
            for axis in range(3):
                part = np.bincount(inverse, weights=place[:, axis], minlength=len(cell))
                for k, value in enumerate(part):
                    total[cells[(int(cell[k, 0]), int(cell[k, 1]), int(cell[k, 2]))]][axis] += value
            if len(cells) > MOST_STATIONS:
                raise BimVerifyError(
                    f"{file.path} was measured along a path of more than {MOST_STATIONS} m. Cut it into smaller files."
                )
        if not cells:
            raise BimVerifyError(f"{file.path} names no finite scanner position for any point. Export it again.")
        self._cells = cells
        base: Station = file.stations[0]
        setups = [
            scan_frame_setup(replace(base, name=f"{base.name} {k + 1}", position=total[k] / count[k], known=True))
            for k in range(len(count))
        ]
        super().__init__(file.path, setups, count)

    def columns(self, station: int, block_size: int, attributes: bool) -> Iterator[Columns]:
        for number, columns in self._split(block_size, attributes):
            if number == station:
                yield columns

    def _blocks(self, block_size: int, attributes: bool, kept: NDArray[np.int64]) -> Iterator[ReturnBlock]:
        """In the order of the file: one pass, however many stretches."""
        for station, columns in self._split(block_size, attributes):
            yield self._returns(station, columns, kept, self._dropped)

    def _split(self, block_size: int, attributes: bool) -> Iterator[tuple[int, Columns]]:
        for columns in self._file.columns(0, block_size, attributes):
            _, cell, _, inverse = _cells(columns)
            finite = np.flatnonzero(_finite(columns))
            order = finite[np.argsort(inverse, kind="stable")]
            edge = np.searchsorted(np.sort(inverse), np.arange(len(cell) + 1))
            for k in range(len(cell)):
                rows = np.sort(order[edge[k] : edge[k + 1]])
                station = self._cells[(int(cell[k, 0]), int(cell[k, 1]), int(cell[k, 2]))]
                yield station, columns.rows(rows)


def _finite(columns: Columns) -> NDArray[np.bool_]:
    assert columns.origin is not None
    return np.asarray(np.isfinite(columns.origin).all(axis=1))


def _cells(columns: Columns) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Finite places (K, 3), the cubes they lie in (C, 3), the first row of each, and the cube of every place (K,)."""
    assert columns.origin is not None
    place = columns.origin[_finite(columns)]
    cell, first, inverse = np.unique(
        np.floor(place / STRETCH_M).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    return place, cell, first, inverse.ravel()
