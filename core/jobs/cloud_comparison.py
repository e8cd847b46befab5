"""Two clouds of one place, a scan and a dense photogrammetric cloud for instance: M3C2 distances and what they can tell."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..imagery.m3c2 import M3C2, m3c2
from ..options import InputOptions
from ..planes.cloud import read_cloud
from ..planes.surfels import make_surfels
from ..progress import Progress
from ..scans.open import open_scans
from .inputs import Stopwatch, limited_threads

Array = NDArray[np.float64]
CORE_M = 0.05
"""Distance between core points, and the diameter of a cylinder."""
REACH_M = 0.15
"""Half-length of a cylinder: what lies farther off is another surface."""
FLAT = 0.1
"""Largest planarity of a surface that has one normal."""


@dataclass(frozen=True, kw_only=True)
class ComparisonOptions(InputOptions):
    """Options of ``compare_clouds``. Lengths in metres."""

    registration_sigma: float = 0.001
    """Registration error between the clouds (reg in eq. 6.3 of Meyer 2023)."""
    core: float = CORE_M
    reach: float = REACH_M


@dataclass(frozen=True)
class CloudComparison:
    """Distances of the second cloud from the first at core points of the first (N, 3), along its normals (N, 3)."""

    core: Array
    normal: Array
    found: M3C2
    options: ComparisonOptions
    points: tuple[int, int]
    """Of both clouds."""
    timings: dict[str, float] = field(default_factory=dict)

    def summary(self) -> dict[str, float]:
        """The rows of table 7.6 of Meyer (2023); lengths in metres, shares of the core points that both clouds show."""
        known = np.isfinite(self.found.distance)
        away = np.abs(self.found.distance[known])
        nothing = math.nan if not len(away) else 0.0
        return {
            "core_points": float(len(self.core)), "compared": float(known.sum()),
            **{f"within_{mm}_mm": float((away <= mm / 1000).mean()) if len(away) else math.nan for mm in (1, 5, 10)},
            "median_distance": float(np.median(self.found.distance[known])) if len(away) else nothing,
            "mean_level": float(self.found.level[known].mean()) if len(away) else nothing,
            "significant": float(self.found.significant[known].mean()) if len(away) else nothing,
        }


def compare_clouds(
    base: Sequence[str | Path], other: Sequence[str | Path], options: ComparisonOptions | None = None,
    progress: Progress | None = None,
) -> CloudComparison:
    """M3C2 of ``other`` against ``base``, both in one frame. Nothing is written.

    Core points are the middles of the base cloud's surfaces in voxels of ``options.core``; a normal points to the scanner
    where the file names it. Raises BimVerifyError when a file cannot be used, or when the clouds do not meet.
    """
    options, progress = options or ComparisonOptions(), progress or Progress()
    if not 0 < options.core < math.inf or not 0 < options.reach < math.inf:
        raise BimVerifyError("Core points need a distance and a reach larger than zero.")
    with limited_threads(options.threads):
        watch = Stopwatch()
        sources = [open_scans(paths, origin=options.origin) for paths in (base, other)]
        clouds = [
            read_cloud(s, options.memory_gb, progress.part(0.35 * k, 0.35 * (k + 1))) for k, s in enumerate(sources)
        ]
        watch.lap("reading")
        surfels = make_surfels(clouds[0], options.core)
        surfels = surfels.where(surfels.planarity < FLAT)
        core, normal = surfels.position.astype(np.float64), surfels.normal.astype(np.float64)
        points = [c.points + (c.origin - clouds[0].origin) for c in clouds]
        watch.lap("core points")
        progress.update(0.8, "Comparing")
        found = m3c2(
            core, normal, points[0], points[1], radius=options.core / 2, reach=options.reach,
            registration=options.registration_sigma,
        )
        watch.lap("distances")
    if not np.isfinite(found.distance).any():
        raise BimVerifyError(
            f"{Path(other[0]).name} comes nowhere within {1000 * options.reach:.0f} mm of {Path(base[0]).name}; bring both "
            "into one frame first."
        )
    progress.update(1.0, "Compared")
    return CloudComparison(
        core + clouds[0].origin, normal, found, options, (clouds[0].total, clouds[1].total), dict(watch.seconds)
    )
