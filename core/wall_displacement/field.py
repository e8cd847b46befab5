"""The displacement between the joints: distances along the face's normal, each with its level of detection.

After M3C2 (Lague et al. 2013): at each core point the normal is that of the base epoch's face around it; points of both
epochs in a cylinder along it give two mean positions; their difference is significant beyond
1.96 (sqrt(s1^2 / n1 + s2^2 / n2) + registration sigma).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..progress import Progress
from .columns import trace_face
from .result import DisplacementField
from .wall import Wall

Array = NDArray[np.float64]
STEP_M = 0.25
LEAST_POINTS = 5
MOST_POINTS = 150_000


def displacement_field(
    wall: Wall, base: Array, later: Array, spacing: float, registration_sigma: float, origin: Array, progress: Progress
) -> DisplacementField:
    """Core points every 25 cm over the wall; ``base`` and ``later`` (N, 3) in the wall frame, recesses included."""
    radius = max(0.1, 2.5 * spacing)
    clouds = [c[:: max(1, len(c) // MOST_POINTS)] for c in (base, later)]
    trees = [cKDTree(c[:, [0, 2]]) for c in clouds]
    low, high = base[:, [0, 2]].min(axis=0), base[:, [0, 2]].max(axis=0)
    core = np.stack(np.meshgrid(*(np.arange(a + STEP_M / 2, b, STEP_M) for a, b in zip(low, high, strict=True)),
                                indexing="ij"), axis=-1).reshape(-1, 2)
    points, distances, detections, counts = [], [], [], []
    for k, place in enumerate(core):
        if k % 500 == 0:
            progress.update(k / len(core), "Displacement field")
        near = [_face_points(c[t.query_ball_point(place, radius)]) for c, t in zip(clouds, trees, strict=True)]
        if min(len(n) for n in near) < LEAST_POINTS:
            continue
        about = np.array([place[0], np.median(near[0][:, 1]), place[1]])
        design = np.column_stack([np.ones(len(near[0])), near[0][:, 0] - place[0], near[0][:, 2] - place[1]])
        plane = np.linalg.lstsq(design, near[0][:, 1], rcond=None)[0]
        normal = np.array([-plane[1], 1.0, -plane[2]])
        normal /= np.linalg.norm(normal)
        along = [(n - about) @ normal for n in near]
        error = np.sqrt(sum(float(np.var(a, ddof=1)) / len(a) for a in along))
        points.append([place[0], plane[0], place[1]])
        distances.append(float(np.mean(along[1]) - np.mean(along[0])))
        detections.append(1.96 * (error + registration_sigma))
        counts.append([len(a) for a in along])
    placed = wall.to_local(np.array(points).reshape(-1, 3)) + origin
    return DisplacementField(
        placed, np.array(distances), np.array(detections), np.array(counts, dtype=np.int64).reshape(-1, 2)
    )


def _face_points(points: Array) -> Array:
    """Without points more than 3 cm off the median: joints, and things before the wall."""
    if not len(points):
        return points
    return points[np.abs(points[:, 1] - np.median(points[:, 1])) < 0.03]


def face_profile(points: Array, heights: Array) -> Array:
    """(K,) depth of a column's face at ``heights`` [m]; NaN beyond its ends."""
    face = trace_face(points)
    return np.interp(heights, face.z, face.y, left=np.nan, right=np.nan)
