"""The lowest layer of an E57 file (ASTM E2807): pages of 1024 bytes that end in a checksum, and the XML section."""

from __future__ import annotations

import struct
from io import BufferedReader
from pathlib import Path

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..errors import BimVerifyError
from .byte_copy import copy_bytes

SIGNATURE = b"ASTM-E57"
PAGE = 1024
PAYLOAD = PAGE - 4
_HEADER = struct.Struct("<8sIIQQQQ")
_POLYNOMIAL = 0x82F63B78
_LARGEST_XML = 256 * 2**20


def _crc_tables() -> NDArray[np.uint32]:
    """(16, 256) tables for CRC-32C (Castagnoli, reflected), sixteen bytes a step."""
    table = np.arange(256, dtype=np.uint32)
    for _ in range(8):
        table = np.where(table & 1, (table >> 1) ^ np.uint32(_POLYNOMIAL), table >> 1)
    tables = [table]
    for _ in range(15):
        tables.append((tables[-1] >> 8) ^ table[tables[-1] & 0xFF])
    return np.stack(tables).astype(np.uint32)


_TABLES = _crc_tables()


@njit(cache=True, nogil=True)
def _strip(pages, words, tables, first, out):  # type: ignore[no-untyped-def]
    """Copy payloads of ``pages`` (uint8; ``words`` is the same memory as uint32) to ``out``, from byte ``first`` of
    the first page on. Returns the number of the first page with a wrong checksum, or -1."""
    count = pages.size // 1024
    at = 0
    for page in range(count):
        base = page * 1024
        word = base // 4
        crc = np.uint32(0xFFFFFFFF)
        for k in range(63):
            w = word + 4 * k
            a = words[w] ^ crc
            b, c, d = words[w + 1], words[w + 2], words[w + 3]
            crc = (
                tables[15, a & 0xFF] ^ tables[14, (a >> 8) & 0xFF] ^ tables[13, (a >> 16) & 0xFF] ^ tables[12, a >> 24]
                ^ tables[11, b & 0xFF] ^ tables[10, (b >> 8) & 0xFF] ^ tables[9, (b >> 16) & 0xFF] ^ tables[8, b >> 24]
                ^ tables[7, c & 0xFF] ^ tables[6, (c >> 8) & 0xFF] ^ tables[5, (c >> 16) & 0xFF] ^ tables[4, c >> 24]
                ^ tables[3, d & 0xFF] ^ tables[2, (d >> 8) & 0xFF] ^ tables[1, (d >> 16) & 0xFF] ^ tables[0, d >> 24]
            )
        for k in range(1008, 1020):
            crc = (crc >> np.uint32(8)) ^ tables[0, (crc ^ pages[base + k]) & np.uint32(0xFF)]
        crc ^= np.uint32(0xFFFFFFFF)
        stored = (
            (np.uint32(pages[base + 1020]) << np.uint32(24)) | (np.uint32(pages[base + 1021]) << np.uint32(16))
            | (np.uint32(pages[base + 1022]) << np.uint32(8)) | np.uint32(pages[base + 1023])
        )
        if crc != stored:
            return page
        start = first if page == 0 else 0
        length = 1020 - start
        copy_bytes(pages, base + start, out, at, length)
        at += length
    return -1


def logical(physical: int) -> int:
    """Position in the file with its checksums taken out."""
    page, within = divmod(physical, PAGE)
    return page * PAYLOAD + min(within, PAYLOAD)


class E57Pages:
    """Reads checked bytes by logical position. Not to be shared between threads; use as a context manager."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file: BufferedReader = path.open("rb")
        try:
            self._read_header()
        except BaseException:
            self._file.close()
            raise

    def _read_header(self) -> None:
        size = self.path.stat().st_size
        header = self._file.read(_HEADER.size)
        if len(header) < _HEADER.size or not header.startswith(SIGNATURE):
            raise BimVerifyError(f"{self.path} is not an E57 file. Check its name and export it again.")
        _, major, _, length, xml_at, xml_length, page = _HEADER.unpack(header)
        if major != 1 or page != PAGE:
            raise BimVerifyError(f"{self.path} is an E57 file of an unknown version. Export it as E57 1.0.")
        if size < length or size % PAGE:
            raise BimVerifyError(
                f"{self.path} is cut off ({size:,} of {length:,} bytes). Copy or export the file again."
            )
        self.length = logical(size)
        self._xml = (logical(xml_at), xml_length)

    def __enter__(self) -> E57Pages:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def damaged(self, what: str) -> BimVerifyError:
        return BimVerifyError(f"{self.path} is damaged ({what}). Copy or export the file again.")

    def read(self, start: int, count: int) -> NDArray[np.uint8]:
        """Up to ``count`` bytes from logical position ``start``; fewer at the end of the file only."""
        count = min(count, self.length - start)
        if start < 0 or count <= 0:
            raise self.damaged("a position lies outside the file")
        first_page, within = divmod(start, PAYLOAD)
        n_pages = (within + count + PAYLOAD - 1) // PAYLOAD
        raw = np.empty(n_pages * PAGE, np.uint8)
        self._file.seek(first_page * PAGE)
        if self._file.readinto(raw.data) != raw.size:
            raise self.damaged("it became shorter while it was read")
        out = np.empty(n_pages * PAYLOAD - within, np.uint8)
        bad = _strip(raw, raw.view("<u4"), _TABLES, within, out)
        if bad >= 0:
            raise self.damaged(f"wrong checksum in page {first_page + bad:,}")
        return out[:count]

    def xml(self) -> bytes:
        """The XML section."""
        start, count = self._xml
        if count > _LARGEST_XML or start + count > self.length:
            raise self.damaged("its XML section lies outside the file")
        return self.read(start, count).tobytes()
