"""Rows of numbers in a text file, read in bounded pieces."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..errors import BimVerifyError

_PIECE = 4 * 2**20
"""Bytes read at a time."""
_POWERS = 10.0 ** np.arange(23)
_OUT_OF_ROOM, _NEED_MORE, _BAD = 0, 1, 2


@dataclass(frozen=True)
class Dialect:
    """How numbers stand on a line."""

    separator: str = ""
    """Empty: any white space. A comma or semicolon may have white space around it."""
    decimal: str = "."


PLAIN = Dialect()


@njit(cache=True, nogil=True)
def _number(data, at, end, decimal, powers):  # type: ignore[no-untyped-def]
    """The number that fills ``data[at:end]``, and whether it is one; nan and inf of any spelling are, and give nan.

    Right to two units in the last place (relative 4.4e-16) up to 22 decimals, to a few beyond.
    """
    negative = False
    if at < end and (data[at] == 43 or data[at] == 45):
        negative = data[at] == 45
        at += 1
    if at == end:
        return np.nan, False
    if data[at] in (78, 110, 73, 105):
        return np.nan, True
    mantissa = np.uint64(0)
    exponent = 0
    digits = 0
    seen_point = False
    while at < end:
        c = data[at]
        if 48 <= c <= 57:
            digits += 1
            if mantissa < np.uint64(1_000_000_000_000_000_000):
                mantissa = mantissa * np.uint64(10) + np.uint64(c - 48)
                if seen_point:
                    exponent -= 1
            elif not seen_point:
                exponent += 1
        elif c == decimal and not seen_point:
            seen_point = True
        else:
            break
        at += 1
    if digits == 0:
        return np.nan, False
    if at < end and data[at] in (69, 101, 68, 100):
        at += 1
        sign = 1
        if at < end and (data[at] == 43 or data[at] == 45):
            sign = -1 if data[at] == 45 else 1
            at += 1
        power = 0
        if at == end:
            return np.nan, False
        while at < end and 48 <= data[at] <= 57:
            power = min(power * 10 + int(data[at]) - 48, 9999)
            at += 1
        exponent += sign * power
    if at != end:
        return np.nan, False
    value = float(mantissa)
    if -22 <= exponent < 0:
        value /= powers[-exponent]
    elif 0 < exponent <= 22:
        value *= powers[exponent]
    elif exponent != 0 and mantissa != 0:
        value *= 10.0**exponent
    return (-value if negative else value), True


@njit(cache=True, nogil=True)
def _line(data, at, size):  # type: ignore[no-untyped-def]
    """(First byte that is no white space, end) of the line at ``at``; the end is ``size`` without a line end."""
    end = at
    while end < size and data[end] != 10:
        end += 1
    while at < end and (data[at] == 32 or data[at] == 9 or data[at] == 13):
        at += 1
    return at, end


@njit(cache=True, nogil=True)
def _is_row(data, start, end):  # type: ignore[no-untyped-def]
    """Neither blank nor a comment (#, //, %)."""
    if start == end:
        return False
    c = data[start]
    return not (c == 35 or c == 37 or (c == 47 and start + 1 < end and data[start + 1] == 47))


@njit(cache=True, nogil=True)
def _parse(data, size, whole, separator, decimal, need, powers, out):  # type: ignore[no-untyped-def]
    """Fill ``out`` from complete lines (``whole``: the last line needs no end). Columns that are not there are nan.

    Returns (rows, bytes used, why it stopped). A row is bad if one of its first ``need`` columns is.
    """
    at = 0
    row = 0
    columns = out.shape[1]
    while row < out.shape[0]:
        start, end = _line(data, at, size)
        if end == size and (not whole or at == size):
            return row, at, _NEED_MORE
        following = min(end + 1, size)
        if not _is_row(data, start, end):
            at = following
            continue
        column = 0
        where = start
        while where < end and column < columns:
            while where < end and (data[where] == 32 or data[where] == 9 or data[where] == 13):
                where += 1
            stop = where
            if separator == 0:
                while stop < end and data[stop] != 32 and data[stop] != 9 and data[stop] != 13:
                    stop += 1
                if stop == where:
                    break
                last = stop
            else:
                while stop < end and data[stop] != separator:
                    stop += 1
                last = stop
                while last > where and (data[last - 1] == 32 or data[last - 1] == 9 or data[last - 1] == 13):
                    last -= 1
            value, good = _number(data, where, last, decimal, powers)
            if not good and column < need:
                return row, at, _BAD
            out[row, column] = value
            column += 1
            where = stop + 1
        if column < need:
            return row, at, _BAD
        while column < columns:
            out[row, column] = np.nan
            column += 1
        row += 1
        at = following
    return row, at, _OUT_OF_ROOM


@njit(cache=True, nogil=True)
def _skip(data, size, whole, rows):  # type: ignore[no-untyped-def]
    """Pass over up to ``rows`` rows of complete lines. Returns (rows passed, bytes used)."""
    at = 0
    passed = 0
    while passed < rows:
        start, end = _line(data, at, size)
        if end == size and (not whole or at == size):
            break
        if _is_row(data, start, end):
            passed += 1
        at = min(end + 1, size)
    return passed, at


class TextRows:
    """One text file of numbers. Positions are byte positions of the start of a line."""

    def __init__(self, path: Path, dialect: Dialect = PLAIN) -> None:
        self.path = path
        self.dialect = dialect
        self.size = path.stat().st_size

    def line(self, at: int) -> tuple[str, int]:
        """The line at ``at`` without its end, and where the next one starts; at the end of the file an empty line."""
        with self.path.open("rb") as file:
            file.seek(at)
            text = file.readline(65536)
        return text.decode("latin-1").strip(), at + len(text)

    def _pieces(self, at: int) -> Iterator[tuple[NDArray[np.uint8], bool, list[int]]]:
        """(Bytes, whether they reach the end, [bytes used]) from ``at`` on; the receiver sets how many it used."""
        with self.path.open("rb") as file:
            while at < self.size:
                file.seek(at)
                data = np.frombuffer(file.read(_PIECE), np.uint8)
                if data.size == 0:
                    raise BimVerifyError(f"{self.path} became shorter while it was read. Read it again.")
                whole = at + data.size >= self.size
                used = [0]
                yield data, whole, used
                if used[0] == 0 and not whole:
                    raise BimVerifyError(f"{self.path} is no point cloud: it has lines of more than 4 MB.")
                at += used[0]
                if whole and used[0] == 0:
                    return

    def skip(self, at: int, rows: int) -> tuple[int, int]:
        """(Rows passed, position after them); fewer rows than asked for only at the end of the file."""
        passed = 0
        for data, whole, used in self._pieces(at):
            count, used[0] = _skip(data, data.size, whole, rows - passed)
            passed += count
            at += used[0]
            if passed == rows:
                break
        return passed, at

    def count(self, at: int) -> int:
        """Rows from ``at`` to the end of the file."""
        return self.skip(at, 2**62)[0]

    def read(
        self, at: int, columns: int, need: int, block_size: int, rows: int = 2**62
    ) -> Iterator[NDArray[np.float64]]:
        """Stream ``rows`` rows as (N, columns) arrays, N up to ``block_size``, from byte ``at`` on.

        The first ``need`` values of every row must be numbers, else BimVerifyError names the row. The array is used
        again for the next block.
        """
        separator = ord(self.dialect.separator) if self.dialect.separator else 0
        decimal = ord(self.dialect.decimal)
        done = 0
        out = np.empty((min(block_size, 262_144), columns))
        for data, whole, used in self._pieces(at):
            while done < rows:
                room = out[: min(len(out), rows - done)]
                count, size, why = _parse(
                    data[used[0] :], data.size - used[0], whole, separator, decimal, need, _POWERS, room
                )
                used[0] += size
                done += count
                if count:
                    yield room[:count]
                if why == _BAD:
                    text = bytes(data[used[0] : used[0] + 60]).split(b"\n")[0].decode("latin-1").strip()
                    raise BimVerifyError(
                        f"{self.path} is damaged: row {done + 1:,} ({text!r}) does not start with {need} numbers. "
                        "Export the file again."
                    )
                if why == _NEED_MORE:
                    break
            if done >= rows:
                return
