"""As-built dimensions of the rooms and openings of a model, from the deviations of its faces that a verification measured."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from ..planes.cloud import Cloud
from ..planes.conformity import flatness, orthogonality, parallelism, plumb
from ..progress import Progress
from ..results import VerificationResult
from .corners import Bound, Room, corner_rows
from .faces import BEFORE_FACE_M, LEVEL_COS, OPPOSITE_COS, Array, Face, faces_of, overlap, widths
from .opening_edges import scanner_rays
from .openings import opening_rows
from .regions import Region, read_regions
from .table import Dimension, conformity

BOUNDING = ("IfcWall", "IfcSlab", "IfcRoof", "IfcCovering", "IfcCurtainWall", "IfcColumn")
"""Classes (and what derives from their names) whose faces bound a room."""
SQUARE_COS = np.sin(np.radians(5.0))
UPRIGHT = np.sin(np.radians(5.0))


def as_built_dimensions(
    result: VerificationResult, source: str | Path | None = None, cloud: Cloud | None = None, progress: Progress | None = None
) -> list[Dimension]:
    """Clear widths and heights of every space and opening of the model's file; of the spaces also vertices, edges, slopes,
    unevenness and tests of their faces.

    ``source``: the file, where it is another than ``result.model.path``; ``cloud``: the returns that were verified with, in
    the model's frame, for the edges of openings. Only faces and edges that were seen are used. Raises BimVerifyError when the
    file cannot be read.
    """
    progress = progress or Progress()
    spaces, openings = read_regions(source or result.model.path, result.model.origin)
    names = [e.name or e.global_id for e in result.model.elements]
    rows: list[Dimension] = []
    bounds = np.array([e.ifc_class.startswith(BOUNDING) for e in result.model.elements], dtype=np.bool_)
    position, normal = result.samples.position, result.samples.normal
    measured = np.isfinite(result.evidence.deviation) & result.samples.exposed
    shared = _registration(result)
    before = position + BEFORE_FACE_M * normal
    regions = len(spaces) + len(openings)
    for k, space in enumerate(spaces):
        progress.update(k / regions, f"Measuring room {k + 1} of {len(spaces)}")
        chosen = np.flatnonzero(measured & bounds[result.samples.element])
        chosen = chosen[space.holds(before[chosen])]
        faces = faces_of(result, chosen)
        rows += _room(space, faces, names, shared)
        rows += corner_rows(_bounded(space, faces, names, result.model.origin, shared / np.sqrt(2.0)))
    rays = None if cloud is None else scanner_rays(cloud, result)
    for k, opening in enumerate(openings):
        progress.update((len(spaces) + k) / regions, f"Measuring opening {k + 1} of {len(openings)}")
        rows += opening_rows(opening, result, names, measured, shared, rays)
    progress.check()
    return rows


def _registration(result: VerificationResult) -> float:
    """Of two faces that different stations saw, as those of an opening mostly are [m]."""
    if len(result.stations) < 2:
        return 0.0
    return float(np.sqrt(2.0)) * max(s.registration_sigma for s in result.stations)


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
    yield from widths(space, faces, names, shared)
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
            if abs(cosine) > -OPPOSITE_COS and overlap(a, b) is not None:
                yield conformity(space.name, space.global_id, both, parallelism(a.plane, b.plane, length))
            elif abs(cosine) < SQUARE_COS:
                yield conformity(space.name, space.global_id, both, orthogonality(a.plane, b.plane, length))


def _length(face: Face) -> float:
    """Level length that was seen [m]."""
    level = np.array([-face.normal[1], face.normal[0], 0.0])
    return float(np.ptp(face.points @ (level / np.linalg.norm(level))))
