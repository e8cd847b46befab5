"""What a comparison found. Every face (console, report, property sets, Blender) reads these records."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..options import ChangeOptions
from .planned import Planned

if TYPE_CHECKING:
    from ..model.elements import BuildingModel
    from ..results import AlignmentRecord
    from .voxels import VoxelCloud

State = Literal["CONFIRMED", "NEW", "DISAPPEARED", "PARTIAL", "UNKNOWN"]
UNKNOWN, CONFIRMED, NEW, DISAPPEARED, NOTHING = 0, 1, 2, 3, 255
"""States of voxels, as in the PLY file; NOTHING marks voxels that are no part of the result."""
STATES: tuple[State, ...] = ("CONFIRMED", "NEW", "DISAPPEARED", "PARTIAL", "UNKNOWN")
Persistence = Literal["stays", "temporary", "unknown"]
Progressing = Literal["on time", "early", "late", "not built", "should be gone", "cannot tell"]
PROGRESS: tuple[Progressing, ...] = ("on time", "early", "late", "not built", "should be gone", "cannot tell")


@dataclass(frozen=True)
class ElementChange:
    """What became of one element. Ratios are shares of its planned volume and add up to 1; volumes in m3.

    Against a reference: confirmed stood and stands, disappeared stood and does not, new stands and did not; unknown is the
    rest, so also what stands in neither epoch.
    """

    global_id: str
    ifc_class: str
    name: str
    storey: str
    state: State
    confirmed_ratio: float
    disappeared_ratio: float
    new_ratio: float
    unknown_ratio: float
    volume: float
    """Planned, from its solid."""
    disappeared_volume: float
    built_volume: float
    """Stands now: confirmed and new."""
    shift: float | None
    """Metres from the planned place (from the reference epoch's, where there is one); None where nothing fixes it."""
    expected: State
    agrees: bool | None
    """Whether what stands now is what was expected; None when that was not decided, or nothing was expected."""
    progress: Progressing
    reason: str
    moved: bool = False
    """It stands, but not where it was planned."""
    standing_ratio: float | None = None
    """Share of it that stands now at its planned place, as far as it was seen: what was not seen is taken to be like what was.
    None where that was not decided."""


@dataclass(frozen=True)
class Cluster:
    """New or gone voxels of one planned element, or connected ones outside elements. Metres, model frame."""

    kind: Literal["NEW", "DISAPPEARED"]
    voxels: int
    volume: float
    """m3: of the element's solid, the part that these voxels are; else of the voxels: only those that beams met are known."""
    center: tuple[float, float, float]
    size: tuple[float, float, float]
    element: str
    """GlobalId of that element, or of the nearest one."""
    distance: float
    """To that element's box; 0 inside."""
    inside: bool
    """It is what is new or gone of that planned element."""
    persistence: Persistence
    """Whether it lasts, as far as the other epochs but the reference tell: see ``clusters.persistence``."""
    epochs: tuple[str, ...] = ()
    """Names of the epochs that saw something there."""


@dataclass(frozen=True)
class CommonShift:
    """How a whole visit lies against the model, or against another visit. Metres and radians, model frame."""

    shift: tuple[float, float, float]
    """Of the middle of the elements that tell, in the directions that they fix; zero in the others."""
    turn: tuple[float, float, float] | None
    """Rotation vector about that middle; None where the fits show none."""
    sigma: float
    """Standard deviation of ``shift`` along itself."""
    elements: int
    """How many agree on it."""
    fixed: tuple[bool, bool, bool]
    """Whether they fix it along x, y and z."""
    significant: bool
    """Whether it differs from none at 95 %."""
    axis_sigma: float
    """Standard deviation along one axis that errors of this size have, turn counted."""

    @property
    def length(self) -> float:
        """Metres, of the shift."""
        return math.sqrt(sum(v * v for v in self.shift))

    @property
    def degrees(self) -> float:
        """Of the turn; zero where none shows."""
        return math.degrees(math.hypot(*(self.turn or (0.0,))))

    def in_words(self) -> str:
        """``12.1 mm (9.0, -7.0, 4.0)``, with the turn in degrees; ? along axes that are not fixed."""
        along = (f"{1000 * v:z.1f}" if known else "?" for v, known in zip(self.shift, self.fixed, strict=True))
        turn = "" if self.turn is None else f", turned by {self.degrees:.3f} degrees"
        return f"{1000 * self.length:.1f} mm ({', '.join(along)}){turn}"

    @property
    def reach(self) -> float:
        """Metres that the elements are off by, turn counted (root mean square); zero where it is not significant."""
        return math.sqrt(3.0) * self.axis_sigma if self.significant else 0.0


@dataclass(frozen=True)
class EpochRecord:
    """One epoch: its scans, and what it says of all elements."""

    name: str
    paths: tuple[str, ...]
    date: str
    stations: int
    returns: int
    occupied: int
    """Voxels."""
    sparse: int
    """Of these, occupied with fewer returns than the threshold, because the scan is sparse there."""
    registration_sigma: float
    states: tuple[State, ...]
    """One per element, against the model."""
    offset: CommonShift | None
    """What its elements are off by together against the model; None where too few tell."""
    found_ratio: float | None
    """Share that was found of the elements in view; None where none was."""
    alignment: AlignmentRecord
    """How its scans were brought to the model."""
    progress: tuple[GroupProgress, ...] = ()
    """As of its own day."""


@dataclass(frozen=True)
class VoxelCounts:
    """Voxels by state between two epochs, or an epoch and the model; only those that some epoch saw."""

    epoch: str
    against: str
    """Name of the epoch before, or ``model``."""
    confirmed: int
    new: int
    disappeared: int
    unknown: int

    @property
    def total(self) -> int:
        return self.confirmed + self.new + self.disappeared + self.unknown


@dataclass(frozen=True)
class GroupProgress:
    """Progress of a storey, a class or a task. Shares of planned volume."""

    kind: Literal["storey", "class", "task"]
    name: str
    elements: int
    complete: float | None
    """Work done (built, left, or demolished, as planned), of the elements that were decided; None when none was."""
    planned: float | None
    """Work that should be done at the scan's date, of what was decided and has a plan; None when nothing has."""
    not_observed: float
    """Share of the planned volume of which no surface was found and through which no ray passed."""


@dataclass(frozen=True)
class ChangeResult:
    """Everything that one comparison found."""

    model: BuildingModel
    options: ChangeOptions
    edge: float
    """Metres; larger than asked for where memory demands it."""
    elements: tuple[ElementChange, ...]
    """One per ``model.elements``, same order."""
    epochs: tuple[EpochRecord, ...]
    """In order; the last one is what elements are reported for."""
    reference: EpochRecord | None
    planned: tuple[Planned, ...]
    clusters: tuple[Cluster, ...]
    """Largest first."""
    clusters_left_out: int
    """Smaller ones that are not listed; a warning says so, too."""
    groups: tuple[GroupProgress, ...]
    voxels: VoxelCloud
    voxel_counts: tuple[VoxelCounts, ...]
    """The comparison itself first, then each epoch with the one before, the last with the first, and each with the model."""
    anchor: tuple[float, float, float]
    """Corner of voxel (0, 0, 0), metres, model frame."""
    remaining: tuple[int, ...]
    """Rows of elements of which a part does not stand now."""
    surfaces: Mapping[int, NDArray[np.int64]]
    """Planned voxels (N, 3) of those of these that are kept by their surface, because they are thin or open."""
    method: str
    offset_from_reference: CommonShift | None = None
    """What the elements of the last epoch are off by together against the reference."""
    timings: dict[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    @property
    def epoch(self) -> EpochRecord:
        return self.epochs[-1]

    def count(self, state: State) -> int:
        """Number of elements in this state."""
        return sum(e.state == state for e in self.elements)

    @property
    def series(self) -> tuple[EpochRecord, ...]:
        """All epochs in order of time, the reference first."""
        return (*([self.reference] if self.reference else []), *self.epochs)

    def places(self) -> str:
        """How the epochs lie against the model, and the last against the reference, in one sentence; empty if nothing tells."""
        told = [f"the {e.name} {e.offset.in_words()} from the model" for e in self.series if e.offset]
        if self.offset_from_reference:
            told.append(f"the {self.epoch.name} {self.offset_from_reference.in_words()} from the reference")
        return f"Common shift: {', '.join(told)}." if told else ""

    def summary(self) -> dict[str, Any]:
        """Counts per state and the volumes, for a one-line answer."""
        return {
            "elements": len(self.elements),
            **{s: self.count(s) for s in STATES},
            "disappeared_volume": sum(e.disappeared_volume for e in self.elements),
            "built_volume": sum(e.built_volume for e in self.elements),
        }
