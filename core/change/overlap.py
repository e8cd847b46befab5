"""How much of an element is where it was, after a shift."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..evidence.thresholds import Thresholds
from ..model.elements import BuildingModel

ABSENT_OVERLAP = Thresholds.absent_share
"""An element moved so far that no more than this of it overlaps its planned place has left that place."""


def overlap(model: BuildingModel, row: int, shift: NDArray[np.float64]) -> float:
    """Share of an element's extent along a shift [m] that overlaps itself after the shift: exact for prisms along it."""
    length = float(np.linalg.norm(shift))
    if length < 1e-9:
        return 1.0
    start = model.triangle_start
    corner = model.vertices[model.triangles[start[row] : start[row + 1]]].reshape(-1, 3)
    extent = float(np.ptp(corner @ (shift / length)))
    return max(1.0 - length / max(extent, 1e-9), 0.0)
