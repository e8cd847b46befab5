"""What a reconstruction found: plain records, local frame (scan frame minus ``origin``), metres."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon

from ..planes.conformity import Conformity
from ..planes.fit import Plane
from ..planes.stations import EXACT, Poses
from ..planes.unevenness import Unevenness
from .joins import Join
from .openings import Opening
from .slab_holes import SlabHole
from .steps import Step

Array = NDArray[np.float64]

MEASURED, REVEAL, ASSUMED = "MEASURED", "REVEAL", "ASSUMED"
SEEN = "SEEN"
"""Of a height: floor and ceiling were seen, but not fitted both."""
EDGES = "EDGES"
"""Of a column with a hidden side: its thickness follows from where the faces beside it end."""


@dataclass(frozen=True)
class FitRecord:
    """How well an element is known; written as ``BimVerify_Reconstruction``."""

    fit_mean: float | None
    """Mean absolute distance of its returns from its faces, metres."""
    fit_sigma: float | None
    quality: float
    """Share of its surface that was seen, 0..1."""
    position_sigma: float | None
    """Standard deviation of its place (a wall's axis, a slab's surface), metres."""
    thickness_source: str
    returns: int = 0


@dataclass(frozen=True)
class FittedFace:
    """A face of a wall, a floor or a ceiling as it was measured."""

    plane: Plane
    """Its normal turned to those who saw it."""
    unevenness: Unevenness | None = None
    flatness: tuple[Conformity, ...] = ()
    """Tests for the distances of the measuring points that fit on it."""


@dataclass(frozen=True)
class RoomFace:
    """What a room shows of a wall's face."""

    wall: int
    """Row of the storey's walls."""
    face: FittedFace
    ends: tuple[Array, Array]
    """Places in plan (2,) between which it was seen [m]."""


@dataclass(frozen=True)
class BuiltWall:
    """A wall with parallel faces."""

    start: Array
    end: Array
    """(2,) of the axis."""
    thickness: float
    footprint: Polygon
    base: float
    top: float
    openings: tuple[Opening, ...]
    """Places along the axis from ``start``."""
    joins: tuple[Join | None, Join | None]
    rooms: tuple[int, ...]
    external: bool | None
    """Its other side is the outside; None where nothing tells what is there."""
    fit: FitRecord
    height_source: str = ""
    """MEASURED between fitted floors and ceilings of all its rooms, SEEN, or ASSUMED where no ceiling was seen; or empty."""
    lean: float = 0.0
    """Of its faces from the vertical, rad."""
    lean_sigma: float = 0.0
    faces: tuple[FittedFace, ...] = ()
    step: Step | None = None
    """What lies flat before or behind the rest of one of its faces."""

    @property
    def length(self) -> float:
        """Metres."""
        return float(np.linalg.norm(self.end - self.start))

    @property
    def along(self) -> Array:
        """(2,) unit vector."""
        return np.asarray((self.end - self.start) / max(self.length, 1e-9))


@dataclass(frozen=True)
class BuiltColumn:
    """A column from floor to ceiling."""

    footprint: Polygon
    radius: float
    base: float
    top: float
    fit: FitRecord
    hidden: tuple[str, ...] = ()
    """Sides that no scanner saw (``column_fit.SIDES``)."""
    on: float = 1.0
    """Share of the returns about it that lie on its outline."""
    height_source: str = ""
    """As of a wall."""


@dataclass(frozen=True)
class BuiltSlab:
    """A level slab."""

    footprint: Polygon
    top: float
    thickness: float
    kind: str
    """FLOOR, BASESLAB or ROOF."""
    fit: FitRecord
    holes: tuple[SlabHole, ...] = ()


@dataclass(frozen=True)
class BuiltRoom:
    """A room."""

    outline: Polygon
    floor: float
    ceiling: float
    floor_face: FittedFace | None = None
    ceiling_face: FittedFace | None = None
    wall_faces: tuple[RoomFace, ...] = ()
    height_source: str = ""
    """As of a wall."""


@dataclass(frozen=True)
class BuiltStorey:
    """One storey."""

    name: str
    floor: float
    ceiling: float
    walls: tuple[BuiltWall, ...]
    columns: tuple[BuiltColumn, ...]
    slabs: tuple[BuiltSlab, ...]
    rooms: tuple[BuiltRoom, ...]

    @property
    def slab_holes(self) -> list[SlabHole]:
        """Of all its slabs, in their order."""
        return [hole for slab in self.slabs for hole in slab.holes]


@dataclass
class Reconstruction:
    """A whole building."""

    origin: Array
    storeys: tuple[BuiltStorey, ...]
    returns: int
    stations: int
    scan_paths: tuple[str, ...]
    poses: Poses = EXACT
    """What the stations' poses were taken to be off by."""
    timings: dict[str, float] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    def count(self, what: str) -> int:
        """Number of walls, columns, slabs or rooms."""
        return sum(len(getattr(s, what)) for s in self.storeys)

    @property
    def openings(self) -> int:
        """Number of openings."""
        return sum(len(w.openings) for s in self.storeys for w in s.walls)


@dataclass(frozen=True)
class StoreyIds:
    """GlobalIds of what was written of a storey, in the order of its rooms, walls, their openings, columns, holes of slabs."""

    rooms: tuple[str, ...] = ()
    walls: tuple[str, ...] = ()
    openings: tuple[tuple[str, ...], ...] = ()
    columns: tuple[str, ...] = ()
    slab_openings: tuple[str, ...] = ()

    def room(self, k: int) -> str:
        """Empty where nothing was written."""
        return self.rooms[k] if self.rooms else ""

    def opening(self, wall: int, k: int) -> str:
        """Empty where nothing was written."""
        return self.openings[wall][k] if self.openings else ""


NO_IDS = StoreyIds()
"""Of a storey that was not written."""
