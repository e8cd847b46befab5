"""What was found of a wall between two epochs. Metres and radians, wall frame unless said otherwise."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

State = Literal["PAIRED", "NEW", "MISSING"]


@dataclass(frozen=True)
class JointDisplacement:
    """One horizontal joint of a column. Numbers that were not determined are None."""

    column: int
    state: State
    """NEW: only in the later epoch; MISSING: only in the base epoch (covered, filled or not seen)."""
    x: float
    """Middle of the column along the wall."""
    position: tuple[float, float, float]
    """Scan frame."""
    height: float
    """Of the joint's middle in the base epoch (the later one where it is new), scan frame."""
    vertical: float | None = None
    """Movement upwards; a settlement is negative."""
    vertical_sigma: float | None = None
    lateral: float | None = None
    """Movement out of the wall's face."""
    lateral_sigma: float | None = None
    opening: float | None = None
    """Change of the joint's width."""
    opening_sigma: float | None = None
    completeness_base: float = 0.0
    completeness_later: float = 0.0
    vertical_significant: bool | None = None
    lateral_significant: bool | None = None


@dataclass(frozen=True)
class Column:
    """One column of panels."""

    number: int
    """From 0, from the left as seen from in front of the wall."""
    low: float
    high: float
    """Along the wall."""
    joints: tuple[JointDisplacement, ...]
    profile_height: NDArray[np.float64]
    """(K,) scan frame."""
    profile_base: NDArray[np.float64]
    profile_later: NDArray[np.float64]
    """(K,) depth of the face, out of the wall positive; NaN where not seen."""
    vertical_probability: float | None = None
    """That the joints' vertical displacements come from measurement and registration alone; None: not determined."""
    lateral_probability: float | None = None

    @property
    def paired(self) -> tuple[JointDisplacement, ...]:
        """The joints that both epochs show."""
        return tuple(j for j in self.joints if j.state == "PAIRED")

    @property
    def may_be_a_panel_off(self) -> bool:
        """A joint is new below all that are paired and one is missing above them, or the other way round."""
        states = [j.state for j in self.joints]
        if "PAIRED" not in states:
            return False
        first = states.index("PAIRED")
        below, above = set(states[:first]), set(states[len(states) - states[::-1].index("PAIRED"):])
        return ("NEW" in below and "MISSING" in above) or ("MISSING" in below and "NEW" in above)

    def vertical_at(self, heights: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N,) vertical movement [m] at ``heights`` (N,) [m, scan frame], between joints by proportion; NaN: no joint tells."""
        known = [(j.height, j.vertical) for j in self.paired if j.vertical is not None]
        if not known:
            return np.full(len(heights), np.nan)
        z, moved = np.array(known, dtype=np.float64).T
        return np.asarray(np.interp(heights, z, moved))

    @property
    def bow(self) -> float | None:
        """Largest change of the face from a straight line between its ends [m], signed."""
        change = self.profile_later - self.profile_base
        good = np.isfinite(change)
        if good.sum() < 4:
            return None
        z, d = self.profile_height[good], change[good]
        chord = d[0] + (d[-1] - d[0]) * (z - z[0]) / (z[-1] - z[0])
        return float((d - chord)[np.argmax(np.abs(d - chord))])


@dataclass(frozen=True)
class DisplacementField:
    """Distances between the epochs along the face's normals (K, 3) at core points (K, 3) [m, scan frame]."""

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    distance: NDArray[np.float64]
    detection: NDArray[np.float64]
    """(K,) level of detection at 95 %."""
    count: NDArray[np.int64]
    """(K, 2) points used of the base and the later epoch."""
    column: NDArray[np.int64]
    """(K,) number of the column."""

    @property
    def significant(self) -> NDArray[np.bool_]:
        """(K,) the distance exceeds its level of detection."""
        return np.abs(self.distance) > self.detection


@dataclass(frozen=True)
class DisplacementResult:
    """All columns, the field, and what could not be determined."""

    columns: tuple[Column, ...]
    field: DisplacementField
    outward: tuple[float, float, float]
    """The wall's outward direction, scan frame."""
    area: float
    spacing: tuple[float, float]
    """Point spacing on the wall in the base and the later epoch."""
    registration_sigma: float
    base_paths: tuple[str, ...]
    later_paths: tuple[str, ...]
    base_date: str
    later_date: str
    warnings: tuple[str, ...] = ()
    timings: dict[str, float] = dataclasses.field(default_factory=dict)

    @property
    def joints(self) -> tuple[JointDisplacement, ...]:
        """Of all columns."""
        return tuple(j for c in self.columns for j in c.joints)
