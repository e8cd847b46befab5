"""The returns of one epoch as points with the station that each was measured from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from ..progress import Progress
from ..scans.campaign import ScanSource

Array = NDArray[np.float64]
GOLDEN = 0.5 * (5**0.5 - 1)
BYTES_PER_POINT = 200
"""Peak while a wall is worked on: coordinates in three frames, and masks."""


@dataclass(frozen=True)
class Epoch:
    """Points (N, 3) [m, local frame], the station of each (N,), and the stations (S, 3); NaN where one is not known."""

    points: Array
    station: NDArray[np.int32]
    stations: Array
    date: str = ""
    paths: tuple[str, ...] = ()
    kept_one_in: int = 1

    def take(self, rows: NDArray[np.int64]) -> Epoch:
        """The same epoch with only these points."""
        return Epoch(self.points[rows], self.station[rows], self.stations, self.date, self.paths, self.kept_one_in)



def spread_rows(count: int, wanted: float) -> NDArray[np.int64]:
    """About ``wanted`` of ``count`` row numbers, ascending, evenly spread whatever the period of the rows' order is.

    The fractional parts of multiples of the golden ratio have no period, so no scan line or raster row is favoured.
    """
    if wanted >= count:
        return np.arange(count)
    return np.flatnonzero(_spread(count, wanted / count))


@njit(cache=True, nogil=True, parallel=True)
def _spread(count, share):  # type: ignore[no-untyped-def]
    kept = np.empty(count, np.bool_)
    for i in prange(count):
        kept[i] = (i * GOLDEN) % 1.0 < share
    return kept


def read_epoch(source: ScanSource, origin: Array, memory_gb: float, progress: Progress) -> Epoch:
    """Read all returns, or every n-th where all do not fit; local frame = scan frame - ``origin`` (3,)."""
    stride = max(1, int(np.ceil(source.point_count * BYTES_PER_POINT / (0.5 * memory_gb * 1e9))))
    stations = np.array([s.position - origin if s.known else [np.nan] * 3 for s in source.stations])
    parts, owners, read = [], [], 0
    for block in source.blocks():
        first = -read % stride
        read += len(block.offsets)
        place = source.stations[block.station].position - origin
        parts.append(block.offsets[first::stride] + place)
        owners.append(np.full(len(parts[-1]), block.station, np.int32))
        progress.update(read / max(source.point_count, 1), f"Reading returns ({read / 1e6:.1f} million)")
    points = np.concatenate(parts) if parts else np.zeros((0, 3))
    station = np.concatenate(owners) if owners else np.zeros(0, np.int32)
    date = max((s.acquired for s in source.stations), default="")
    return Epoch(points, station, stations, date, source.paths, stride)
