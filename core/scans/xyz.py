"""XYZ, TXT, ASC and CSV files: x y z [intensity] [red green blue] on lines, with or without a line of names."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..errors import BimVerifyError
from .campaign import Station
from .plain_columns import ColumnUse, by_content, by_name
from .scan_file import Columns, ScanFile, scan_frame_setup
from .text_rows import Dialect, TextRows

BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_HEADER_LINES = 50
_SAMPLE_ROWS = 200
_MOST_COLUMNS = 64


def sniff_dialect(line: str) -> Dialect:
    """The separator and the decimal sign of a line of numbers."""
    if ";" in line:
        return Dialect(";", "," if "," in line and "." not in line else ".")
    words = line.split()
    if len(words) >= 3 and all(word.count(",") == 1 and not word.endswith(",") for word in words[:3]):
        return Dialect("", ",")
    return Dialect("," if "," in line else "")


def split_line(line: str, dialect: Dialect) -> list[str]:
    return [word.strip() for word in line.split(dialect.separator or None)]


def is_number(word: str, decimal: str = ".") -> bool:
    """Plain decimal numbers only."""
    try:
        float(word.replace(decimal, ".") if decimal != "." else word)
    except ValueError:
        return False
    return True


class XyzFile(ScanFile):
    """A table of points without a scanner position."""

    format = "XYZ"

    def __init__(self, path: Path) -> None:
        self._rows, self._at, names = _find_first_row(path)
        first = next(self._rows.read(self._at, _MOST_COLUMNS, 3, _SAMPLE_ROWS))
        self._use = names or by_content(first[:, : max(3, int((~np.isnan(first)).any(axis=0).sum()))])
        color = first[:, self._use.rgb] if self._use.rgb else np.zeros(0)
        self._unit_colors = bool(color.size and np.nanmax(color) <= 1.0 and (color != np.round(color)).any())
        setup = scan_frame_setup(Station(path.stem, np.zeros(3), known=False))
        super().__init__(path, [setup], [self._rows.count(self._at)])

    def columns(self, station: int, block_size: int, attributes: bool) -> Iterator[Columns]:
        last = self._use.last if attributes else max(self._use.xyz)
        for table in self._rows.read(self._at, last + 1, max(self._use.xyz) + 1, block_size):
            yield self._use.columns(table, attributes, self._unit_colors)


def _find_first_row(path: Path) -> tuple[TextRows, int, ColumnUse | None]:
    """The first row of numbers; what stands before it may name the columns."""
    plain = TextRows(path)
    with path.open("rb") as file:
        at = 3 if file.read(3) == BYTE_ORDER_MARK else 0
    names: ColumnUse | None = None
    for _ in range(_HEADER_LINES):
        line, following = plain.line(at)
        if following == at:
            break
        dialect = sniff_dialect(line)
        words = split_line(line, dialect)
        if len(words) >= 3 and all(is_number(word, dialect.decimal) for word in words[:3]):
            return TextRows(path, dialect), at, names
        names = by_name(split_line(line.lstrip("/#% "), dialect)) or names
        at = following
    raise BimVerifyError(
        f"{path} holds no rows of x y z. Give a scan file (E57, LAS, LAZ, PLY, PCD, PTS, PTX, XYZ, CSV, NPY)."
    )
