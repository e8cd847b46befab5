"""What was found on a facade. Wall frame: x from its left to its right end as seen from the street, z up from its foot."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Kind = Literal["window", "door"]
Arrangement = Literal["separated", "connected"]
CornerSource = Literal["GIVEN", "LINES"]


@dataclass(frozen=True)
class FacadeBox:
    """One window or door, metres."""

    x0: float
    z0: float
    x1: float
    z1: float
    kind: Kind
    rise: float = 0.0
    """Of an arch above its springing line; 0: rectangular."""
    type: int = 0
    """Group of elements that are alike, numbered from 0."""
    inferred: bool = False
    """Set by the pattern of the others where plants hide it, not seen itself."""

    @property
    def width(self) -> float:
        """Metres."""
        return self.x1 - self.x0

    @property
    def height(self) -> float:
        """Metres."""
        return self.z1 - self.z0


@dataclass(frozen=True)
class Scale:
    """How pixels of the rectified picture became metres."""

    width: float
    height: float
    """Of the facade, metres."""
    source: str
    """WIDTH, HEIGHT, BOTH (given), or FLOORHEIGHT (given or typical)."""
    relative_sigma: float
    """Standard deviation of every length along the given direction, as a share of it."""
    aspect_sigma: float
    """Standard deviation of height / width, as a share of it."""


@dataclass
class Facade:
    """One wall with its openings."""

    image: str
    boxes: tuple[FacadeBox, ...]
    levels: tuple[float, ...]
    """Heights of the floors, the lowest first (0), metres."""
    scale: Scale
    arrangement_x: Arrangement
    arrangement_z: Arrangement
    corners: Array
    """(4, 2) of the facade in the image: left top, right top, right bottom, left bottom; pixels."""
    picture: NDArray[np.uint8]
    """(H, W, 3) RGB, rectified; its borders are those of the facade."""
    profile_x: Array = field(default_factory=lambda: np.zeros(0))
    """(W,) gradient summed along z, 0 to 1."""
    profile_z: Array = field(default_factory=lambda: np.zeros(0))
    """(H,) from the top."""
    vegetation: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((0, 0), dtype=np.bool_))
    """(H, W) of the rectified picture."""
    warnings: list[str] = field(default_factory=list)
    corner_source: CornerSource = "GIVEN"

    @property
    def pixels_per_metre(self) -> tuple[float, float]:
        """Of the rectified picture, across and up."""
        return self.picture.shape[1] / self.scale.width, self.picture.shape[0] / self.scale.height
