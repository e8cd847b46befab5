"""The point records of an E57 scan: data packets of bit streams, one stream a field (ASTM E2807).

The E57 reference library decodes three to ten million points a second and holds Python's interpreter lock while it
does; this decoder reads only the fields asked for, releases the lock and is several times faster. The tests prove it
equal to the library.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .byte_copy import copy_bytes
from .e57_pages import E57Pages, logical

_WINDOW = 4096 * 1020
"""Logical bytes read at a time."""
_STREAM_ROOM = 2 * 2**20
"""Bytes of one field that wait to be decoded; a packet holds at most 64 kB."""
_SECTION_HEADER = 32


@dataclass(frozen=True)
class Field:
    """One field of the record: a floating point number, or an integer of ``bits`` bits plus ``minimum``, scaled."""

    name: str
    kind: str
    """float, integer or string"""
    bits: int = 0
    """Per record in the field's stream."""
    minimum: int = 0
    maximum: int = 0
    scale: float = 1.0
    offset: float = 0.0

    @property
    def scaled(self) -> bool:
        return self.scale != 1.0 or self.offset != 0.0

    def column(self, count: int) -> NDArray:
        """``count`` values, all at the minimum: what a field of 0 bits holds, and room for any other."""
        if self.kind == "float" or self.scaled:
            return np.full(count, self.minimum * self.scale + self.offset)
        return np.full(count, self.minimum, np.int64)


@dataclass(frozen=True)
class Records:
    """Where the records of a scan are."""

    count: int
    file_offset: int
    """Physical position of the section."""
    fields: tuple[Field, ...]

    def __contains__(self, name: str) -> bool:
        return any(field.name == name for field in self.fields)

    def field(self, name: str) -> Field:
        return next(field for field in self.fields if field.name == name)


@njit(cache=True, nogil=True)
def _gather(data, at, n_streams, wanted, streams, filled):  # type: ignore[no-untyped-def]
    """Append the bytes of ``wanted`` streams of whole packets to ``streams``.

    Returns (position of the first packet not taken, reason: 0 data at an end, 1 a stream is full, 2 damaged).
    """
    size = data.size
    room = streams.shape[1] - 8
    while at + 6 <= size:
        kind = data[at]
        length = int(data[at + 2]) + 256 * int(data[at + 3]) + 1
        if kind > 2 or length % 4 != 0:
            return at, 2
        if at + length > size:
            return at, 0
        if kind != 1:
            at += length
            continue
        if int(data[at + 4]) + 256 * int(data[at + 5]) != n_streams or 6 + 2 * n_streams > length:
            return at, 2
        for k in range(wanted.size):
            where = at + 6 + 2 * wanted[k]
            if filled[k] + int(data[where]) + 256 * int(data[where + 1]) > room:
                return at, 1
        start = at + 6 + 2 * n_streams
        k = 0
        for stream in range(n_streams):
            where = at + 6 + 2 * stream
            count = int(data[where]) + 256 * int(data[where + 1])
            if start + count > at + length:
                return at, 2
            if k < wanted.size and wanted[k] == stream:
                copy_bytes(data, start, streams[k], filled[k], count)
                filled[k] += count
                k += 1
            start += count
        at += length
    return at, 0


@njit(cache=True, nogil=True)
def _unpack(words, first_bit, bits, minimum, scale, offset, scaled, integers, floats):  # type: ignore[no-untyped-def]
    """Integers of ``bits`` bits each (1 to 64), packed from the least significant bit on, plus ``minimum``.

    Written to ``integers``, or times ``scale`` plus ``offset`` to ``floats``.
    """
    one = np.uint64(1)
    mask = ~np.uint64(0) if bits == 64 else (one << np.uint64(bits)) - one
    for i in range(floats.size if scaled else integers.size):
        bit = first_bit + i * bits
        word = bit >> 6
        shift = np.uint64(bit & 63)
        value = words[word] >> shift
        if (bit & 63) + bits > 64:
            value |= words[word + 1] << (np.uint64(64) - shift)
        number = np.int64(value & mask) + minimum
        if scaled:
            floats[i] = number * scale + offset
        else:
            integers[i] = number


_NO_INTEGERS = np.zeros(0, np.int64)
_NO_FLOATS = np.zeros(0)


class _Streams:
    """Bytes of the wanted fields that wait to be decoded."""

    def __init__(self, records: Records, names: Sequence[str]) -> None:
        order = sorted((i for i, f in enumerate(records.fields) if f.name in names))
        self.fields = [records.fields[i] for i in order]
        self.wanted = np.array([i for i, f in zip(order, self.fields, strict=True) if f.bits], np.int64)
        self.packed = [f for f in self.fields if f.bits]
        self.bytes = np.zeros((len(self.packed), _STREAM_ROOM + 8), np.uint8)
        self.filled = np.zeros(len(self.packed), np.int64)
        self.bit = [0] * len(self.packed)

    def ready(self) -> int:
        """Whole records that can be decoded now."""
        return min(
            (int(self.filled[k]) * 8 - self.bit[k]) // field.bits for k, field in enumerate(self.packed)
        )

    def decode(self, count: int, out: dict[str, NDArray], start: int) -> None:
        """Write the next ``count`` records to ``out`` from row ``start`` on."""
        for k, field in enumerate(self.packed):
            rows = out[field.name][start : start + count]
            if field.kind == "float":
                width = field.bits // 8
                byte = self.bit[k] // 8
                rows[:] = self.bytes[k, byte : byte + count * width].view(f"<f{width}")
            else:
                integers, floats = (_NO_INTEGERS, rows) if field.scaled else (rows, _NO_FLOATS)
                _unpack(
                    self.bytes[k].view("<u8"), self.bit[k], field.bits, field.minimum, field.scale, field.offset,
                    field.scaled, integers, floats,
                )
            self.bit[k] += count * field.bits

    def compact(self) -> None:
        """Move what is left to the front, to make room."""
        for k in range(len(self.packed)):
            start = self.bit[k] // 8
            left = int(self.filled[k]) - start
            self.bytes[k, :left] = self.bytes[k, start : start + left].copy()
            self.filled[k] = left
            self.bit[k] -= 8 * start


def _data_start(pages: E57Pages, records: Records) -> tuple[int, int]:
    """Logical positions of the first data packet and of the section's end."""
    start = logical(records.file_offset)
    header = pages.read(start, _SECTION_HEADER)
    if len(header) < _SECTION_HEADER or header[0] != 1:
        raise pages.damaged("a points section is not where it should be")
    length, data_at = (int(v) for v in header[8:24].view("<u8"))
    end = start + length
    data = logical(data_at)
    if end > pages.length or not start < data <= end:
        raise pages.damaged("a points section is longer than the file")
    if records.count * sum(field.bits for field in records.fields) > 8 * length:
        raise pages.damaged(f"it declares {records.count:,} points and has no room for them")
    return data, end


def read_records(
    pages: E57Pages, records: Records, names: Sequence[str], block_size: int
) -> Iterator[dict[str, NDArray]]:
    """Stream the named fields of all records in blocks of ``block_size`` (the last is smaller).

    Floats and scaled integers come as float64, integers as int64. The arrays are used again for the next block: copy
    what is kept. Raises BimVerifyError on a damaged file.
    """
    if records.count == 0:
        return
    at, end = _data_start(pages, records)
    streams = _Streams(records, names)
    if not streams.packed:
        raise pages.damaged("all its points are the same")
    size = min(block_size, records.count)
    out = {field.name: field.column(size) for field in streams.fields}
    done = waiting = 0
    while done < records.count:
        if at >= end:
            raise pages.damaged(f"it holds {done:,} of {records.count:,} points")
        window = pages.read(at, min(_WINDOW, end - at))
        position, whole_window = 0, False
        while not whole_window and done < records.count:
            before = position
            position, reason = _gather(
                window, position, len(records.fields), streams.wanted, streams.bytes, streams.filled
            )
            if reason == 2:
                raise pages.damaged("a data packet cannot be understood")
            whole_window = reason == 0
            ready = min(streams.ready(), records.count - done)
            if position == before and ready == 0:
                raise pages.damaged("a data packet is cut off or its fields do not keep step")
            done += ready
            while ready:
                take = min(ready, size - waiting)
                streams.decode(take, out, waiting)
                ready -= take
                waiting += take
                if waiting == size:
                    yield out
                    waiting = 0
            streams.compact()
        at += position
    if waiting:
        yield {name: column[:waiting] for name, column in out.items()}
