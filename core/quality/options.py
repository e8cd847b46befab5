"""Options of the quality job."""

from __future__ import annotations

from dataclasses import dataclass

from ..options import InputOptions


@dataclass(frozen=True, kw_only=True)
class QualityOptions(InputOptions):
    """Options of ``jobs.quality``. Lengths in metres, angles in radians."""

    loa: int = 30
    """Level of accuracy that the campaign should support, 10 to 50."""
    sample_spacing: float = 0.05
    """Least distance between query positions: a shadow is resolved to about this."""
    most_queries: int = 800_000
    """Query positions over all elements; where the spacing would give more, it grows: shares of an element need no finer."""
    patch_size: float = 1.0
    """Edge of a patch, the unit of the table below the elements."""
    window: float = 0.05
    """A return this close to the planned surface, along its normal, lies on it; what is built further off is another one."""
    max_incidence: float = 1.3963
    """80 degrees: steeper returns are no evidence on a surface (as in ``verify``)."""
    range_max: float | None = None
    """Longest range of the scanner; None: from the returns."""
    target_coverage: float = 0.8
    """Share of the exposed surface below which an element asks for a corrective action."""
    seed: int = 0
