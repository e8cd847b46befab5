"""LAS and LAZ files, through laspy."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from pathlib import Path

import laspy
import numpy as np

from ..errors import BimVerifyError
from .binary_records import find_origin
from .campaign import Station
from .scan_file import Columns, ScanFile, scan_frame_setup
from .trajectory import trajectory_beside

_SAMPLE_POINTS = 100_000
_COLORS = ("red", "green", "blue")
_COORDINATES = laspy.DecompressionSelection.base().decompress_z().decompress_flags()
logging.getLogger("laspy").addHandler(logging.NullHandler())


class LasFile(ScanFile):
    """A cloud without a scanner position. Points with the withheld flag are dropped as invalid.

    Colours are 16-bit by the standard; where none of the first points exceeds 255 they are taken as bytes.
    """

    format = "LAS"

    def __init__(self, path: Path) -> None:
        self._wide_colors = True
        with self._open(path) as reader:
            header = reader.header
            count = int(header.point_count)
            if header.are_points_compressed:
                self.format = "LAZ"
            else:
                room = (path.stat().st_size - header.offset_to_point_data) // header.point_format.size
                if room < count:
                    raise BimVerifyError(
                        f"{path} is cut off: it declares {count:,} points and holds {max(room, 0):,}. "
                        "Copy or export it again."
                    )
            names = list(header.point_format.dimension_names)
            self._has_color = "red" in names
            self._origin = find_origin(names)
            self._path = trajectory_beside(path) if self._origin is None and "gps_time" in names else None
            date = header.creation_date
            sensor = str(header.system_identifier).strip()
        station = Station(
            path.stem, np.zeros(3), known=False, sensor=sensor if sensor.upper() != "OTHER" else "",
            acquired=date.isoformat() if date else "",
        )
        super().__init__(path, [scan_frame_setup(station)], [count])
        self.has_origins = self._origin is not None or self._path is not None
        if self._has_color:
            self._wide_colors = self._colors_exceed_bytes()

    @staticmethod
    def _open(path: Path, attributes: bool = True) -> laspy.LasReader:
        wanted = laspy.DecompressionSelection.all() if attributes else _COORDINATES
        try:
            return laspy.open(path, decompression_selection=wanted)
        except OSError:
            raise
        except Exception as error:  # laspy and its decompressors raise many kinds
            why = " ".join(str(error).split())[:100]
            raise BimVerifyError(f"{path} cannot be read as LAS or LAZ ({why}). Copy or export it again.") from error

    def _points(self, block_size: int, attributes: bool) -> Iterator[laspy.ScaleAwarePointRecord]:
        done = 0
        with self._open(self.path, attributes or self.has_origins) as reader:
            while done < self.point_count:
                try:
                    points = reader.read_points(min(block_size, self.point_count - done))
                except Exception as error:  # laspy and its decompressors raise many kinds
                    raise self._cut_off(done) from error
                if len(points) == 0:
                    raise self._cut_off(done)
                done += len(points)
                yield points

    def _colors_exceed_bytes(self) -> bool:
        points = next(self._points(_SAMPLE_POINTS, True))
        return max(int(points[name].max()) for name in _COLORS) > 255

    def columns(self, station: int, block_size: int, attributes: bool) -> Iterator[Columns]:
        for points in self._points(block_size, attributes):
            intensity = color = None
            if attributes:
                intensity = np.asarray(points["intensity"], np.float32)
            if attributes and self._has_color:
                rgb = np.column_stack([np.asarray(points[name]) for name in _COLORS])
                color = (rgb >> 8 if self._wide_colors else np.minimum(rgb, 255)).astype(np.uint8)
            yield Columns(
                np.asarray(points.x), np.asarray(points.y), np.asarray(points.z),
                invalid=np.asarray(points["withheld"]).astype(np.uint8), intensity=intensity, color=color,
                origin=self._origins(points),
            )

    def _origins(self, points: laspy.ScaleAwarePointRecord) -> np.ndarray | None:
        if self._path is not None:
            return self._path.at(np.asarray(points["gps_time"], np.float64))
        return None if self._origin is None else np.column_stack([np.asarray(points[n]) for n in self._origin])

    def _cut_off(self, done: int) -> BimVerifyError:
        return BimVerifyError(
            f"{self.path} is cut off or damaged: it declares {self.point_count:,} points and {done:,} could be read. "
            "Copy or export it again."
        )
