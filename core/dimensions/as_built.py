"""As-built dimensions of the rooms and openings of a model, from the deviations of its faces that a verification measured."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..planes.cloud import Cloud
from ..planes.conformity import flatness, orthogonality, parallelism, plumb
from ..planes.derived import Estimate, distance_between
from ..planes.fit import Plane, fit_plane
from ..planes.noise import PointNoise
from ..planes.unevenness import Unevenness, with_unevenness
from ..results import VerificationResult
from .corners import Bound, Room, corner_rows
from .opening_edges import hole_on_face, scanner_rays
from .opening_faces import planned_hole
from .opening_sides import NO_SCANS, ROLES, at_the_face, in_the_frame, why_not
from .regions import Region, read_regions
from .table import Dimension, conformity, unmeasured, width

Array = NDArray[np.float64]
Rows = NDArray[np.int64]
Flags = NDArray[np.bool_]

BOUNDING = ("IfcWall", "IfcSlab", "IfcRoof", "IfcCovering", "IfcCurtainWall", "IfcColumn")
"""Classes (and what derives from their names) whose faces bound a room."""
BEFORE_FACE_M = 0.05
"""So far before a face lies the room that it bounds."""
BESIDE_OPENING_M = 0.01
FLOORS = ("IfcSlab", "IfcCovering")
FLOOR_M = 0.05
"""A level surface this close to an opening's lower end is the floor under it."""
LEAST_SAMPLES = 20
LEAST_SPAN_M = 0.05
"""A face is fixed against turning only if it was seen over this much in both directions."""
LEAST_OVERLAP_M = 0.02
OPPOSITE_COS = -np.cos(np.radians(5.0))
SQUARE_COS = np.sin(np.radians(5.0))
LEVEL_COS = np.cos(np.radians(5.0))
UPRIGHT = np.sin(np.radians(5.0))
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


def as_built_dimensions(
    result: VerificationResult, source: str | Path | None = None, cloud: Cloud | None = None
) -> list[Dimension]:
    """Clear widths and heights of every space and opening of the model's file; of the spaces also vertices, edges, slopes,
    unevenness and tests of their faces.

    ``source``: the file, where it is another than ``result.model.path``; ``cloud``: the returns that were verified with, in
    the model's frame, for the edges of openings. Only faces and edges that were seen are used. Raises BimVerifyError when the
    file cannot be read.
    """
    spaces, openings = read_regions(source or result.model.path, result.model.origin)
    names = [e.name or e.global_id for e in result.model.elements]
    rows: list[Dimension] = []
    bounds = np.array([e.ifc_class.startswith(BOUNDING) for e in result.model.elements], dtype=np.bool_)
    position, normal = result.samples.position, result.samples.normal
    measured = np.isfinite(result.evidence.deviation) & result.samples.exposed
    shared = _registration(result)
    before = position + BEFORE_FACE_M * normal
    for space in spaces:
        chosen = np.flatnonzero(measured & bounds[result.samples.element])
        chosen = chosen[space.holds(before[chosen])]
        faces = _faces(result, chosen)
        rows += _room(space, faces, names, shared)
        rows += corner_rows(_bounded(space, faces, names, result.model.origin, shared / np.sqrt(2.0)))
    rays = None if cloud is None else scanner_rays(cloud, result)
    for opening in openings:
        rows += _opening(opening, result, names, measured, shared, rays)
    return rows


def _opening(
    opening: Region, result: VerificationResult, names: Sequence[str], measured: Flags, shared: float, rays: Cloud | None
) -> list[Dimension]:
    """Clear width and height: between reveals, lintel and sill or the floor below; between its edges on the wall's faces;
    where neither tells, between the inner faces of what stands in it; else a row that says why not.
    """
    elements, samples = result.model.elements, result.samples
    row_of = {e.global_id: k for k, e in enumerate(elements)}
    if (host := row_of.get(opening.host)) is None:
        return []
    first = samples.first_of(len(names))
    own = np.arange(first[host], first[host + 1])
    own = own[opening.holds(samples.position[own], BESIDE_OPENING_M)]
    own = own[opening.holds(samples.position[own] + BEFORE_FACE_M * samples.normal[own])]
    level = np.flatnonzero((samples.normal[:, 2] > LEVEL_COS) & (np.abs(samples.position[:, 2] - opening.low) < FLOOR_M))
    level = level[opening.holds(samples.position[level], FLOOR_M)]
    below = level[[elements[k].ifc_class.startswith(FLOORS) and k != host for k in samples.element[level]]]
    sides = np.concatenate([own, below])
    fillings = [row_of[g] for g in opening.fillings if g in row_of]
    frame = np.concatenate([below, *(np.arange(first[k], first[k + 1]) for k in fillings)])
    found = list(_widths(opening, _faces(result, sides[measured[sides]]), names, shared))
    # posts between the inner faces of a frame are within the widest pair
    inner = {
        r.what: r for r in sorted(
            _widths(opening, _faces(result, frame[measured[frame]]), names, shared), key=lambda r: r.planned or 0.0
        )
    }  # fmt: skip
    edged = _between_edges(opening, host, fillings, _faces(result, below[measured[below]]), result, names, rays)
    rows = []
    for what in ROLES:
        clear = [r for r in found if r.what == what] + [r for r in edged if r.what == at_the_face(what)]
        if not clear and what in inner:
            clear = [replace(inner[what], what=in_the_frame(what))]
        if not clear and elements[host].ifc_class.startswith("IfcWall"):
            reason = why_not(what, samples.normal[sides], samples.exposed[sides], measured[sides], [names[k] for k in fillings])
            if rays is None and not result.photos_only:
                reason += f"; {NO_SCANS}"
            clear = [unmeasured(opening.name, opening.global_id, what, (names[host],), reason)]
        rows += [replace(r, opening=True) for r in clear]
    return rows


def _between_edges(
    opening: Region, host: int, fillings: Sequence[int], floor: Sequence[Face], result: VerificationResult,
    names: Sequence[str], rays: Cloud | None,
) -> Iterator[Dimension]:
    """From edge to edge on the wall's face; upwards from the floor where that bounds the opening."""
    hole = None if rays is None else planned_hole(opening, host, fillings, result)
    sigma = max((s.registration_sigma for s in result.stations), default=0.0)
    found = None if hole is None or rays is None else hole_on_face(hole, rays, result.options.sigma, sigma)
    if hole is None or found is None:
        return
    name, start, end = opening.name, hole.box[0], hole.box[1]
    own: tuple[str, ...] = (names[host],)
    if (wide := found.distance("start", "end")) is not None:
        yield width(name, opening.global_id, at_the_face("width"), own, wide, end - start)
    high, planned = found.distance("sill", "head") if hole.on_wall else None, opening.high - opening.low
    if floor:
        face, head = max(floor, key=lambda f: len(f.points)), found.place("head")
        own, high, planned = (names[face.element], names[host]), None, opening.high - float(face.place[2])
        if head is not None:
            under = np.array([[opening.outline.centroid.x, opening.outline.centroid.y, opening.low]])
            level = opening.low - float(face.plane.distance(under)[0]) / float(face.plane.normal[2])
            spread = np.hypot(float(face.plane.sigma_at(under)[0]), sigma)
            high = Estimate(head.value - level, float(np.hypot(head.sigma, spread)))
    if high is not None:
        yield width(name, opening.global_id, at_the_face("height"), own, high, planned)


def opening_shares(rows: Sequence[Dimension]) -> str:
    """In a line: of how many openings the width and the height were measured."""
    told = []
    for what in ROLES:
        own = [r for r in rows if r.opening and r.what.startswith(what)]
        measured = {r.global_id for r in own if r.value is not None}
        framed, edged = (sum(r.what == other for r in own) for other in (in_the_frame(what), at_the_face(what)))
        told.append(
            f"{what}s of {len(measured)} of {len({r.global_id for r in own})} openings ({edged} between edges on the wall's "
            f"face, {framed} within a frame)"
        )
    return f"Measured: {', '.join(told)}; the others have a line that says why not."


def _registration(result: VerificationResult) -> float:
    """Of two faces that different stations saw, as those of an opening mostly are [m]."""
    if len(result.stations) < 2:
        return 0.0
    return float(np.sqrt(2.0)) * max(s.registration_sigma for s in result.stations)


def _faces(result: VerificationResult, rows: Rows) -> list[Face]:
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


def _bounded(space: Region, faces: list[Face], names: Sequence[str], origin: Array, registration: float) -> Room:
    walls = [_bound(f, names) for f in faces if abs(f.normal[2]) < UPRIGHT]
    floor, ceiling = (_level_bound([f for f in faces if side * f.normal[2] > LEVEL_COS], names) for side in (1.0, -1.0))
    return Room(space.name, space.global_id, space.outline, walls, floor, ceiling, origin, registration)


def _level_bound(faces: list[Face], names: Sequence[str]) -> Bound | None:
    return _bound(max(faces, key=lambda f: len(f.points)), names) if faces else None


def _bound(face: Face, names: Sequence[str]) -> Bound:
    ends = None
    if abs(face.normal[2]) < UPRIGHT:
        level = np.array([-face.normal[1], face.normal[0]])
        along = face.points[:, :2] @ level
        ends = (face.points[int(along.argmin()), :2], face.points[int(along.argmax()), :2])
    return Bound(names[face.element], face.plane, face.unevenness, ends, (face.normal, face.place))


def _room(space: Region, faces: list[Face], names: Sequence[str], shared: float) -> Iterator[Dimension]:
    yield from _widths(space, faces, names, shared)
    upright = [f for f in faces if abs(f.normal[2]) < UPRIGHT]
    for face in faces:
        between = (names[face.element],)
        if abs(face.normal[2]) < UPRIGHT:
            tall = float(np.ptp(face.points[:, 2]))
            yield conformity(space.name, space.global_id, between, plumb(face.plane, tall))
        kind = "finished floor" if face.normal[2] > 0.9 else "finished wall"
        for test in flatness(face.plane, face.points, kind, shared_sigma=face.sigma):
            yield conformity(space.name, space.global_id, between, test)
    for i, a in enumerate(upright):
        for b in upright[i + 1 :]:
            cosine = float(a.normal @ b.normal)
            both = (names[a.element], names[b.element])
            length = min(_length(a), _length(b))
            if abs(cosine) > -OPPOSITE_COS and _overlap(a, b) is not None:
                yield conformity(space.name, space.global_id, both, parallelism(a.plane, b.plane, length))
            elif abs(cosine) < SQUARE_COS:
                yield conformity(space.name, space.global_id, both, orthogonality(a.plane, b.plane, length))


def _widths(
    region: Region, faces: list[Face], names: Sequence[str], shared: float
) -> Iterator[Dimension]:
    for i, a in enumerate(faces):
        for b in faces[i + 1 :]:
            if a.normal @ b.normal > OPPOSITE_COS:
                continue
            planned = float((b.place - a.place) @ a.normal)
            place = _overlap(a, b)
            if planned <= 0.0 or place is None:
                continue
            found = distance_between(a.plane, b.plane, place)
            found = Estimate(found.value, float(np.hypot(found.sigma, shared)))
            between = (names[a.element], names[b.element]) if a.element != b.element else (names[a.element],)
            what = "height" if abs(a.normal[2]) > 0.5 else "width"
            yield width(region.name, region.global_id, what, between, found, planned)


def _overlap(a: Face, b: Face) -> Array | None:
    """(3,) middle of where two faces look at each other; None where they do not."""
    axes = a.plane.axes
    first, second = a.points @ axes.T, b.points @ axes.T
    low = np.maximum(first.min(axis=0), second.min(axis=0))
    high = np.minimum(first.max(axis=0), second.max(axis=0))
    if (high - low).min() < LEAST_OVERLAP_M:
        return None
    across = 0.5 * float((a.plane.centroid + b.plane.centroid) @ a.plane.normal)
    return np.asarray(0.5 * (low + high) @ axes + across * a.plane.normal)


def _length(face: Face) -> float:
    """Level length that was seen [m]."""
    level = np.array([-face.normal[1], face.normal[0], 0.0])
    return float(np.ptp(face.points @ (level / np.linalg.norm(level))))
