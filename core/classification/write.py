"""The classified cloud as a file; its name says of which kind."""

from __future__ import annotations

from pathlib import Path

from ..progress import Progress
from .results import Classification
from .write_e57 import write_classified_e57
from .write_las import write_classified_las


def write_classified(
    path: str | Path, result: Classification, memory_gb: float, progress: Progress | None = None, *,
    per_station: bool = False, fields: bool = False,
) -> None:
    """Write LAS where the name ends with ``.las`` or ``.laz``, else E57 (``per_station``, ``fields``: see there)."""
    if Path(path).suffix.lower() in (".las", ".laz"):
        write_classified_las(path, result, memory_gb, progress)
    else:
        write_classified_e57(path, result, memory_gb, progress, per_station=per_station, fields=fields)
