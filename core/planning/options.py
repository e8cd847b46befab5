"""Options of the planning job."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..options import InputOptions
from ..sensing.loa import UPPER_BOUND_M

COARSEST_SPACING_M = 0.05


@dataclass(frozen=True, kw_only=True)
class PlanOptions(InputOptions):
    """Options of ``jobs.plan``. Lengths in metres, angles in radians."""

    loa: int = 30
    scanner: str = "medium"
    """Preset; ``auto``: the one with the least time."""
    coverage: float = 0.9
    """Share of what can be reached of each element that must be covered well enough."""
    classes: tuple[str, ...] = ()
    """IFC classes of the chosen elements; none: all."""
    elements: tuple[str, ...] = ()
    """GlobalIds of the chosen elements; none: all."""
    max_incidence: float = math.radians(70.0)
    range_max: float | None = None
    """None: the scanner's."""
    spacing: float | None = None
    """Largest distance between returns; None: from the level (see ``wanted_spacing``)."""
    registration_sigma: float = 0.001
    """Of a station's position that the registration is expected to leave."""
    overlap: float = 0.1
    """Share of the smaller view that two linked stations must have in common; all stations are linked, for registration."""
    candidates: int = 240
    """Places that are looked at."""
    setup_minutes: float = 3.0
    points_per_second: float = 500_000.0
    solve_seconds: float = 20.0
    """For the proof that fewer stations do not do."""
    seed: int = 0

    @property
    def wanted_spacing(self) -> float:
        """Largest distance between returns: a side is known to about a quarter of it, a corner to 0.35; twice the level's
        bound keeps that and its scatter inside."""
        return self.spacing if self.spacing is not None else min(2.0 * UPPER_BOUND_M[self.loa], COARSEST_SPACING_M)
