"""What a plan starts from, whatever the scanner: the building, where one can stand, and what is measured already."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.elements import BuildingModel
from ..model.samples import SurfaceSamples
from ..quality.results import QualityResult
from ..simulation.scene import Scene
from ..simulation.stand_points import StandPoints
from .cover import Array
from .existing import Existing, start_from
from .targets import Targets
from .visibility import Requirement


@dataclass(frozen=True)
class Site:
    """A building to be scanned."""

    model: BuildingModel
    samples: SurfaceSamples
    chosen: NDArray[np.bool_]
    """(E,) elements that the plan is for."""
    scene: Scene
    stands: StandPoints
    quality: QualityResult | None
    """Of the campaign that the plan adds to."""

    def existing(self, targets: Targets, need: Requirement) -> Existing | None:
        """What the campaign gives for the targets; None without a campaign."""
        return None if self.quality is None else start_from(self.quality, targets, need)

    def names(self, elements: Sequence[int] | NDArray[np.int64]) -> tuple[str, ...]:
        """Class and name of elements, by row."""
        return tuple(f"{e.ifc_class} {e.name}".strip() for e in (self.model.elements[int(row)] for row in elements))


@dataclass(frozen=True)
class Places:
    """The places of a plan (C): those of an existing campaign as they were scanned, the same to be scanned again, new ones."""

    position: Array
    """(C, 3) of the scanner's centre, metres, local frame."""
    known: int
    """Of the campaign; the first ones."""

    @staticmethod
    def of(site: Site, existing: Existing | None) -> Places:
        """All places of a site."""
        if existing is None:
            return Places(site.stands.position, 0)
        position = np.concatenate([existing.positions, existing.positions, site.stands.position])
        return Places(position, len(existing.positions))

    def floor(self, site: Site, place: int) -> float | None:
        """Height of the floor below a new place [m, local frame]; None where a campaign stood."""
        return float(site.stands.floor[place - 2 * self.known]) if place >= 2 * self.known else None
