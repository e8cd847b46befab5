"""Scan to building."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..evidence.photo_campaign import scale_sigma
from ..options import ReconstructOptions
from ..progress import Progress
from ..reconstruction.building import Reconstruction
from ..scans.campaign import ScanSource
from ..scans.open import Campaign, open_scans
from .inputs import Stopwatch, check_origins, check_stations, limited_threads


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
        check_origins(source)
        result = run(source, options.sigma, options.memory_gb, progress or Progress(), options.registration_sigma)
        if isinstance(source, Campaign) and (scale := scale_sigma(source.photo_blocks)):
            result.warnings.append(_not_to_scale(scale))
        watch.lap("reconstruction")
        result.timings = dict(watch.seconds)
        return result


def _not_to_scale(scale: float) -> str:
    return (
        "A block of photos has no control points and was adjusted freely, so the building stands, is levelled and is scaled as "
        f"the cameras were given: all lengths may be off by {100 * scale:.2g} % (one sigma) together, which no sigma in the "
        "result counts. Give control points, or tie the block to a model (bundle --edges)."
    )
