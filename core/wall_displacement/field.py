"""The displacement between the joints: distances along the face's normal, each with its level of detection (M3C2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..imagery.m3c2 import m3c2
from .columns import Face
from .measure import LARGEST_MOVE_M, ColumnPoints
from .result import DisplacementField

Array = NDArray[np.float64]
STEP_M = 0.1
LEAST_POINTS = 5
SLOPE_REACH_M = 0.3
"""The normal at a height is that of the base epoch's face over so much above and below."""
NOTHING = DisplacementField(
    np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros((0, 2), np.int64), np.zeros(0, np.int64)
)


def column_field(
    number: int, base: ColumnPoints, later: ColumnPoints, spacing: float, registration_sigma: float
) -> DisplacementField:
    """Core points every 10 cm over one column, column frame; the joints themselves are left out."""
    faces = [e.points[np.abs(e.face.residual) < max(e.face.threshold, 3 * e.face.noise)] for e in (base, later)]
    if min(len(f) for f in faces) < LEAST_POINTS:
        return NOTHING
    low, high = faces[0].min(axis=0), faces[0].max(axis=0)
    x, z = (_middles(low[k], high[k]) for k in (0, 2))
    xs, zs = (a.ravel() for a in np.meshgrid(x, z, indexing="ij"))
    core = np.column_stack([xs, np.interp(zs, base.face.z, base.face.y), zs])
    slope = _slope(base.face, zs)
    normal = np.column_stack([np.zeros(len(zs)), np.ones(len(zs)), -slope]) / np.sqrt(1 + slope**2)[:, None]
    radius = max(STEP_M, 2.5 * spacing)
    found = m3c2(core, normal, *faces, radius=radius, reach=1.5 * LARGEST_MOVE_M, registration=registration_sigma)
    kept = np.isfinite(found.distance) & (found.count >= LEAST_POINTS).all(axis=1)
    return DisplacementField(
        core[kept], normal[kept], found.distance[kept], found.level[kept], found.count[kept],
        np.full(int(kept.sum()), number, np.int64),
    )


def joined(fields: list[DisplacementField]) -> DisplacementField:
    """The fields of all columns as one."""
    all_of = [NOTHING, *fields]
    return DisplacementField(
        np.concatenate([f.points for f in all_of]), np.concatenate([f.normals for f in all_of]),
        np.concatenate([f.distance for f in all_of]), np.concatenate([f.detection for f in all_of]),
        np.concatenate([f.count for f in all_of]), np.concatenate([f.column for f in all_of]),
    )


def face_profile(face: Face, heights: Array) -> Array:
    """(K,) depth of a column's face at ``heights`` [m]; NaN beyond its ends and where 30 cm of it were not seen."""
    depth = np.interp(heights, face.z, face.y, left=np.nan, right=np.nan)
    away = np.abs(heights[:, None] - face.z[None, :]).min(axis=1)
    return np.where(away < SLOPE_REACH_M, depth, np.nan)


def _middles(low: float, high: float) -> Array:
    count = max(int((high - low) / STEP_M), 1)
    return np.asarray(0.5 * (low + high) + STEP_M * (np.arange(count) - 0.5 * (count - 1)))


def _slope(face: Face, heights: Array) -> Array:
    """(N,) change of depth with height."""
    if len(face.z) < 2:
        return np.zeros(len(heights))
    ends = [np.clip(heights + s * SLOPE_REACH_M, face.z[0], face.z[-1]) for s in (-1.0, 1.0)]
    depth = [np.interp(e, face.z, face.y) for e in ends]
    return np.asarray((depth[1] - depth[0]) / np.maximum(ends[1] - ends[0], 0.05))
