"""The plane faces of a model's elements as they were planned and as a verification measured them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..planes.derived import Estimate, distance_between
from ..planes.fit import Plane, fit_plane
from ..planes.noise import PointNoise
from ..planes.unevenness import Unevenness, with_unevenness
from ..results import VerificationResult
from .regions import Region
from .table import Dimension, width

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

BEFORE_FACE_M = 0.05
"""So far before a face lies what it bounds."""
LEVEL_COS = np.cos(np.radians(5.0))
LEAST_SAMPLES = 20
LEAST_SPAN_M = 0.05
"""A face is fixed against turning only if it was seen over this much in both directions."""
LEAST_OVERLAP_M = 0.02
OPPOSITE_COS = -np.cos(np.radians(5.0))
NORMAL_STEP, OFFSET_STEP_M = 0.01, 0.005
"""Planned places are of one face where their normals agree to this, and no step in offset is larger."""


@dataclass(frozen=True)
class Face:
    """A plane face of an element as it was planned and as it was measured. Local frame, metres."""

    element: int
    normal: Array
    """(3,) planned, outward."""
    place: Array
    """(3,) on the planned face."""
    plane: Plane
    points: Array
    """(N, 3) measured."""
    sigma: float
    """Of one sample's deviation, median [m]."""
    unevenness: Unevenness | None


def faces_of(result: VerificationResult, rows: Rows) -> list[Face]:
    """The planes that rows of the samples lie on, element by element."""
    if not len(rows):
        return []
    samples = result.samples
    normal = samples.normal[rows]
    offset = np.einsum("ij,ij->i", normal, samples.position[rows])
    key = np.column_stack([samples.element[rows], np.round(normal / NORMAL_STEP).astype(np.int64)])
    _, direction = np.unique(key, axis=0, return_inverse=True)
    direction = direction.ravel()
    order = np.lexsort((offset, direction))
    cut = (np.diff(direction[order]) != 0) | (np.diff(offset[order]) > OFFSET_STEP_M)
    parts = np.split(rows[order], np.flatnonzero(cut) + 1)
    return [face for part in parts if (face := _face(result, part)) is not None]


def _face(result: VerificationResult, rows: Rows) -> Face | None:
    if len(rows) < LEAST_SAMPLES:
        return None
    samples, evidence = result.samples, result.evidence
    normal = samples.normal[rows].mean(axis=0)
    normal /= np.linalg.norm(normal)
    place = samples.position[rows]
    heights = place + evidence.deviation[rows, None].astype(np.float64) * samples.normal[rows]
    sigma = float(np.nanmedian(evidence.sigma[rows]))
    if not np.isfinite(sigma):
        return None
    points = _merged(heights, normal, _spacing(result, place.mean(axis=0), normal))
    try:
        # a sample's error lies along the normal: as if it were seen from straight before the face
        plane = fit_plane(points, points + normal, PointNoise(max(sigma, 1e-6), 0.0, 0.0))
    except BimVerifyError:
        return None
    if min(np.ptp((heights - plane.centroid) @ plane.axes.T, axis=0)) < LEAST_SPAN_M or abs(plane.normal @ normal) < 0.9:
        return None
    plane, bumps = with_unevenness(plane, points)
    plane = plane.facing(plane.centroid + normal)
    return Face(int(samples.element[rows[0]]), normal, place.mean(axis=0), plane, heights, sigma, bumps)


def _spacing(result: VerificationResult, place: Array, normal: Array) -> float:
    """Between returns of the station that sees a face best [m]: root of the area that one stands for."""
    best = 0.0
    for station in result.stations:
        ray = np.asarray(station.position) - result.model.origin - place
        distance = float(np.linalg.norm(ray))
        cosine = float(ray @ normal) / max(distance, 1e-9)
        if cosine > 0 and np.isfinite(station.spacing_rad) and station.spacing_rad > 0:
            best = max(best, cosine / (distance * station.spacing_rad) ** 2)
    return float(best**-0.5) if best > 0 else 0.0


def _merged(points: Array, normal: Array, spacing: float) -> Array:
    """Samples nearer to each other than returns share these: they are one, at their mean."""
    if spacing <= 0.0:
        return points
    axes = np.linalg.svd(normal[None])[2][1:]
    cell = np.floor((points - points.min(axis=0)) @ axes.T / spacing + 1e-9).astype(np.int64)
    _, index = np.unique(cell, axis=0, return_inverse=True)
    index = index.ravel()
    return np.column_stack([np.bincount(index, p) for p in points.T]) / np.bincount(index)[:, None]


def widths(region: Region, faces: list[Face], names: Sequence[str], shared: float) -> Iterator[Dimension]:
    """Between all faces that look at each other; ``shared`` [m]: of the two stations' places."""
    for i, a in enumerate(faces):
        for b in faces[i + 1 :]:
            if a.normal @ b.normal > OPPOSITE_COS:
                continue
            planned = float((b.place - a.place) @ a.normal)
            place = overlap(a, b)
            if planned <= 0.0 or place is None:
                continue
            found = distance_between(a.plane, b.plane, place)
            found = Estimate(found.value, float(np.hypot(found.sigma, shared)))
            between = (names[a.element], names[b.element]) if a.element != b.element else (names[a.element],)
            what = "height" if abs(a.normal[2]) > 0.5 else "width"
            yield width(region.name, region.global_id, what, between, found, planned)


def overlap(a: Face, b: Face) -> Array | None:
    """(3,) middle of where two faces look at each other; None where they do not."""
    axes = a.plane.axes
    first, second = a.points @ axes.T, b.points @ axes.T
    low = np.maximum(first.min(axis=0), second.min(axis=0))
    high = np.minimum(first.max(axis=0), second.max(axis=0))
    if (high - low).min() < LEAST_OVERLAP_M:
        return None
    across = 0.5 * float((a.plane.centroid + b.plane.centroid) @ a.plane.normal)
    return np.asarray(0.5 * (low + high) @ axes + across * a.plane.normal)
