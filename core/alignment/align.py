"""Alignment as an option of the jobs."""

from __future__ import annotations

import numpy as np

from ..model.elements import BuildingModel
from ..model.samples import SurfaceSamples
from ..options import VerifyOptions
from ..progress import Progress
from ..results import AlignmentRecord
from ..scans.campaign import ScanSource


def align(
    model: BuildingModel, samples: SurfaceSamples, source: ScanSource, options: VerifyOptions, progress: Progress
) -> AlignmentRecord:
    """The pose of the scans that ``options.align`` asks for; with ``none`` they stay where they are.

    What searches for a pose is loaded only when a pose is searched for: it takes a second.
    """
    if options.align == "none":
        return AlignmentRecord("none", np.eye(4), None)
    from .auto import align_auto
    from .fine import align_fine

    if options.align == "auto":
        return align_auto(
            model, samples, source, sigma=options.sigma, loa=options.loa, seed=options.seed, progress=progress
        )
    return align_fine(
        model, samples, source, sigma=options.sigma, loa=options.loa, seed=options.seed, progress=progress
    )
