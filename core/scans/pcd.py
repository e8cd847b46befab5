"""PCD files (Point Cloud Library): ASCII, binary and compressed binary."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..errors import BimVerifyError
from .binary_records import NamedFields, check_size, cut_off, find_fields, read_binary
from .byte_copy import copy_bytes
from .campaign import Grid, Station
from .e57_header import quaternion_to_matrix
from .scan_file import Columns, ScanFile, scan_frame_setup
from .text_rows import TextRows

_LONGEST_HEADER = 65536
_KINDS = {"F": "f", "I": "i", "U": "u"}
_BEST_RATIO = 100
"""LZF cannot pack better than 264 bytes into 3."""


@dataclass(frozen=True)
class _Header:
    names: tuple[str, ...]
    kinds: tuple[str, ...]
    counts: tuple[int, ...]
    width: int
    height: int
    viewpoint: tuple[float, ...]
    points: int
    data: str
    at: int

    @property
    def dtype(self) -> np.dtype:
        """One record; values of a field with several are kept together."""
        return np.dtype(
            [
                (name, "<" + kind, (count,)) if count > 1 else (name, "<" + kind)
                for name, kind, count in zip(self.names, self.kinds, self.counts, strict=True)
            ]
        )


class PcdFile(ScanFile):
    """One cloud. VIEWPOINT, unless it is the default 0 0 0 1 0 0 0, is the scanner's pose in the frame of the points,
    which are not moved by it (as the library's own normals and range images take it)."""

    format = "PCD"

    def __init__(self, path: Path) -> None:
        self._header = header = _read_header(path)
        self._fields: NamedFields = find_fields(path, [name for name in header.names if not name.startswith("_")])
        grid = Grid(header.height, header.width) if header.height > 1 and header.width > 1 else None
        known = header.viewpoint != (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
        rotation = quaternion_to_matrix(*header.viewpoint[3:])
        station = Station(path.stem, np.array(header.viewpoint[:3]), rotation, known=known, grid=grid)
        if header.data == "binary":
            check_size(path, header.at, header.points, header.dtype)
        super().__init__(path, [scan_frame_setup(station)], [header.points])
        self.has_origins = self._fields.origin is not None

    def columns(self, station: int, block_size: int, attributes: bool) -> Iterator[Columns]:
        header = self._header
        done = 0
        for table in self._tables(block_size):
            found = self._fields.columns(table, attributes)
            count = len(found.x)
            if attributes:
                color, row, column = found.color, None, None
                packed = next((name for name in header.names if name.lower() in ("rgb", "rgba")), None)
                if color is None and packed is not None:
                    color = _unpack_color(table[packed])
                if self.setups[0].station.grid is not None:
                    order = np.arange(done, done + count)
                    row = (order // header.width).astype(np.int32)
                    column = (order % header.width).astype(np.int32)
                found = replace(found, color=color, row=row, column=column)
            done += count
            yield found
        if done < header.points:
            raise cut_off(self.path, header.points, done)

    def _tables(self, block_size: int) -> Iterator[NDArray | dict[str, NDArray]]:
        header = self._header
        if header.data == "binary":
            yield from read_binary(self.path, header.at, header.points, header.dtype, block_size)
        elif header.data == "ascii":
            yield from self._ascii_tables(block_size)
        else:
            yield from self._compressed_tables(block_size)

    def _ascii_tables(self, block_size: int) -> Iterator[dict[str, NDArray]]:
        header = self._header
        first = np.cumsum([0, *header.counts[:-1]])
        width = sum(header.counts)
        for table in TextRows(self.path).read(header.at, width, width, block_size, header.points):
            yield {
                name: table[:, k] if name.lower() in ("rgb", "rgba") and kind == "f4" else table[:, k].astype(kind)
                for name, kind, k in zip(header.names, header.kinds, first, strict=True)
                if not name.startswith("_")
            }

    def _compressed_tables(self, block_size: int) -> Iterator[dict[str, NDArray]]:
        """All values of one field after another, LZF-packed as a whole: unpacked into a temporary file."""
        header = self._header
        damaged = BimVerifyError(f"{self.path} is cut off or damaged: it cannot be unpacked. Copy or export it again.")
        with self.path.open("rb") as file:
            file.seek(header.at)
            sizes = np.fromfile(file, "<u4", 2)
        expected = header.points * header.dtype.itemsize
        if len(sizes) < 2 or int(sizes[1]) != expected or expected > _BEST_RATIO * int(sizes[0]):
            raise damaged
        if header.at + 8 + int(sizes[0]) > self.path.stat().st_size:
            raise damaged
        packed = np.memmap(self.path, np.uint8, "r", header.at + 8, (int(sizes[0]),))
        with tempfile.TemporaryFile() as scratch:
            plain = np.memmap(scratch, np.uint8, "w+", shape=(expected,))
            if _unpack_lzf(packed, plain) != expected:
                raise damaged
            starts = np.cumsum([0] + [header.points * header.dtype[name].itemsize for name in header.names])
            for start in range(0, header.points, block_size):
                rows = slice(start, min(start + block_size, header.points))
                yield {
                    name: plain[at : at + header.points * header.dtype[name].itemsize].view(header.dtype[name].base)[
                        rows.start * count : rows.stop * count : count
                    ]
                    for name, at, count in zip(header.names, starts, header.counts, strict=False)
                    if not name.startswith("_")
                }


@njit(cache=True, nogil=True)
def _unpack_lzf(packed, plain):  # type: ignore[no-untyped-def]
    """LZF (Lehmann, LibLZF). Returns the number of bytes written, or -1 on damaged input."""
    at = 0
    out = 0
    while at < packed.size:
        control = int(packed[at])
        at += 1
        if control < 32:
            count = control + 1
            if at + count > packed.size or out + count > plain.size:
                return -1
            copy_bytes(packed, at, plain, out, count)
            at += count
            out += count
            continue
        count = control >> 5
        if count == 7:
            if at >= packed.size:
                return -1
            count += int(packed[at])
            at += 1
        count += 2
        if at >= packed.size:
            return -1
        source = out - ((control & 31) << 8) - int(packed[at]) - 1
        at += 1
        if source < 0 or out + count > plain.size:
            return -1
        for _ in range(count):
            plain[out] = plain[source]
            out += 1
            source += 1
    return out


def _unpack_color(values: NDArray) -> NDArray[np.uint8]:
    """(N, 3) from 0x00RRGGBB, kept as an integer or in the bits of a float (as a float's decimal text in ASCII)."""
    floats = values.dtype.kind == "f"
    bits = np.ascontiguousarray(values, np.float32).view(np.uint32) if floats else values.astype(np.uint32)
    return np.column_stack([(bits >> shift & 255).astype(np.uint8) for shift in (16, 8, 0)])


def _read_header(path: Path) -> _Header:
    with path.open("rb") as file:
        head = file.read(_LONGEST_HEADER)
    entries: dict[str, list[str]] = {}
    at = 0
    while "DATA" not in entries:
        end = head.find(b"\n", at)
        if end < 0:
            raise BimVerifyError(f"{path} is no PCD file, or its header is cut off. Copy or export it again.")
        words = head[at:end].decode("latin-1").split()
        at = end + 1
        if words and not words[0].startswith("#"):
            entries[words[0].upper()] = words[1:]
    try:
        names = tuple(entries.get("FIELDS") or entries["COLUMNS"])
        kinds = tuple(_KINDS[t] + str(int(s)) for t, s in zip(entries["TYPE"], entries["SIZE"], strict=True))
        counts = tuple(int(count) for count in entries.get("COUNT", ["1"] * len(names)))
        width, height = int(entries["WIDTH"][0]), int(entries.get("HEIGHT", ["1"])[0])
        viewpoint = tuple(float(v) for v in entries.get("VIEWPOINT", ["0", "0", "0", "1", "0", "0", "0"]))
        points = int(entries.get("POINTS", [str(width * height)])[0])
        data = entries["DATA"][0].lower()
        sane = (
            data in ("ascii", "binary", "binary_compressed")
            and len(names) == len(kinds) == len(counts)
            and all(1 <= count <= 4096 for count in counts)
            and all(kind in ("f4", "f8", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8") for kind in kinds)
            and points == width * height >= 0
            and len(viewpoint) == 7
            and bool(np.isfinite(viewpoint).all())
            and any(viewpoint[3:])
        )
        if not sane:
            raise ValueError
    except (KeyError, IndexError, ValueError):
        raise BimVerifyError(f"{path} is damaged: its PCD header cannot be understood. Export it again.") from None
    unique = tuple(f"_{k}" if name == "_" else name for k, name in enumerate(names))
    if len(set(unique)) < len(unique):
        raise BimVerifyError(f"{path} has two fields of the same name. Export it again.")
    return _Header(unique, kinds, counts, width, height, viewpoint, points, data, at)
