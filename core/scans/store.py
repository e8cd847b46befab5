"""The returns of a campaign, held per station within a memory budget."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from ..progress import Progress
from .campaign import ScanSource, Station

BYTES_PER_RETURN = 12
INDEX_BYTES_PER_RETURN = 40
"""Peak while a tile is indexed: its returns twice, its bins, and their counters."""


@dataclass(frozen=True)
class Tile:
    """A sector of one station's sphere: the returns in it and in a margin on both sides."""

    offsets: NDArray[np.float32]
    """(N, 3) metres, return minus station."""
    first: float
    """The sector begins at this azimuth, radians 0 ... 2 pi; the whole sphere when ``last - first`` is 2 pi."""
    last: float
    photo: NDArray[np.float64] | None = None
    """(N, 3) see ``ReturnBlock.photo``."""

    def owns(self, direction: NDArray[np.floating]) -> NDArray[np.bool_]:
        """(N,) which directions (N, 3) belong to the sector itself, so that every query has exactly one tile."""
        return in_sector(direction, self.first, self.last)


def _azimuth(direction: NDArray[np.floating]) -> NDArray[np.float64]:
    """(N,) radians, 0 ... 2 pi, in double precision: sectors meet without a gap."""
    return np.asarray(np.arctan2(direction[:, 1], direction[:, 0], dtype=np.float64) % (2 * np.pi))


def in_sector(direction: NDArray[np.floating], first: float, last: float) -> NDArray[np.bool_]:
    """(N,) whether the azimuth of each direction (N, 3) lies in the sector from ``first`` to ``last`` [rad, 0 ... 2 pi]."""
    azimuth = _azimuth(direction)
    return np.asarray((azimuth >= first) & (azimuth < last))


class ReturnStore:
    """All returns of a source by station: in memory while they fit the budget, else in a temporary file.

    They are kept in single precision, from their station: what is lost is under a micrometre at 10 m, and a twentieth of a
    millimetre at a kilometre. Use as a context manager; the temporary file goes with it.
    """

    def __init__(self, source: ScanSource, memory_gb: float, progress: Progress | None = None) -> None:
        self.stations: tuple[Station, ...] = source.stations
        self._budget = memory_gb * 1e9
        self._blocks: list[list[NDArray[np.float32]]] = [[] for _ in self.stations]
        self._photo: list[list[NDArray[np.float64]]] = [[] for _ in self.stations]
        self._counts: dict[int, int] = {}
        self._files: dict[int, Path] = {}
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._read(source, progress or Progress())

    def __enter__(self) -> ReturnStore:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Forget the returns and remove the temporary file."""
        self._blocks = [[] for _ in self.stations]
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None

    def _read(self, source: ScanSource, progress: Progress) -> None:
        held = read = 0
        for block in source.blocks():
            read += len(block.offsets)
            held += len(block.offsets) * BYTES_PER_RETURN
            self._blocks[block.station].append(np.ascontiguousarray(block.offsets, dtype=np.float32))
            if block.photo is not None:
                self._photo[block.station].append(block.photo)
            if held > 0.4 * self._budget:
                self._spill()
                held = 0
            progress.update(read / max(source.point_count, 1), f"Reading returns ({read / 1e6:.1f} million)")
        if self._folder is not None:
            self._spill()

    def _spill(self) -> None:
        """Move what is held to the temporary file of each station."""
        if self._folder is None:
            self._folder = tempfile.TemporaryDirectory(prefix="bim_verify_")
        for station, blocks in enumerate(self._blocks):
            if blocks:
                with self._file(station).open("ab") as stream:
                    for block in blocks:
                        block.tofile(stream)
                blocks.clear()

    def _path(self, station: int) -> Path:
        assert self._folder is not None
        return Path(self._folder.name) / f"{station}.f32"

    def _file(self, station: int) -> Path:
        return self._files.get(station, self._path(station))

    def release(self, station: int) -> None:
        """Forget a station's returns that are in memory, where somebody else holds them now; its count stays known."""
        self._counts[station] = self.count(station)
        self._blocks[station] = []

    def rewrite(self, station: int, returns: NDArray[np.float32]) -> None:
        """Keep a station's returns in the temporary file in the order of ``returns`` (N, 3) from now on."""
        assert self._folder is not None
        path = self._path(station).with_suffix(".sorted")
        returns.tofile(path)
        self._files[station] = path
        with suppress(OSError):  # a system that does not remove a file that is still mapped does so with the folder
            self._path(station).unlink()

    def whole(self, station: int) -> NDArray[np.float32]:
        """(N, 3) all returns of a station [m, return minus station]."""
        if self._folder is not None and self.count(station):
            return np.fromfile(self._file(station), np.float32).reshape(-1, 3)  # faster than a map, page by page
        return np.asarray(self._all(station))

    def count(self, station: int) -> int:
        """Returns of a station."""
        if station in self._counts:
            return self._counts[station]
        if self._folder is not None:
            path = self._file(station)
            return path.stat().st_size // BYTES_PER_RETURN if path.exists() else 0
        return sum(len(block) for block in self._blocks[station])

    @property
    def fits(self) -> bool:
        """Whether all returns are in memory."""
        return self._folder is None

    def _all(self, station: int) -> NDArray[np.float32]:
        if self._folder is not None:
            if not self.count(station):
                return np.zeros((0, 3), np.float32)
            return np.memmap(self._file(station), dtype=np.float32, mode="r").reshape(-1, 3)
        blocks = self._blocks[station]
        if len(blocks) > 1:
            self._blocks[station] = blocks = [np.concatenate(blocks)]
        return blocks[0] if blocks else np.zeros((0, 3), np.float32)

    def tiles(self, station: int, margin: float) -> Iterator[Tile]:
        """The station's returns in sectors that fit the budget, each with ``margin`` radians of azimuth on both sides.

        The margin holds away from the poles; returns within ``margin`` of a pole are part of every tile.
        """
        returns = self._all(station)
        photo = np.concatenate(self._photo[station]) if self._photo[station] else None
        sectors = int(np.ceil(len(returns) * INDEX_BYTES_PER_RETURN / (0.6 * self._budget)))
        if sectors <= 1:
            yield Tile(self.whole(station), 0.0, 2 * np.pi + 1e-9, photo)
            return
        edges = self._equal_sectors(returns, sectors)
        for first, last in pairwise(edges):
            rows = np.concatenate(list(_in_sector(returns, first, last, margin)))
            yield Tile(np.asarray(returns[rows]), first, last, None if photo is None else photo[rows])

    @staticmethod
    def _equal_sectors(returns: NDArray[np.float32], sectors: int) -> list[float]:
        histogram = np.zeros(3600, dtype=np.int64)
        for part in _parts(returns):
            azimuth = _azimuth(part)
            histogram += np.bincount(np.minimum((azimuth * (1800 / np.pi)).astype(int), 3599), minlength=3600)
        share = np.cumsum(histogram) / histogram.sum()
        cuts = np.searchsorted(share, np.arange(1, sectors) / sectors) * (np.pi / 1800)
        return [0.0, *np.unique(cuts[(cuts > 0)]).tolist(), 2 * np.pi + 1e-9]


def _parts(returns: NDArray[np.float32]) -> Iterator[NDArray[np.float32]]:
    for begin in range(0, len(returns), 2_000_000):
        yield np.asarray(returns[begin : begin + 2_000_000])


def _in_sector(
    returns: NDArray[np.float32], first: float, last: float, margin: float
) -> Iterator[NDArray[np.int64]]:
    """Rows of ``returns`` in the sector and its margins."""
    middle, half = 0.5 * (first + last), 0.5 * (last - first)
    begin = 0
    for part in _parts(returns):
        rho = np.hypot(part[:, 0], part[:, 1])
        away = np.abs((_azimuth(part) - middle + np.pi) % (2 * np.pi) - np.pi)
        reach = np.linalg.norm(part, axis=1)
        cosine = np.maximum(rho / reach, 1e-9)
        near_pole = np.sin(margin) >= cosine
        wide = np.arcsin(np.minimum(np.sin(margin) / cosine, 1.0)) * 1.5
        yield begin + np.flatnonzero(near_pole | (away <= half + wide))
        begin += len(part)
