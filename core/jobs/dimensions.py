"""As-built dimensions: what a verification measured, and the edges of openings in its scans."""

from __future__ import annotations

from pathlib import Path

from ..alignment.transform import TransformedSource
from ..dimensions.as_built import as_built_dimensions
from ..dimensions.table import Dimension
from ..planes.cloud import read_cloud
from ..progress import Progress
from ..results import VerificationResult
from .inputs import limited_threads, open_campaign


def dimensions(
    result: VerificationResult, source: str | Path | None = None, progress: Progress | None = None
) -> list[Dimension]:
    """Rooms and openings of a verified model as built. The scans are read once more, for the edges of openings.

    ``source``: the IFC file, where it is another than ``result.model.path``. Scans that have gone since the verification leave
    openings without edges, and their rows say so. Raises BimVerifyError when a file cannot be read.
    """
    progress = progress or Progress()
    options = result.options
    if result.photos_only or not all(Path(path).exists() for path in result.scan_paths):
        return as_built_dimensions(result, source, progress=progress)
    with limited_threads(options.threads):
        scans = open_campaign(result.model, list(result.scan_paths), options)
        if options.align != "none":
            scans = TransformedSource(scans, result.alignment.transform)
        cloud = read_cloud(scans, options.memory_gb, progress.part(0.0, 0.5))
        return as_built_dimensions(result, source, cloud, progress.part(0.5, 1.0))
