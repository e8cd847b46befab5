"""The path of a mobile scanner in a file beside its cloud: ``NAME.trajectory.csv`` beside ``NAME.las``.

One line a moment: time, x, y, z, in the clock and the frame of the cloud; a header line and more columns may be there.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError

SUFFIX = ".trajectory.csv"
MOST_BYTES = 1_000_000_000
LONGEST_GAP_S = 1.0
"""Between two moments of the path that a place is worked out between."""
NAMES = ("time", "x", "y", "z")


@dataclass(frozen=True)
class Trajectory:
    """Ascending times (N,) [s] and places (N, 3) [m, the cloud's frame]."""

    time: NDArray[np.float64]
    place: NDArray[np.float64]

    def at(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """(K, 3) places at times (K,), linear between moments; NaN before, after and in gaps of the path."""
        place = np.column_stack([np.interp(time, self.time, axis, np.nan, np.nan) for axis in self.place.T])
        after = np.clip(np.searchsorted(self.time, time), 1, len(self.time) - 1)
        place[self.time[after] - self.time[after - 1] > LONGEST_GAP_S] = np.nan
        return place


def trajectory_beside(cloud: Path) -> Trajectory | None:
    """The path that stands beside a cloud; None where there is none. Raises BimVerifyError when it cannot be used."""
    path = cloud.with_name(cloud.stem + SUFFIX)
    if not path.is_file():
        return None
    if path.stat().st_size > MOST_BYTES:
        raise BimVerifyError(f"{path} is larger than {MOST_BYTES / 1e9:.0f} GB, which no path of a scanner is. Thin it.")
    rows: list[list[float]] = []
    columns = [0, 1, 2, 3]
    with path.open(newline="", encoding="utf-8-sig", errors="replace") as file:
        for number, words in enumerate(csv.reader(file)):
            try:
                rows.append([float(words[k]) for k in columns])
            except (ValueError, IndexError) as error:
                named = [w.strip().lower() for w in words]
                if number == 0 and set(NAMES) <= set(named):
                    columns = [named.index(n) for n in NAMES]
                elif words:
                    raise BimVerifyError(f"{path}, line {number + 1}: time, x, y and z were expected.") from error
    path_of = np.array(rows, dtype=np.float64).reshape(-1, 4)
    path_of = path_of[np.isfinite(path_of).all(axis=1)]
    if len(path_of) < 2:
        raise BimVerifyError(f"{path} holds fewer than two moments of a path. Export it again with time, x, y and z.")
    path_of = path_of[np.argsort(path_of[:, 0], kind="stable")]
    return Trajectory(path_of[:, 0], path_of[:, 1:])
