"""The returns of a classification, grouped by element and station, within a memory budget."""

from __future__ import annotations

import tempfile
from pathlib import Path
from types import TracebackType

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..progress import Progress
from ..scans.read_ahead import read_ahead
from .results import Classification

COLORS = ("colorRed", "colorGreen", "colorBlue")
AXES = ("cartesianX", "cartesianY", "cartesianZ")
STATION, DEVIATION = "bv:station", "bv:deviation"
_GREY = 160
ROW = np.dtype(
    [(a, np.float64) for a in AXES] + [("intensity", np.float32)] + [(c, np.uint8) for c in COLORS]
    + [("rowIndex", np.int32), ("columnIndex", np.int32), (STATION, np.int32), (DEVIATION, np.float32)]
)
"""One return: metres; names as in E57 files, so that they are written as they are."""
SHARE_OF_MEMORY = 0.5


@njit(cache=True, nogil=True)
def _places(key: NDArray[np.int64], cursor: NDArray[np.int64]) -> NDArray[np.int64]:
    """Where each return goes: behind those of the same key that came before it."""
    out = np.empty(len(key), np.int64)
    for i in range(len(key)):
        out[i] = cursor[key[i]]
        cursor[key[i]] += 1
    return out


class SortedReturns:
    """Reads the source of a classification again. Use as a context manager: a temporary file goes with it.

    Returns are held as ``ROW``s in the order element, station, file; those on no element come last.
    """

    def __init__(
        self, result: Classification, memory_gb: float, progress: Progress | None = None, *, sensor_frame: bool = False
    ) -> None:
        """``sensor_frame``: coordinates in the frame of each return's station, else in the model frame."""
        self.counts = result.counts
        self.start = np.concatenate([[0], np.cumsum(result.counts.ravel())])
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        total = int(self.start[-1])
        if total * ROW.itemsize > SHARE_OF_MEMORY * memory_gb * 1e9:
            self._folder = tempfile.TemporaryDirectory(prefix="bim_verify_")
            self.rows: NDArray = np.memmap(Path(self._folder.name) / "returns", ROW, "w+", shape=(total,))
        else:
            self.rows = np.empty(total, ROW)
        self.has_intensity = self.has_color = self.has_grid = False
        try:
            self._fill(result, progress or Progress(), sensor_frame)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> SortedReturns:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Forget the returns and remove the temporary file."""
        self.rows = np.empty(0, ROW)
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None

    def of(self, element: int, station: int | None = None) -> slice:
        """Which rows are those of an element (the number of elements: of none), of one station or of all."""
        stations = self.counts.shape[1]
        first = element * stations + (station or 0)
        return slice(int(self.start[first]), int(self.start[first + (stations if station is None else 1)]))

    def _fill(self, result: Classification, progress: Progress, sensor_frame: bool) -> None:
        elements, stations = len(result.counts) - 1, len(result.stations)
        cursor = self.start[:-1].copy()
        done = 0
        for block in read_ahead(lambda: result.source.blocks(attributes=True)):
            part = slice(done, done + len(block.offsets))
            done = part.stop
            station = result.stations[block.station]
            rows = np.zeros(len(block.offsets), ROW)
            xyz = block.offsets @ station.rotation if sensor_frame else block.offsets + station.position
            for axis, values in zip(AXES, xyz.T, strict=True):
                rows[axis] = values
            if block.intensity is not None:
                rows["intensity"], self.has_intensity = block.intensity, True
            for k, color in enumerate(COLORS):
                rows[color] = _GREY if block.color is None else block.color[:, k]
            self.has_color |= block.color is not None
            if block.row is not None and block.column is not None:
                rows["rowIndex"], rows["columnIndex"], self.has_grid = block.row, block.column, True
            rows[STATION] = block.station
            rows[DEVIATION] = np.nan_to_num(result.deviation[part])
            element = result.element[part]
            key = np.where(element >= 0, element, elements).astype(np.int64) * stations + block.station
            self.rows[_places(key, cursor)] = rows
            progress.update(done / max(len(result.element), 1), "Grouping returns by element")
