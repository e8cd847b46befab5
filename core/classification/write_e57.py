"""The classified cloud as E57: one scan for each element, named after it, and one for what lies on none."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..progress import Progress
from ..scans.campaign import Station
from ..scans.write_e57 import ROWS, ScanRows, write_scans
from .results import Classification
from .sort import AXES, COLORS, DEVIATION, STATION, SortedReturns

UNASSIGNED_NAME = "unassigned"
RESOLUTION_M = 1e-5
"""Of the coordinates in the file: far below any scanner's noise."""


class _Part(ScanRows):
    """The rows of one element, all or those of one station."""

    def __init__(
        self, station: Station, rows: NDArray, columns: list[str], guid: str, description: str,
        groups: Sequence[tuple[int, int, int]],
    ) -> None:
        super().__init__(station)
        self.groups = groups
        self.dtype = np.dtype([(name, rows.dtype[name]) for name in columns])
        self.guid, self.description = guid, description
        self._rows = rows
        for chunk in self.read():
            self.measure(chunk)

    def read(self) -> Iterator[NDArray]:
        for begin in range(0, len(self._rows), ROWS):
            yield self._rows[begin : begin + ROWS]


def write_classified_e57(
    path: str | Path, result: Classification, memory_gb: float, progress: Progress | None = None, *,
    per_station: bool = False, fields: bool = False,
) -> None:
    """Write every return of the source, one scan for each element that has some; its guid is the GlobalId.

    The scans have no pose, since returns of several stations are in them: coordinates are metres in the model frame.
    Points are in the order of the stations; ``bv:groups`` of a scan says how many are of which, and ``bv:stations`` at the
    file's root keeps the stations' names and poses. With ``per_station`` there is a scan for each element and station
    instead, with that station's pose, points in its sensor frame, and their place in its grid. ``fields`` adds two columns,
    ``bv:station`` and ``bv:deviation`` [m]; some readers refuse columns that the standard does not know. Raises
    BimVerifyError when the place cannot be written.
    """
    progress = progress or Progress()
    with SortedReturns(result, memory_gb, progress.part(0.0, 0.5), sensor_frame=per_station) as returns:
        progress.update(0.5, "Writing the classified cloud")
        parts = list(_parts(result, returns, per_station, fields))
        write_scans(path, parts, scaled_integer_m=RESOLUTION_M, stations=result.stations)
        progress.update(1.0, "Classified cloud written")
        del parts


def _parts(
    result: Classification, returns: SortedReturns, per_station: bool, fields: bool
) -> Iterator[_Part]:
    columns = [*AXES]
    columns += ["intensity"] if returns.has_intensity else []
    columns += COLORS if returns.has_color else []
    columns += ["rowIndex", "columnIndex"] if per_station and returns.has_grid else []
    used: dict[str, int] = {}
    for row in range(len(result.counts)):
        if not result.counts[row].sum():
            continue
        assigned = row < len(result.model.elements)
        name, guid, said = _names(result, row)
        used[guid] = used.get(guid, 0) + 1
        if used[guid] > 1:  # some files use a GlobalId twice
            guid = f"{guid}/{used[guid]}"
        own = [*columns, *([STATION] if fields else []), *([DEVIATION] if fields and assigned else [])]
        if not per_station:
            whole = Station(name, np.zeros(3), known=False, acquired=_acquired(result))
            seen = ", ".join(
                f"{n} of {station.name}" for station, n in zip(result.stations, result.counts[row], strict=True) if n
            )
            yield _Part(whole, returns.rows[returns.of(row)], own, guid, f"{said}; returns: {seen}", _groups(result, row))
            continue
        for number in np.flatnonzero(result.counts[row]):
            station = result.stations[number]
            yield _Part(
                replace(station, name=f"{name} / {station.name}"), returns.rows[returns.of(row, int(number))], own,
                f"{guid}/{station.name}/{number}" if guid else "", f"{said}; returns of {station.name}",
                [(int(number), 0, int(result.counts[row, number]))],
            )


def _groups(result: Classification, row: int) -> list[tuple[int, int, int]]:
    counts = result.counts[row]
    ends = np.cumsum(counts)
    return [(int(k), int(ends[k] - counts[k]), int(counts[k])) for k in np.flatnonzero(counts)]


def _names(result: Classification, row: int) -> tuple[str, str, str]:
    """Name, guid and description of the scan of an element; the guid of the unassigned is left to the writer."""
    if row == len(result.model.elements):
        return UNASSIGNED_NAME, "", "Returns that lie on no element of the model"
    e = result.model.elements[row]
    storey = f"; {e.storey}" if e.storey else ""
    return e.name or e.ifc_class, e.global_id, f"{e.ifc_class} {e.global_id}{storey}"


def _acquired(result: Classification) -> str:
    return max((s.acquired for s in result.stations), default="")
