"""What a quality survey found. Lengths in metres, areas in m2, angles in radians, model frame."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..model.elements import BuildingModel
from ..model.samples import SurfaceSamples
from .occluders import Blocked, Clutter
from .options import QualityOptions
from .survey import Survey


@dataclass(frozen=True)
class Measured:
    """What the returns say of a piece of surface; None where nothing could be measured."""

    area: float
    """Exposed surface."""
    coverage: float
    """Share of it with returns."""
    spacing: float | None
    """Median distance between the returns of all stations together."""
    spacing_p95: float | None
    consistency: float | None
    """95th percentile of the spacing over its median: 1 where it is the same everywhere."""
    noise: float | None
    """Standard deviation of returns from local planes, along the normal: away from edges, or near them where an
    element has nothing else."""
    incidence_median: float | None
    incidence_p95: float | None
    """Of the station that sees each place best."""
    range_median: float | None
    stations_median: float | None
    """Stations that see a place that is seen."""
    missing: dict[str, float]
    """Cause -> share of the exposed surface; they and the coverage add up to 1."""
    registration: float | None
    """Standard deviation of a station against the others, along the normal, beyond noise."""
    turned_away: float = 0.0
    """Share of the exposed surface that faces no station; a part of what is occluded."""


@dataclass(frozen=True)
class Hidden:
    """An object that hides a part of an element from a station that would see it otherwise."""

    occluder: str
    """GlobalId of an element, or the name of a piece of clutter."""
    name: str
    station: str
    area: float


@dataclass(frozen=True)
class ElementQuality:
    """The scan quality of one element."""

    global_id: str
    ifc_class: str
    name: str
    storey: str
    measured: Measured
    edge_noise: float | None
    """Standard deviation of the returns near edges, and the shape of their distribution (2 normal, 1 Laplace)."""
    edge_shape: float | None
    mixed_share: float | None
    """Share of the returns near edges that lie on no planned surface."""
    hidden: tuple[Hidden, ...]
    component: str
    """``surface`` or ``outline``: what its predicted error counts."""
    predicted_error: float | None
    """Expected error of its as-built model."""
    gsa_level: int
    """GSA level of detail that the scan supports, 0 for none to 4."""
    supported_loa: int | None
    actions: tuple[str, ...]
    """Of AO, RA, RD, IN, IR."""
    reason: str
    """One or two sentences for a person."""
    built_offset: float | None = None
    """How far its largest face was found before its plan, along the normal, and measured there; None as planned."""


@dataclass(frozen=True)
class PatchQuality:
    """A piece of one face of an element, about ``patch_size`` wide."""

    element: int
    center: tuple[float, float, float]
    normal: tuple[float, float, float]
    measured: Measured


@dataclass(frozen=True)
class StationQuality:
    """What one station gave."""

    name: str
    position: tuple[float, float, float]
    returns: int
    spacing_rad: float
    range_max: float
    elevation_min: float
    elevation_max: float
    best_view_area: float
    """Surface that it sees better than the others."""
    registration: float | None
    """Usual size of its offset from the other stations where they overlap."""


@dataclass(frozen=True)
class Factor:
    """One of the nine quality factors of a campaign."""

    name: str
    value: float | None
    unit: str
    text: str
    """What the number says, or why there is none."""


@dataclass(frozen=True)
class QualityResult:
    """Everything that one survey found."""

    model: BuildingModel
    options: QualityOptions
    elements: tuple[ElementQuality, ...]
    """One per ``model.elements``, same order."""
    patches: tuple[PatchQuality, ...]
    stations: tuple[StationQuality, ...]
    clutter: tuple[Clutter, ...]
    factors: tuple[Factor, ...]
    whole: Measured
    samples: SurfaceSamples
    survey: Survey
    blocked: Blocked
    registration_sigma: float
    scan_paths: tuple[str, ...]
    scan_date: str
    method: str
    timings: dict[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    @property
    def supported(self) -> NDArray[np.bool_]:
        """(E,) elements that support the level asked for."""
        return np.array([(e.supported_loa or 0) >= self.options.loa for e in self.elements], dtype=np.bool_)

    @property
    def headline(self) -> str:
        """What the survey found, in two sentences."""
        found = self.summary()
        returns, free = found["elements_with_returns"], found["exposed_elements"]
        without = f"; {free - returns} have no returns" if free > returns else ""
        return (
            f"{found['supporting']} of {free} elements support LOA{self.options.loa} where they were seen{without}. "
            f"{self.whole.coverage:.0%} of the surface that neighbours leave free has returns; "
            f"{self.whole.turned_away:.0%} of it faces no station."
        )

    def summary(self) -> dict[str, Any]:
        """The few numbers of the whole."""
        seen = [e for e in self.elements if e.measured.area > 0]
        return {
            "elements": len(self.elements),
            "exposed_elements": len(seen),
            "elements_with_returns": sum(e.measured.coverage > 0 for e in seen),
            "supporting": int(self.supported.sum()),
            "loa": self.options.loa,
            "coverage": self.whole.coverage,
            "facing_no_station": self.whole.turned_away,
            "missing": self.whole.missing,
            "point_spacing_m": self.whole.spacing,
            "noise_m": self.whole.noise,
            "registration_m": self.registration_sigma,
            "gsa_levels": {str(level): sum(e.gsa_level == level for e in seen) for level in range(5)},
        }
