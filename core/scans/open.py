"""Open scan files of any known format as one campaign."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..errors import BimVerifyError
from .campaign import DropCount, ReturnBlock, Station
from .e57_pages import SIGNATURE
from .origins import Origins, origin_of, refuse_one_for_several
from .read_ahead import read_ahead
from .scan_file import ScanFile
from .stated_origin import impossible_stations, is_identity

if TYPE_CHECKING:
    from ..imagery.block_points import BlockPoints

FORMATS = "E57, LAS, LAZ, PLY, PCD, PTS, PTX, XYZ, TXT, CSV or NPY"
SUFFIXES = (".e57", ".las", ".laz", ".ply", ".pcd", ".pts", ".ptx", ".xyz", ".txt", ".asc", ".csv", ".npy")
_HEAD = 8192
_BUNDLE = b"bim_verify.bundle"
"""What the head of a bundle project holds."""
_BUNDLER = b"# Bundle file v"
_SAME_PLACE_M = 1e-6
_SAME_TURN = 1e-9


def open_scans(paths: Sequence[str | Path], *, origin: Origins = None) -> Campaign:
    """Open scan files as one campaign; stations keep the order of the files.

    origin : scanner position, metres, scan frame, for a file that does not name one, or that states an identity pose which
        cannot be true (see ``stated_origin``); for several such files, one for each by its path or name. Without it stations
        that no file names are not ``known`` and their position is a place-holder near the data.

    Scans with the same known pose are one station: a scan split in two files gives the same campaign as the whole one.
    Raises BimVerifyError when a file is missing, of no known format, damaged or empty, or when one position is given for
    several files.
    """
    if not paths:
        raise BimVerifyError("No scan file was given. Name at least one.")
    given = origin.values() if isinstance(origin, Mapping) else (origin,)
    if not all(math.isfinite(value) for one in given if one is not None for value in one):
        raise BimVerifyError("The scanner origin must be three finite numbers in metres.")
    campaign = Campaign([open_scan_file(path, origin=origin) for path in paths])
    refuse_one_for_several(origin, campaign.placed_paths)
    return campaign


def open_scan_file(path: str | Path, *, origin: Origins = None) -> ScanFile:
    """Open one file with its stations as they are in it. The format follows from the content, then from the suffix."""
    place, own_origin = Path(path), origin_of(path, origin)
    try:
        if place.is_dir():
            if not any((place / f"images{suffix}").exists() for suffix in (".bin", ".txt")):
                raise BimVerifyError(f"{place} is a folder, and none of COLMAP. Give scan files ({FORMATS}).")
            return _reader(place, _BUNDLER)(place)
        with place.open("rb") as file:
            head = file.read(_HEAD)
        if not head:
            raise BimVerifyError(f"{place} is empty. Copy or export it again.")
        found = _reader(place, head)(place)
        if found.has_origins:
            from .mobile import MobileFile

            return MobileFile(found)
        found.place_unknown(own_origin)
        if own_origin is not None and any(is_identity(station) for station in found.stations):
            found.replace_stations(impossible_stations(found), own_origin)
    except OSError as error:
        raise BimVerifyError(
            f"Cannot read {place}: {error.strerror or error}. Check the name and the permissions."
        ) from error
    return found


def _reader(path: Path, head: bytes) -> Callable[[Path], ScanFile]:
    """Readers are imported when they are needed: a panel that only lists formats must not load them all."""
    suffix = path.suffix.lower()
    kind = _signature(head)
    if kind is None:
        kind = suffix.removeprefix(".")
        if kind in ("e57", "las", "laz", "ply", "npy"):
            raise BimVerifyError(f"{path} is not a {kind.upper()} file, whatever its name says. Export it again.")
        if b"\0" in head or (kind != "pcd" and suffix not in SUFFIXES and not _looks_like_rows(head)):
            raise BimVerifyError(f"{path} is no scan file that can be read. Give {FORMATS}.")
    if kind == "bundle":
        from .tie_points import TiePointFile

        return TiePointFile
    if kind == "e57":
        from .e57 import E57File

        return E57File
    if kind == "las":
        from .las import LasFile

        return LasFile
    if kind == "ply":
        from .ply import PlyFile

        return PlyFile
    if kind == "pcd":
        from .pcd import PcdFile

        return PcdFile
    if kind == "npy":
        from .npy import NpyFile

        return NpyFile
    if kind == "pts":
        from .pts import PtsFile

        return PtsFile
    if kind == "ptx":
        from .ptx import PtxFile

        return PtxFile
    from .xyz import XyzFile

    return XyzFile


def _signature(head: bytes) -> str | None:
    """The format that the first bytes prove, or None."""
    if head.startswith(SIGNATURE):
        return "e57"
    if head.startswith(_BUNDLER) or (head.lstrip().startswith(b"{") and _BUNDLE in head):
        return "bundle"
    if head.startswith(b"LASF"):
        return "las"
    if head.startswith((b"ply\n", b"ply\r")):
        return "ply"
    if head.startswith(b"\x93NUMPY"):
        return "npy"
    if head.startswith((b"# .PCD", b"VERSION")) or (b"\nFIELDS" in head and b"\nDATA" in head):
        return "pcd"
    lines = [line.split() for line in head.split(b"\n")[:12] if line.strip()]
    if lines and len(lines[0]) == 1 and lines[0][0].isdigit():
        if len(lines) > 9 and len(lines[1]) == 1 and lines[1][0].isdigit() and all(len(a) == 4 for a in lines[6:10]):
            return "ptx"
        if len(lines) == 1 or len(lines[1]) >= 3:
            return "pts"
    return None


def _looks_like_rows(head: bytes) -> bool:
    from .xyz import is_number, sniff_dialect, split_line

    for raw in head.split(b"\n")[:50]:
        line = raw.decode("latin-1").strip()
        dialect = sniff_dialect(line)
        words = split_line(line, dialect)
        if len(words) >= 3 and all(is_number(word, dialect.decimal) for word in words[:3]):
            return True
    return False


class Campaign:
    """Several files as one source: see :class:`~.campaign.ScanSource`. A thread reads one block ahead."""

    def __init__(self, files: Sequence[ScanFile]) -> None:
        self._files = tuple(files)
        self._stations: list[Station] = []
        self._index: list[list[int]] = [[self._place(station) for station in file.stations] for file in files]

    def _place(self, station: Station) -> int:
        """Number of the station; one with the same known pose is the same."""
        for index, other in enumerate(self._stations):
            if (
                station.known
                and other.known
                and np.abs(station.position - other.position).max() <= _SAME_PLACE_M
                and np.abs(station.rotation - other.rotation).max() <= _SAME_TURN
            ):
                if station.grid != other.grid:
                    self._stations[index] = replace(other, grid=None)
                return index
        self._stations.append(station)
        return len(self._stations) - 1

    @property
    def photo_blocks(self) -> tuple[BlockPoints, ...]:
        """The blocks of photos among the files."""
        return tuple(file.block for file in self._files if file.block is not None)

    @property
    def placed(self) -> tuple[int, ...]:
        """Stations of which the user said where they were."""
        return tuple(index[k] for file, index in zip(self._files, self._index, strict=True) for k in file.placed)

    @property
    def placed_paths(self) -> tuple[str, ...]:
        """The files of these."""
        return tuple(path for file in self._files if file.placed for path in file.paths)

    @property
    def paths(self) -> tuple[str, ...]:
        return tuple(path for file in self._files for path in file.paths)

    @property
    def stations(self) -> tuple[Station, ...]:
        return tuple(self._stations)

    @property
    def point_count(self) -> int:
        return sum(file.point_count for file in self._files)

    @property
    def dropped(self) -> DropCount:
        counts = [file.dropped for file in self._files]
        return DropCount(
            sum(count.invalid for count in counts),
            sum(count.zero for count in counts),
            sum(count.not_finite for count in counts),
        )

    def blocks(self, block_size: int = 262_144, *, attributes: bool = False) -> Iterator[ReturnBlock]:
        return read_ahead(lambda: self._read(block_size, attributes))

    def _read(self, block_size: int, attributes: bool) -> Iterator[ReturnBlock]:
        for file, index in zip(self._files, self._index, strict=True):
            for block in file.blocks(block_size, attributes=attributes):
                yield replace(block, station=index[block.station])
