"""E57 files: many scans with poses, Cartesian or spherical, every number format of the standard (ASTM E2807)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..errors import BimVerifyError
from .campaign import Grid, Station
from .e57_header import ScanHeader, read_headers
from .e57_pages import E57Pages
from .e57_records import read_records
from .scan_file import Columns, ScanFile, Setup, scan_frame_setup, sensor_frame_setup
from .trajectory import Trajectory, trajectory_beside

_CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
_SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
_COLORS = ("colorRed", "colorGreen", "colorBlue")
_TIME = "timeStamp"
_LARGEST_SCAN = 2**40


@njit(cache=True, nogil=True)
def _spherical_to_cartesian(distance, azimuth, elevation):  # type: ignore[no-untyped-def]
    """In place: x, y, z from range [m], azimuth from x towards y and elevation above xy [rad]."""
    for i in range(distance.size):
        level = distance[i] * np.cos(elevation[i])
        z = distance[i] * np.sin(elevation[i])
        distance[i] = level * np.cos(azimuth[i])
        azimuth[i] = level * np.sin(azimuth[i])
        elevation[i] = z


class E57File(ScanFile):
    """One E57 file. Scans are stations, in the file's order.

    The scanner's position is known when a scan has a pose, spherical coordinates, or rows and columns (then it is in
    the sensor's own frame, as the standard says that a pose left out is the identity). A scan with none of these is a
    cloud whose scanner nobody knows. One scan alone, not in rows and columns, whose points have times (in seconds, as they are
    stored) is that of a mobile scanner where its path stands beside the file (see ``trajectory``).
    """

    format = "E57"

    def __init__(self, path: Path) -> None:
        with E57Pages(path) as pages:
            self._headers = read_headers(pages)
            if not self._headers:
                raise BimVerifyError(f"{path} holds no scans. Export the scan again.")
            setups = [self._setup(pages, header) for header in self._headers]
        self._path = _path_beside(path, self._headers)
        if self._path is not None:
            first = setups[0].station
            setups = [scan_frame_setup(Station(
                first.name, np.zeros(3), known=False, sensor=first.sensor, acquired=first.acquired
            ))]
        super().__init__(path, setups, [header.records.count for header in self._headers])
        self.has_origins = self._path is not None

    def _setup(self, pages: E57Pages, header: ScanHeader) -> Setup:
        records = header.records
        names = _coordinates(header)
        if records.count and not all(name in records for name in names):
            raise pages.damaged(f"scan {header.name!r} has no coordinates")
        if any(records.field(name).kind == "string" for name in names if name in records):
            raise pages.damaged(f"scan {header.name!r} has coordinates that are no numbers")
        if records.count > _LARGEST_SCAN:
            raise pages.damaged(f"it declares {records.count:,} points")
        structured = "rowIndex" in records and "columnIndex" in records
        return sensor_frame_setup(
            Station(
                name=header.name,
                position=header.position,
                rotation=header.rotation,
                known=header.has_pose or names == _SPHERICAL or structured,
                grid=_grid(pages, header) if structured else None,
                sensor=header.sensor,
                acquired=header.acquired,
            )
        )

    def columns(self, station: int, block_size: int, attributes: bool) -> Iterator[Columns]:
        header = self._headers[station]
        records = header.records
        xyz = _coordinates(header)
        flag = "sphericalInvalidState" if xyz == _SPHERICAL else "cartesianInvalidState"
        names = [*xyz, flag, *([_TIME] if self._path is not None else [])]
        if attributes:
            names += ["intensity", *_COLORS, "rowIndex", "columnIndex"]
        with E57Pages(self.path) as pages:
            for values in read_records(pages, records, names, block_size):
                x, y, z = (np.asarray(values[name], np.float64) for name in xyz)
                if xyz == _SPHERICAL:
                    _spherical_to_cartesian(x, y, z)
                origin = None
                if self._path is not None:
                    x, y, z = header.rotation @ np.stack([x, y, z]) + header.position[:, None]
                    origin = self._path.at(np.asarray(values[_TIME], np.float64))
                yield Columns(
                    x, y, z,
                    invalid=(values[flag] != 0).view(np.uint8) if flag in values else None,
                    intensity=values["intensity"].astype(np.float32) if "intensity" in values else None,
                    color=_color(header, values),
                    row=_index(values, "rowIndex"),
                    column=_index(values, "columnIndex"),
                    origin=origin,
                )


def _path_beside(path: Path, headers: Sequence[ScanHeader]) -> Trajectory | None:
    records = headers[0].records
    timed = len(headers) == 1 and _TIME in records and "rowIndex" not in records
    return trajectory_beside(path) if timed else None


def _coordinates(header: ScanHeader) -> tuple[str, ...]:
    cartesian = all(name in header.records for name in _CARTESIAN)
    return _SPHERICAL if not cartesian and "sphericalRange" in header.records else _CARTESIAN


def _grid(pages: E57Pages, header: ScanHeader) -> Grid | None:
    """Rows and columns from the index bounds, or, where the file has none, from the largest indices of points."""
    if header.index_bounds is not None:
        low_row, high_row, low_column, high_column = header.index_bounds
        rows, columns = high_row - low_row + 1, high_column - low_column + 1
    else:
        rows = columns = 0
        for values in read_records(pages, header.records, ["rowIndex", "columnIndex"], 1_000_000):
            rows = max(rows, int(values["rowIndex"].max()) + 1)
            columns = max(columns, int(values["columnIndex"].max()) + 1)
    return Grid(rows, columns) if rows > 1 and columns > 1 else None


def _index(values: dict[str, NDArray], name: str) -> NDArray[np.int32] | None:
    return values[name].astype(np.int32) if name in values else None


def _color(header: ScanHeader, values: dict[str, NDArray]) -> NDArray[np.uint8] | None:
    """(N, 3) 0 to 255, scaled by the file's colour limits, or else by the limits of the field."""
    if not all(name in values for name in _COLORS):
        return None
    out = np.empty((len(values["colorRed"]), 3), np.uint8)
    for channel, name in enumerate(_COLORS):
        field = header.records.field(name)
        low, high = 0.0, 255.0
        if header.color_limits is not None:
            low, high = header.color_limits[channel]
        elif field.kind == "integer":
            low, high = (limit * field.scale + field.offset for limit in (field.minimum, field.maximum))
        value = values[name]
        if (low, high) != (0.0, 255.0) and high > low:
            value = np.round((value - low) * (255.0 / (high - low)))
        out[:, channel] = np.clip(np.nan_to_num(value), 0, 255)
    return out
