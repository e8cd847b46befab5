"""How much of an element is where it was, after a shift."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..model.elements import BuildingModel
from .hypotheses import face_groups
from .thresholds import Thresholds

ABSENT_OVERLAP = Thresholds.absent_share
"""An element moved so far that no more than this of it overlaps its planned place has left that place."""


def overlap(model: BuildingModel, row: int, shift: NDArray[np.float64]) -> float:
    """Share of an element that overlaps itself after a shift [m]: what its extents along the shift and across its main faces
    leave of it, the least of them. Exact for boxes along their faces; a board that moves by its thickness, and a hair sideways,
    has left its place."""
    length = float(np.linalg.norm(shift))
    if length < 1e-9:
        return 1.0
    start = model.triangle_start
    corner = model.vertices[model.triangles[start[row] : start[row + 1]]]
    across = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    area = np.linalg.norm(across, axis=1)
    axes = np.vstack([shift / length, face_groups(across / np.maximum(area, 1e-12)[:, None], area)[1]])
    extent = np.ptp(corner.reshape(-1, 3) @ axes.T, axis=0)
    return max(float((1.0 - np.abs(axes @ shift) / np.maximum(extent, 1e-9)).min()), 0.0)
