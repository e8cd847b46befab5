"""PLY files, ASCII and binary, vertex properties in any order and type."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..errors import BimVerifyError
from .binary_records import check_size, cut_off, find_fields, read_binary
from .campaign import Station
from .plain_columns import as_bytes
from .scan_file import Columns, ScanFile, scan_frame_setup
from .text_rows import TextRows

_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8",
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4", "float32": "f4",
    "float64": "f8",
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_LONGEST_HEADER = 2**20
_FULL = {"u2": 65535.0, "f4": 1.0, "f8": 1.0}


@dataclass
class _Element:
    name: str
    count: int
    properties: list[tuple[str, str]] = field(default_factory=list)
    has_list: bool = False

    def dtype(self, order: str) -> np.dtype:
        return np.dtype([(name, order + kind) for name, kind in self.properties])


class PlyFile(ScanFile):
    """The vertices of a PLY file: a cloud without a scanner position."""

    format = "PLY"

    def __init__(self, path: Path) -> None:
        self._order, elements, at = _read_header(path)
        before = []
        for element in elements:
            if element.name == "vertex":
                break
            before.append(element)
        else:
            raise BimVerifyError(f"{path} is a PLY file without vertices. Export the points again.")
        self._vertex = elements[len(before)]
        names = [name for name, _ in self._vertex.properties]
        if self._vertex.has_list or len(set(names)) < len(names):
            raise BimVerifyError(f"{path} has vertices with lists or doubled properties. Export plain points.")
        self._fields = find_fields(path, names)
        if self._order:
            if any(element.has_list for element in before):
                raise BimVerifyError(f"{path} has lists before its vertices. Export plain points.")
            at += sum(element.count * element.dtype(self._order).itemsize for element in before)
            check_size(path, at, self._vertex.count, self._vertex.dtype(self._order))
        else:
            at = TextRows(path).skip(at, sum(element.count for element in before))[1]
        self._at = at
        setup = scan_frame_setup(Station(path.stem, np.zeros(3), known=False))
        super().__init__(path, [setup], [self._vertex.count])
        self.has_origins = self._fields.origin is not None

    def columns(self, station: int, block_size: int, attributes: bool) -> Iterator[Columns]:
        if not self._order:
            yield from self._ascii_columns(block_size, attributes)
            return
        for table in read_binary(
            self.path, self._at, self._vertex.count, self._vertex.dtype(self._order), block_size
        ):
            yield self._fields.columns(table, attributes)

    def _ascii_columns(self, block_size: int, attributes: bool) -> Iterator[Columns]:
        numbers = {name: k for k, (name, _) in enumerate(self._vertex.properties)}
        full = {name: _FULL.get(kind, 255.0) for name, kind in self._vertex.properties}
        width = len(numbers)
        done = 0
        for table in TextRows(self.path).read(self._at, width, width, block_size, self._vertex.count):
            done += len(table)
            x, y, z = (table[:, numbers[name]] for name in self._fields.xyz)
            intensity = color = None
            if attributes and self._fields.intensity:
                intensity = table[:, numbers[self._fields.intensity]].astype(np.float32)
            if attributes and self._fields.rgb:
                color = np.column_stack(
                    [as_bytes(table[:, numbers[name]], full[name]) for name in self._fields.rgb]
                )
            origin = None
            if self._fields.origin:
                origin = table[:, [numbers[name] for name in self._fields.origin]]
            normal = None
            if attributes and self._fields.normal:
                normal = table[:, [numbers[name] for name in self._fields.normal]].astype(np.float32)
            yield Columns(x, y, z, intensity=intensity, color=color, normal=normal, origin=origin)
        if done < self._vertex.count:
            raise cut_off(self.path, self._vertex.count, done)


def _read_header(path: Path) -> tuple[str, list[_Element], int]:
    """(Byte order, or empty for ASCII; elements; position of the data)."""
    with path.open("rb") as file:
        head = file.read(_LONGEST_HEADER)
    end = head.find(b"end_header")
    line_end = head.find(b"\n", end)
    if not head.startswith(b"ply") or end < 0 or line_end < 0:
        raise BimVerifyError(f"{path} is no PLY file, or its header is cut off. Copy or export it again.")
    order: str | None = None
    elements: list[_Element] = []
    try:
        for line in head[:end].decode("latin-1").splitlines():
            words = line.split()
            if not words or words[0] in ("ply", "comment", "obj_info"):
                continue
            if words[0] == "format":
                order = _ORDERS[words[1]]
            elif words[0] == "element":
                elements.append(_Element(words[1], int(words[2])))
                if elements[-1].count < 0:
                    raise ValueError(line)
            elif words[0] == "property" and words[1] == "list":
                elements[-1].has_list = True
            elif words[0] == "property":
                elements[-1].properties.append((words[2], _TYPES[words[1]]))
            else:
                raise ValueError(line)
        if order is None:
            raise ValueError("format")
    except (KeyError, IndexError, ValueError):
        raise BimVerifyError(f"{path} is damaged: its PLY header cannot be understood. Export it again.") from None
    return order, elements, line_end + 1
