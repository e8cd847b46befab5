"""NPY files: a numeric array of shape (N, 3 or more), x y z [intensity] [red green blue]."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from .campaign import Station
from .plain_columns import by_content
from .scan_file import Columns, ScanFile, scan_frame_setup

_SAMPLE_ROWS = 200


class NpyFile(ScanFile):
    """A cloud without a scanner position; the array stays on disk and is read in blocks."""

    format = "NPY"

    def __init__(self, path: Path) -> None:
        table = self._open(path)
        if table.ndim != 2 or table.shape[1] < 3 or table.dtype.kind not in "fiu":
            raise BimVerifyError(
                f"{path} holds an array of {table.dtype} with shape {table.shape}, not (N, 3) numbers. "
                "Save x y z as rows."
            )
        self._use = by_content(np.asarray(table[:_SAMPLE_ROWS], np.float64))
        setup = scan_frame_setup(Station(path.stem, np.zeros(3), known=False))
        super().__init__(path, [setup], [len(table)])

    @staticmethod
    def _open(path: Path) -> NDArray:
        try:
            table: NDArray = np.load(path, mmap_mode="r", allow_pickle=False)
        except OSError:
            raise
        except Exception as error:  # a broken header makes NumPy raise many kinds
            raise BimVerifyError(
                f"{path} is cut off, damaged, or no plain NPY array of numbers. Save it again."
            ) from error
        return table

    def columns(self, station: int, block_size: int, attributes: bool) -> Iterator[Columns]:
        table = self._open(self.path)
        for start in range(0, len(table), block_size):
            yield self._use.columns(np.asarray(table[start : start + block_size], np.float64), attributes)
