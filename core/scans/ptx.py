"""PTX files: structured scans with their pose, missing returns written as 0 0 0."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from .campaign import Grid, Station
from .plain_columns import ColumnUse
from .scan_file import Columns, ScanFile, Setup, sensor_frame_setup
from .text_rows import TextRows

_HEADER_LINES = 10
_LARGEST_SIDE = 10_000_000
_RIGID = 1e-3
"""Largest departure of a header's rotation from a true one; more is a scale or a shear."""


class PtxFile(ScanFile):
    """Scans in the file's order. Each header gives columns, rows, scanner position and axes (not used: the matrix says
    the same) and a 4 x 4 matrix for row vectors, [x y z 1] @ matrix; points follow column by column."""

    format = "PTX"

    def __init__(self, path: Path) -> None:
        self._rows = TextRows(path)
        self._starts: list[int] = []
        self._has_color: list[bool] = []
        setups: list[Setup] = []
        counts: list[int] = []
        at = 0
        while True:
            lines: list[str] = []
            while at < self._rows.size and len(lines) < _HEADER_LINES:
                line, at = self._rows.line(at)
                if line:
                    lines.append(line)
            if not lines:
                break
            number = len(setups) + 1
            grid, position, rotation = self._header(path, lines, number)
            count = grid.rows * grid.columns
            passed, end = self._rows.skip(at, count)
            if passed < count:
                raise BimVerifyError(
                    f"{path} is cut off: scan {number} declares {count:,} points and holds {passed:,}. "
                    "Copy or export it again."
                )
            self._starts.append(at)
            self._has_color.append(len(self._rows.line(at)[0].split()) >= 7)
            counts.append(count)
            setups.append(sensor_frame_setup(Station(f"{path.stem} {number}", position, rotation, grid=grid)))
            at = end
        if len(setups) == 1:
            only = setups[0].station
            setups = [sensor_frame_setup(Station(path.stem, only.position, only.rotation, grid=only.grid))]
        super().__init__(path, setups, counts)

    @staticmethod
    def _header(path: Path, lines: list[str], number: int) -> tuple[Grid, NDArray[np.float64], NDArray[np.float64]]:
        bad = BimVerifyError(f"{path} is damaged: the header of scan {number} cannot be understood. Export it again.")
        try:
            columns, rows = int(lines[0]), int(lines[1])
            matrix = np.array([[float(word) for word in line.split()] for line in lines[6:]])
        except (ValueError, IndexError):
            raise bad from None
        sane = matrix.shape == (4, 4) and bool(np.isfinite(matrix).all())
        if not sane or not 0 < columns <= _LARGEST_SIDE or not 0 < rows <= _LARGEST_SIDE:
            raise bad
        turn = matrix[:3, :3].T
        if np.abs(turn @ turn.T - np.eye(3)).max() > _RIGID or np.linalg.det(turn) < 0:
            raise BimVerifyError(
                f"{path} cannot be used: the matrix of scan {number} scales or mirrors. Export it in metres, unscaled."
            )
        u, _, v = np.linalg.svd(turn)
        return Grid(rows, columns), matrix[3, :3].copy(), u @ v

    def columns(self, station: int, block_size: int, attributes: bool) -> Iterator[Columns]:
        use = ColumnUse(intensity=3, rgb=(4, 5, 6) if self._has_color[station] else None)
        width = (use.last if attributes else 2) + 1
        grid = self.setups[station].station.grid
        done = 0
        for table in self._rows.read(
            self._starts[station], width, 3, block_size, self.points_per_station[station]
        ):
            found = use.columns(table, attributes)
            if attributes and grid is not None:
                order = np.arange(done, done + len(table))
                row, column = (order % grid.rows).astype(np.int32), (order // grid.rows).astype(np.int32)
                found = Columns(found.x, found.y, found.z, None, found.intensity, found.color, row, column)
            done += len(table)
            yield found
