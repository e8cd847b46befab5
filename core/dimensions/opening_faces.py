"""The faces of a wall about its openings: where they were planned, and where they were found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..reconstruction.crossings import BAND_M
from ..results import VerificationResult
from .regions import Region

Array = NDArray[np.float64]
Rows = NDArray[np.int64]
Box = tuple[float, float, float, float]
"""Start, end, foot, head on a face [m]."""

NOISE_FACTOR = 4.0
AROUND_M = 0.4
"""So far around an opening its wall is looked at."""
LEAST_AROUND = 20
LEAST_OF_WALL = 0.6
"""Share of the upright places around an opening that lie on its wall's two faces; where it is less the wall is not plane."""
SAME_FACE_M = 0.005
LEVEL = np.sin(np.radians(5.0))
LEAST_PRISM = 0.99
"""Of the box about it that an opening fills."""
FLUSH_SHARE = 0.5
"""Share of the strip along an edge in which something lies on the wall's face, so that the edge does not show."""
RIM_M = 0.04


def face_band(sigma: float) -> float:
    """Half-width of the band about a face whose returns lie on it [m]; ``sigma`` is that of a return."""
    return max(BAND_M, NOISE_FACTOR * sigma)


@dataclass(frozen=True)
class OpeningFace:
    """One face of a wall about an opening. Local frame of the model, metres."""

    normal: Array
    """(2,) out of the wall."""
    offset: float
    """normal . (x, y) of the face as it was found."""
    along: Array
    """(2,) from start to end; the same for both faces."""
    reach: Box
    """What of the face is looked at."""


@dataclass(frozen=True)
class PlannedHole:
    """An opening of a plane wall that goes straight through it, as a rectangle on the wall's faces."""

    box: Box
    faces: tuple[OpeningFace, ...]
    """On which its edges are not covered."""
    thickness: float
    on_wall: bool
    """Whether there is wall below it."""


def planned_hole(opening: Region, host: int, fillings: Sequence[int], result: VerificationResult) -> PlannedHole | None:
    """None where the wall is not plane about the opening, or the opening is no upright box."""
    samples = result.samples
    first = samples.first_of(len(result.model.elements))
    own = np.arange(first[host], first[host + 1])
    upright = own[np.abs(samples.normal[own, 2]) < LEVEL]
    near = upright[opening.holds(samples.position[upright], AROUND_M)]
    around = near[~opening.holds(samples.position[near], SAME_FACE_M)]
    if len(around) < LEAST_AROUND:
        return None
    across = _across(samples.normal[around, :2])
    along = np.array([-across[1], across[0]])
    corners = np.concatenate([np.array(p.exterior.coords) for p in getattr(opening.outline, "geoms", [opening.outline])])
    u, deep = corners @ along, np.ptp(corners @ across)
    box = float(u.min()), float(u.max()), opening.low, opening.high
    if opening.volume < LEAST_PRISM * (box[1] - box[0]) * deep * (box[3] - box[2]):
        return None
    sides = [(s, around[samples.normal[around, :2] @ (s * across) > 1.0 - LEVEL**2]) for s in (1.0, -1.0)]
    offsets = [float(np.median(samples.position[rows, :2] @ across)) if len(rows) else None for _, rows in sides]
    lying = [
        rows[np.abs(samples.position[rows, :2] @ across - at) < SAME_FACE_M] if at is not None else rows
        for (_, rows), at in zip(sides, offsets, strict=True)
    ]
    if sum(map(len, lying)) < LEAST_OF_WALL * len(around):
        return None
    faces = []
    # what stands nearer to the face is not told from it
    not_told = face_band(result.options.sigma) + NOISE_FACTOR * result.options.sigma
    filled = np.concatenate([np.arange(0), *(np.arange(first[k], first[k + 1]) for k in fillings)])
    for (sign, _), rows, at in zip(sides, lying, offsets, strict=True):
        off = result.evidence.deviation[rows]
        off = off[np.isfinite(off)]
        if at is None or len(off) < LEAST_AROUND:
            continue
        by = float(np.median(off))
        flush = samples.position[filled]
        flush = flush[np.abs(flush[:, :2] @ across - at - sign * by) < not_told]
        if _covered(flush @ _on_face(along), box):
            continue
        places, z = samples.position[rows, :2] @ along, samples.position[rows, 2]
        reach = float(places.min()), float(places.max()), float(z.min()), float(z.max())
        faces.append(OpeningFace(sign * across, sign * at + by, along, reach))
    known = [at for at in offsets if at is not None]
    on_wall = bool((samples.position[around, 2] < opening.low - SAME_FACE_M).any())
    return PlannedHole(box, tuple(faces), float(np.ptp(known)) if len(known) > 1 else deep, on_wall)


def _across(normals: Array) -> Array:
    """(2,) the direction that most of (N, 2) normals have, whichever way they look."""
    angle = np.arctan2(normals[:, 1], normals[:, 0]) % np.pi
    number = np.round(angle / LEVEL).astype(np.int64) % round(np.pi / LEVEL)
    own = normals[number == np.bincount(number).argmax()]
    own = own * np.sign(own @ own[0])[:, None]
    return np.asarray(own.mean(axis=0) / np.linalg.norm(own.mean(axis=0)))


def _on_face(along: Array) -> Array:
    """(3, 2) from places to places on a face."""
    return np.array([[along[0], 0.0], [along[1], 0.0], [0.0, 1.0]])


def _covered(flush: Array, box: Box) -> bool:
    """Whether something at (N, 2) places on the wall's face lies along one of the upper three edges."""
    for k, edge in ((0, box[0]), (0, box[1]), (1, box[3])):
        low, high = box[2 - 2 * k : 4 - 2 * k]
        strip = np.abs(flush[:, k] - edge) < RIM_M
        if strip.any() and np.ptp(flush[strip, 1 - k]) > FLUSH_SHARE * (high - low):
            return True
    return False
