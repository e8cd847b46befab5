"""PTS files: a line with the number of points, then x y z [intensity] [red green blue], for each cloud."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..errors import BimVerifyError
from .campaign import Station
from .plain_columns import ColumnUse, by_content
from .scan_file import Columns, ScanFile, scan_frame_setup
from .text_rows import TextRows

_MOST_COLUMNS = 7
_SAMPLE_ROWS = 200


class PtsFile(ScanFile):
    """Clouds without scanner positions: each is a station of its own, as such files come from several scans."""

    format = "PTS"

    def __init__(self, path: Path) -> None:
        self._rows = TextRows(path)
        self._starts: list[int] = []
        self._uses: list[ColumnUse] = []
        counts: list[int] = []
        at = 0
        while at < self._rows.size:
            line, at = self._rows.line(at)
            if not line:
                continue
            if not line.isdecimal() or len(line) > 18:
                raise BimVerifyError(
                    f"{path} is damaged: a number of points is expected where it says {line[:40]!r}. Export it again."
                )
            count = int(line)
            passed, end = self._rows.skip(at, count)
            if passed < count:
                raise BimVerifyError(
                    f"{path} is cut off: it declares {count:,} points and holds {passed:,}. Copy or export it again."
                )
            self._starts.append(at)
            self._uses.append(self._use(at, count))
            counts.append(count)
            at = end
        several = len(counts) > 1
        setups = [
            scan_frame_setup(Station(f"{path.stem} {k + 1}" if several else path.stem, np.zeros(3), known=False))
            for k in range(len(counts))
        ]
        super().__init__(path, setups, counts)

    def _use(self, at: int, count: int) -> ColumnUse:
        if count == 0:
            return ColumnUse()
        first = next(self._rows.read(at, _MOST_COLUMNS, 3, _SAMPLE_ROWS, count))
        return by_content(first[:, : max(3, int((~np.isnan(first)).any(axis=0).sum()))])

    def columns(self, station: int, block_size: int, attributes: bool) -> Iterator[Columns]:
        use = self._uses[station]
        width = (use.last if attributes else 2) + 1
        rows = self.points_per_station[station]
        for table in self._rows.read(self._starts[station], width, 3, block_size, rows):
            yield use.columns(table, attributes)
