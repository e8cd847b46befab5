"""What all readers share: raw columns of a file become returns that know their station."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..errors import BimVerifyError
from .campaign import DropCount, ReturnBlock, Station
from .origins import Origin

if TYPE_CHECKING:
    from ..imagery.block_points import BlockPoints

ZERO_RANGE_M = 1e-3
"""A return nearer to the scanner than this is none: nothing measures there, and exporters write missing ones so."""
SAME_PLACE_M = 1e-6
"""A point nearer to a presumed station than this has no direction."""
FARTHEST_M = 1e9
FAR_M = 1000.0
"""Clouds without a scanner position whose coordinates are larger get a local origin, so that offsets stay small."""


@dataclass(frozen=True)
class Columns:
    """Consecutive points of one station as they are in the file. All arrays have N entries, or are None."""

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    z: NDArray[np.float64]
    invalid: NDArray[np.uint8] | None = None
    """Not zero where the file says that there is no return."""
    intensity: NDArray[np.float32] | None = None
    color: NDArray[np.uint8] | None = None
    """(N, 3)"""
    row: NDArray[np.int32] | None = None
    column: NDArray[np.int32] | None = None
    normal: NDArray[np.float32] | None = None
    """(N, 3) in the file's axes."""
    photo: NDArray[np.float64] | None = None
    """(N, 3) see ``ReturnBlock.photo``."""
    origin: NDArray[np.float64] | None = None
    """(N, 3) where the scanner was, in the file's coordinates: clouds of mobile scanners name it for every point."""

    def rows(self, at: NDArray[np.int64]) -> Columns:
        """The points at rows ``at`` (K,)."""
        given = {f.name: getattr(self, f.name) for f in fields(self)}
        return replace(self, **{name: values[at] for name, values in given.items() if values is not None})


@dataclass(frozen=True)
class Setup:
    """One station and the way from the file's coordinates to offsets: offset = matrix @ xyz + shift."""

    station: Station
    matrix: NDArray[np.float64]
    shift: NDArray[np.float64]
    zero_range: float
    """Points nearer to the station than this (metres) are missing returns; 0, 0, 0 in the file always is one."""


def sensor_frame_setup(station: Station) -> Setup:
    """Points given in the sensor's own frame."""
    return Setup(station, np.ascontiguousarray(station.rotation, dtype=np.float64), np.zeros(3), ZERO_RANGE_M)


def scan_frame_setup(station: Station) -> Setup:
    """Points given in the scan frame, whatever the station."""
    zero_range = ZERO_RANGE_M if station.known else SAME_PLACE_M
    return Setup(station, np.eye(3), -np.asarray(station.position, dtype=np.float64), zero_range)


@njit(cache=True, nogil=True)
def _to_offsets(x, y, z, invalid, matrix, shift, zero_range, offsets, kept):  # type: ignore[no-untyped-def]
    count = 0
    n_invalid = 0
    n_zero = 0
    n_not_finite = 0
    zero2 = zero_range * zero_range
    a, b, c = matrix[0, 0], matrix[0, 1], matrix[0, 2]
    d, e, f = matrix[1, 0], matrix[1, 1], matrix[1, 2]
    g, h, i = matrix[2, 0], matrix[2, 1], matrix[2, 2]
    sx, sy, sz = shift[0], shift[1], shift[2]
    flagged = invalid.size > 0
    for k in range(x.size):
        if flagged and invalid[k] != 0:
            n_invalid += 1
            continue
        px, py, pz = x[k], y[k], z[k]
        ox = a * px + b * py + c * pz + sx
        oy = d * px + e * py + f * pz + sy
        oz = g * px + h * py + i * pz + sz
        range2 = ox * ox + oy * oy + oz * oz
        if not range2 < FARTHEST_M * FARTHEST_M:  # nor a number
            n_not_finite += 1
            continue
        if range2 < zero2 or (px == 0.0 and py == 0.0 and pz == 0.0):
            n_zero += 1
            continue
        offsets[count, 0] = ox
        offsets[count, 1] = oy
        offsets[count, 2] = oz
        kept[count] = k
        count += 1
    return count, n_invalid, n_zero, n_not_finite


_NONE = np.zeros(0, np.uint8)


class ScanFile(ABC):
    """One opened scan file. Readers give its setups and stream its raw columns; the rest is here."""

    format: str = ""
    block: BlockPoints | None = None
    """The block of photos that the file holds."""
    has_origins: bool = False
    """Every point comes with the place that it was measured from (``Columns.origin``)."""
    placed: tuple[int, ...] = ()
    """Stations of which the user said where they were."""

    def __init__(self, path: Path, setups: Sequence[Setup], points: Sequence[int]) -> None:
        self.path = path
        self.setups = tuple(setups)
        self.points_per_station = tuple(points)
        self._dropped = DropCount()
        if self.point_count == 0:
            raise BimVerifyError(f"{path} holds no points. Export the scan again.")

    @property
    def paths(self) -> tuple[str, ...]:
        return (str(self.path),)

    @property
    def stations(self) -> tuple[Station, ...]:
        return tuple(setup.station for setup in self.setups)

    @property
    def point_count(self) -> int:
        return sum(self.points_per_station)

    @property
    def dropped(self) -> DropCount:
        return self._dropped

    @abstractmethod
    def columns(self, station: int, block_size: int, attributes: bool) -> Iterator[Columns]:
        """Stream the raw points of one station, at most ``block_size`` at a time.

        Coordinates and flags may be written over by the next block; attributes belong to the receiver.
        """

    def blocks(self, block_size: int = 262_144, *, attributes: bool = False) -> Iterator[ReturnBlock]:
        """See :class:`~.campaign.ScanSource`. Raises BimVerifyError when the file is damaged or no return is left."""
        if block_size < 1:
            raise ValueError("block_size must be at least 1")
        self._dropped = dropped = DropCount()
        returns = 0
        kept = np.empty(min(block_size, max(self.points_per_station)), np.int64)
        try:
            for block in self._blocks(block_size, attributes, kept):
                if len(block.offsets):
                    returns += len(block.offsets)
                    yield block
        except OSError as error:
            raise BimVerifyError(
                f"Cannot read {self.path}: {error.strerror or error}. Check that it is still there."
            ) from error
        if returns == 0:
            raise BimVerifyError(
                f"{self.path} holds no valid return ({dropped.invalid} invalid, {dropped.zero} at zero, "
                f"{dropped.not_finite} not finite). Export the scan again."
            )

    def _blocks(self, block_size: int, attributes: bool, kept: NDArray[np.int64]) -> Iterator[ReturnBlock]:
        for index in range(len(self.setups)):
            if self.points_per_station[index]:
                for columns in self.columns(index, block_size, attributes):
                    yield self._returns(index, columns, kept, self._dropped)

    def _returns(self, index: int, columns: Columns, kept: NDArray[np.int64], dropped: DropCount) -> ReturnBlock:
        setup = self.setups[index]
        x, y, z = (np.ascontiguousarray(c, dtype=np.float64) for c in (columns.x, columns.y, columns.z))
        offsets = np.empty((len(x), 3))
        invalid = _NONE if columns.invalid is None else columns.invalid
        count, n_invalid, n_zero, n_not_finite = _to_offsets(
            x, y, z, invalid, setup.matrix, setup.shift, setup.zero_range, offsets, kept
        )
        dropped.invalid += n_invalid
        dropped.zero += n_zero
        dropped.not_finite += n_not_finite

        def pick(values: NDArray | None) -> NDArray | None:
            return values if values is None or count == len(x) else values[kept[:count]]

        return ReturnBlock(
            index, offsets[:count], pick(columns.intensity), pick(columns.color), pick(columns.row),
            pick(columns.column), None if columns.normal is None else pick(columns.normal @ setup.matrix.T.astype(np.float32)),
            pick(columns.photo),
        )

    def first_point(self, station: int) -> NDArray[np.float64] | None:
        """(3,) the first point of a station with finite coordinates that is not 0, 0, 0, in the file's coordinates."""
        for columns in self.columns(station, 4096, False):
            xyz = np.column_stack([columns.x, columns.y, columns.z])
            good = np.isfinite(xyz).all(axis=1) & (xyz != 0).any(axis=1)
            if columns.invalid is not None:
                good &= columns.invalid == 0
            if good.any():
                point: NDArray[np.float64] = xyz[np.argmax(good)]
                return point
        return None

    def place_unknown(self, origin: Origin | None) -> None:
        """Give stations of which the file does not know the position ``origin``, or else a place-holder near the data.

        The place-holder is 0, 0, 0, or the first point rounded to metres where coordinates exceed ``FAR_M``.
        """
        setups = []
        for index, setup in enumerate(self.setups):
            if setup.station.known:
                setups.append(setup)
                continue
            if origin is not None:
                self.placed += (index,)
                placed = replace(setup.station, position=np.array(origin, np.float64), known=True)
            else:
                first = self.first_point(index) if self.points_per_station[index] else None
                far = first is not None and bool(np.abs(first).max() > FAR_M)
                placed = replace(setup.station, position=np.round(first) if far and first is not None else np.zeros(3))
            setups.append(scan_frame_setup(placed))
        self.setups = tuple(setups)

    def replace_stations(self, stations: Collection[int], origin: Origin) -> None:
        """Put stations whose identity pose was found to be false at ``origin``; their points are in the scan frame."""
        self.placed += tuple(stations)
        self.setups = tuple(
            scan_frame_setup(replace(setup.station, position=np.array(origin, np.float64))) if index in stations else setup
            for index, setup in enumerate(self.setups)
        )
