"""Alignment as an option of the jobs."""

from __future__ import annotations

import numpy as np

from ..model.elements import BuildingModel
from ..model.samples import SurfaceSamples
from ..options import AlignMode
from ..progress import Progress
from ..results import AlignmentRecord
from ..scans.campaign import ScanSource


def align(
    model: BuildingModel, samples: SurfaceSamples, source: ScanSource, mode: AlignMode, *, sigma: float, loa: int,
    seed: int = 0, progress: Progress,
) -> AlignmentRecord:
    """The pose of the scans that ``mode`` asks for; with ``none`` they stay where they are.

    What searches for a pose is loaded only when a pose is searched for: it takes a second.
    """
    if mode == "none":
        return AlignmentRecord("none", np.eye(4), None)
    from .auto import align_auto
    from .fine import align_fine

    find = align_auto if mode == "auto" else align_fine
    return find(model, samples, source, sigma=sigma, loa=loa, seed=seed, progress=progress)
