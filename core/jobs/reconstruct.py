"""Scan to building."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..options import ReconstructOptions
from ..progress import Progress
from ..reconstruction.building import Reconstruction
from ..scans.campaign import ScanSource
from ..scans.open import open_scans
from .inputs import Stopwatch, check_stations, limited_threads


def reconstruct(
    scans: ScanSource | Sequence[str | Path], options: ReconstructOptions | None = None, progress: Progress | None = None
) -> Reconstruction:
    """Storeys, rooms, walls, openings, columns and slabs of what was scanned. Nothing is written.

    Raises BimVerifyError when a file cannot be used, or shows no storey.
    """
    from ..reconstruction.reconstruct import reconstruct as run

    options = options or ReconstructOptions()
    with limited_threads(options.threads):
        watch = Stopwatch()
        source = open_scans(scans, origin=options.origin) if isinstance(scans, Sequence) else scans
        check_stations(source)
        result = run(source, options.sigma, options.memory_gb, progress or Progress(), options.registration_sigma)
        watch.lap("reconstruction")
        result.timings = dict(watch.seconds)
        return result
