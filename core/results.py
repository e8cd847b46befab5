"""What a verification found. Every face (console, report, property sets, Blender) reads these records and nothing else."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from .model.elements import BuildingModel
from .model.samples import SurfaceSamples
from .options import VerifyOptions

Status = Literal["CONFIRMED", "DEVIATING", "ABSENT", "PARTIAL", "NOTOBSERVED"]
STATUSES: tuple[Status, ...] = ("CONFIRMED", "DEVIATING", "ABSENT", "PARTIAL", "NOTOBSERVED")
LEVELS = (10, 20, 30, 40, 50)


@dataclass(frozen=True)
class ElementVerdict:
    """The verdict on one element. Lengths in metres, model frame."""

    global_id: str
    ifc_class: str
    name: str
    storey: str
    status: Status
    required_loa: str
    """``LOA30``"""
    achieved_loa: str
    """``LOA10`` ... ``LOA50`` or ``NONE``."""
    belief_occupied: float
    belief_empty: float
    belief_unknown: float
    conflict: float
    coverage: float
    confirmed_ratio: dict[int, float]
    """Share of the observed samples confirmed at each level, keys 10 ... 50."""
    sample_count: int
    observed_count: int
    area: float
    """m2 of exposed surface."""
    deviation_median: float | None
    """Signed along the outward normal; None where nothing was observed near the surface."""
    deviation_p95: float | None
    displacement: float | None
    """Length of the shift, metres; None where the scan determines no direction."""
    displacement_vector: tuple[float, float, float] | None
    displacement_sigma: float | None
    """One standard deviation along the shift."""
    significant: bool | None
    measurement_sigma: float
    registration_sigma: float
    reason: str
    """One or two sentences for a person: how this verdict came about, with the numbers that decided it."""
    stations: tuple[str, ...] = ()
    """Names of the stations whose returns are evidence on it."""


@dataclass(frozen=True)
class Decision:
    """A person's word over a verdict. The verdict itself stays as it was computed."""

    status: Status
    reason: str
    author: str
    date: str
    """ISO 8601, the day."""
    computed: str
    """The verdict that was overruled."""


@dataclass(frozen=True)
class SampleEvidence:
    """Per-sample evidence, aligned with ``SurfaceSamples``. NaN where nothing was measured."""

    m_occ: NDArray[np.float32]
    m_emp: NDArray[np.float32]
    m_unk: NDArray[np.float32]
    conflict: NDArray[np.float32]
    deviation: NDArray[np.float32]
    """(N,) metres, signed along the outward normal; NaN where no return lies near the surface."""
    sigma: NDArray[np.float32]
    """(N,) metres, of the deviation."""


@dataclass(frozen=True)
class AlignmentRecord:
    """How the scans were brought to the model."""

    mode: str
    transform: NDArray[np.float64]
    """(4, 4) scan frame to model frame, metres."""
    covariance: NDArray[np.float64] | None
    """(6, 6) of (rx, ry, rz [rad], tx, ty, tz [m]) about ``center``."""
    center: NDArray[np.float64] | None = None
    """(3,) model frame."""
    weakest_direction: str = ""
    rms: float | None = None
    inlier_ratio: float | None = None

    @property
    def axis_sigma(self) -> float:
        """Standard deviation of the place along one axis, metres; zero without alignment."""
        return 0.0 if self.covariance is None else float(np.sqrt(np.trace(self.covariance[3:, 3:]) / 3.0))


CAMERA_SENSOR = "camera"
"""Sensor of a station that is a photo."""


@dataclass(frozen=True)
class StationRecord:
    """What one station gave."""

    name: str
    position: tuple[float, float, float]
    """Metres, model frame."""
    returns: int
    spacing_rad: float
    """Median angle between neighbouring returns."""
    registration_sigma: float
    known: bool
    acquired: str = ""
    sensor: str = ""


@dataclass(frozen=True)
class ElementPhotos:
    """What photogrammetric points say of one element: the columns of table 7.7 of Meyer (2023). Lengths in metres."""

    global_id: str
    name: str
    queries: int
    tie_points: int
    tie_spacing: float | None
    """Mean distance to the nearest tie point."""
    tie_sigma: float | None
    """Mean standard deviation of the tie points along their rays."""
    tie_parameters: tuple[float, float, float] | None
    """kappa [1/m2], lambda [1/m], c at the mean sigma and spacing."""
    dense_points: int
    dense_spacing: float | None
    dense_sigma: float | None
    dense_parameters: tuple[float, float, float] | None
    confirmed: dict[int, float]
    """Share of the observed samples confirmed at LOA40, 30, 20."""


@dataclass(frozen=True)
class VerificationResult:
    """Everything that one verification found."""

    model: BuildingModel
    options: VerifyOptions
    verdicts: tuple[ElementVerdict, ...]
    """One per ``model.elements``, same order."""
    samples: SurfaceSamples
    evidence: SampleEvidence
    stations: tuple[StationRecord, ...]
    alignment: AlignmentRecord
    scan_paths: tuple[str, ...]
    scan_date: str
    method: str
    """Name and version of the method, as written to the property set."""
    dropped: dict[str, int] = field(default_factory=dict)
    timings: dict[str, float] = field(default_factory=dict)
    """Seconds per stage."""
    warnings: tuple[str, ...] = ()
    photos: tuple[ElementPhotos, ...] = ()
    """Elements with photogrammetric points; empty without such input."""
    decisions: dict[str, Decision] = field(default_factory=dict)
    """GlobalId -> what a person decided instead."""

    @property
    def photos_only(self) -> bool:
        """Whether all evidence comes from photos: stations are cameras, and nothing was scanned."""
        return bool(self.stations) and all(s.sensor == CAMERA_SENSOR for s in self.stations)

    def status_of(self, verdict: ElementVerdict) -> Status:
        """What holds for an element: a person's decision, else the computed verdict."""
        decision = self.decisions.get(verdict.global_id)
        return verdict.status if decision is None else decision.status

    def as_decided(self) -> VerificationResult:
        """The same result with every person's decision in the place of the computed status: what holds."""
        return replace(self, verdicts=tuple(replace(v, status=self.status_of(v)) for v in self.verdicts))

    def count(self, status: Status) -> int:
        """Number of elements with this computed status."""
        return sum(v.status == status for v in self.verdicts)

    def summary(self) -> dict[str, Any]:
        """Counts per computed status, how many of them a person overruled, and the observed share."""
        total = sum(v.area for v in self.verdicts)
        seen = sum(v.area * v.coverage for v in self.verdicts)
        return {
            "elements": len(self.verdicts),
            **{status: self.count(status) for status in STATUSES},
            "overruled": sum(v.global_id in self.decisions for v in self.verdicts),
            "coverage": seen / total if total else 0.0,
        }
