"""One storey from the cloud: rooms, walls, openings, columns, with their fits."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from shapely import MultiPolygon, Polygon, contains_xy, union_all

from ..planes.cloud import Cloud
from ..planes.conformity import flatness
from ..planes.derived import Estimate, plumb_deviation
from ..planes.fit import Plane, fit_plane
from ..planes.noise import PointNoise
from ..planes.surfels import Surfels
from ..planes.unevenness import with_unevenness
from ..progress import Progress
from .building import ASSUMED, EDGES, MEASURED, BuiltColumn, BuiltRoom, BuiltWall, FitRecord, FittedFace
from .column_fit import fit_column
from .columns import column_returns
from .crossings import BAND_M, Crossings, cross
from .face_points import EDGE_M, REACH_M, surface_returns
from .faces import find_faces, upright_surfels
from .joins import join_walls
from .levels import Storey
from .openings import FaceRaster, Opening, face_raster, find_openings
from .plan import make_plan
from .rooms import Room, find_rooms
from .thickness import Hint, hint, settle
from .walls import SEEN_OUTSIDE, WallLine, find_walls

Array = NDArray[np.float64]

FIT_POINTS = 20_000
LEAST_FIT = 30
LEAST_SOLID = 0.12
"""A wall of which less is solid, where anything is known, is no wall: an opening of the whole width, a row of lamps."""
NOISE_FACTOR = 4.0
LOST_SHARE = 0.2
"""In a room behind a hole all rays come back but a few."""


@dataclass
class _Work:
    line: WallLine
    sides: list[Crossings]
    raster: FaceRaster
    openings: list[Opening]
    base: float
    top: float


@dataclass(frozen=True)
class StoreyParts:
    """What was found in one storey."""

    rooms: list[Room]
    built_rooms: list[BuiltRoom]
    walls: list[BuiltWall]
    columns: list[BuiltColumn]


def reconstruct_storey(
    cloud: Cloud, surfels: Surfels, storey: Storey, noise: PointNoise, progress: Progress
) -> StoreyParts:
    """All of one storey."""
    progress.update(0.0, "Finding rooms")
    plan = make_plan(cloud, surfels, storey)
    upright = upright_surfels(surfels, storey.floor + 0.03, storey.top)
    faces = find_faces(upright)
    progress.update(0.3, "Finding rooms")
    rooms = find_rooms(plan, faces, storey)
    lines = find_walls(rooms, faces)
    band = max(BAND_M, NOISE_FACTOR * noise.sigma_range)
    work = []
    for k, line in enumerate(lines):
        progress.update(0.35 + 0.5 * k / max(len(lines), 1), "Looking for openings")
        found = _examine(cloud, line, rooms, storey, band)
        if found is not None:
            work.append(found)
    settle([w.line for w in work], [_hint(w, band) for w in work])
    joined = join_walls([w.line for w in work])
    progress.update(0.9, "Fitting faces")
    walls = []
    for w, j in zip(work, joined, strict=True):
        start_u = float(j.start @ w.line.along)
        openings = tuple(_moved(o, -start_u) for o in w.openings)
        fit, fitted = _fit(cloud, w, band, noise)
        lean = plumb_deviation(fitted[0].plane) if fitted else Estimate(0.0, 0.0)
        external = is_external(w.line, openings, rooms, cloud.stations)
        walls.append(
            BuiltWall(j.start, j.end, w.line.thickness, j.footprint, w.base, w.top, openings, j.joins,
                      tuple(sorted(w.line.rooms)), external, fit, lean.value, lean.sigma,
                      fitted)
        )

    columns = [
        column for room in rooms for rows in column_returns(room, upright, cloud)
        if (column := _built_column(cloud, rows, room, band, noise)) is not None
    ]  # fmt: skip
    built_rooms = [_built_room(cloud, r, columns, storey.has_ceiling, band, noise) for r in rooms]
    return StoreyParts(rooms, built_rooms, walls, columns)


def _built_column(
    cloud: Cloud, rows: NDArray[np.int64], room: Room, band: float, noise: PointNoise
) -> BuiltColumn | None:
    def fit_face(own: NDArray[np.int64]) -> Plane:
        return _fitted_face(cloud, rows[own], "finished wall", noise).plane

    shape = fit_column(cloud.points[rows].astype(np.float64), cloud.stations[cloud.station[rows]], band, fit_face)
    if shape is None:
        return None
    fit = FitRecord(
        shape.residual_mean, shape.residual_sigma, shape.seen, shape.position_sigma, EDGES if shape.hidden else MEASURED,
        shape.returns,
    )
    return BuiltColumn(shape.footprint, shape.radius, room.floor, room.ceiling, fit, shape.hidden, shape.on)


def _without(room: Room, columns: list[BuiltColumn]) -> Polygon:
    outline = room.outline
    own = [c.footprint for c in columns if outline.contains(c.footprint)]
    rest = outline.difference(union_all(own)) if own else outline
    return max(rest.geoms, key=lambda p: p.area) if isinstance(rest, MultiPolygon) else rest


def is_external(line: WallLine, openings: tuple[Opening, ...], rooms: list[Room], stations: Array) -> bool | None:
    """Whether the outside is behind a wall; None where nothing tells.

    No with rooms on both sides. Yes where a station out of all rooms stands on its other side and that face was seen; or
    where a window is in it from which many rays do not come back, as from the sky.
    """
    if any(p.right >= 0 for p in line.pieces):
        return False
    inner = union_all([r.outline for r in rooms])
    seen_outside = any(p.right == SEEN_OUTSIDE for p in line.pieces) and any(
        s[:2] @ line.normal < line.near - line.thickness and not contains_xy(inner, s[0], s[1]) for s in stations
    )
    lost = any(o.kind == "window" and o.lost > LOST_SHARE for o in openings)
    return True if seen_outside or lost else None


def _built_room(
    cloud: Cloud, room: Room, columns: list[BuiltColumn], has_ceiling: bool, band: float, noise: PointNoise
) -> BuiltRoom:
    floor = _level_face(cloud, room, room.floor, 1.0, band, noise)
    ceiling = _level_face(cloud, room, room.ceiling, -1.0, band, noise) if has_ceiling else None
    return BuiltRoom(_without(room, columns), room.floor, room.ceiling, floor, ceiling)


def _level_face(
    cloud: Cloud, room: Room, level: float, up: float, band: float, noise: PointNoise
) -> FittedFace | None:
    """The floor (``up`` 1) or ceiling (-1) of a room, from the returns near its level."""
    inner = room.outline.buffer(-EDGE_M)
    x0, y0, x1, y1 = inner.bounds if not inner.is_empty else (0.0, 0.0, 0.0, 0.0)
    x, y, z = cloud.points.T
    rows = np.flatnonzero((np.abs(z - level) < REACH_M) & (x > x0) & (x < x1) & (y > y0) & (y < y1))
    rows = rows[:: max(1, len(rows) // (4 * FIT_POINTS))]
    rows = rows[contains_xy(inner, x[rows], y[rows])]
    at, ends = np.column_stack([x[rows], y[rows]]), np.array(room.outline.bounds).reshape(2, 2)
    rows = rows[surface_returns(at, z[rows] - level, band, ends, np.zeros((0, 2, 2)))]
    if len(rows) < LEAST_FIT:
        return None
    kind = "finished floor" if up > 0 else "finished wall"
    face = _fitted_face(cloud, rows, kind, noise)
    return replace(face, plane=face.plane.facing(face.plane.centroid + np.array([0.0, 0.0, up])))


def _fitted_face(cloud: Cloud, rows: NDArray[np.int64], kind: str, noise: PointNoise) -> FittedFace:
    rows = rows[:: max(1, len(rows) // FIT_POINTS)]
    points = cloud.points[rows].astype(np.float64)
    plane = fit_plane(points, cloud.stations[cloud.station[rows]], noise)
    plane, bumps = with_unevenness(plane, points)
    tests = tuple(flatness(plane, points, kind))
    return FittedFace(plane.facing(cloud.stations[cloud.station[rows[0]]]), bumps, tests)


def _hint(work: _Work, band: float) -> Hint:
    if work.line.two_sided:
        return Hint(None, 0.0, None)
    return hint(work.sides[0], work.openings, band)


def _examine(cloud: Cloud, line: WallLine, rooms: list[Room], storey: Storey, band: float) -> _Work | None:
    own = [rooms[r] for r in line.rooms]
    base = min((r.floor for r in own), default=storey.floor)
    top = max((r.ceiling for r in own), default=storey.ceiling)
    u, z = (line.u0, line.u1), (base, top)
    sides = [cross(cloud, line.normal, line.near, line.along, u, z, band)]
    if line.two_sided:
        sides.append(cross(cloud, -line.normal, line.thickness - line.near, line.along, u, z, band))
    sides = _sharpen(line, sides, band)
    raster = face_raster(sides, u, z, band)
    if raster.solid_share < LEAST_SOLID and line.source == ASSUMED:
        return None
    lost = any(p.right < 0 for p in line.pieces)
    openings = find_openings(raster, sides, base, line.thickness or 0.5, band, lost)
    return _Work(line, sides, raster, openings, base, top)


def _sharpen(line: WallLine, sides: list[Crossings], band: float) -> list[Crossings]:
    """Move the faces to the middle of the returns on them; the sides with their depths behind the moved faces.

    A door's frame may stand back by little more than the band: the median is that of the wall while most of it is wall.
    """
    shift, out = [], []
    for side in sides:
        by = 0.0
        for _ in range(3):
            on = np.abs(side.depth - by) <= band
            by = float(np.median(side.depth[on])) if on.sum() > 50 else by
        shift.append(by)
        out.append(replace(side, depth=side.depth - by))
    line.near -= shift[0]
    if len(shift) > 1:
        line.thickness -= shift[0] + shift[1]
    return out


def _moved(o: Opening, by: float) -> Opening:
    return replace(o, u0=o.u0 + by, u1=o.u1 + by)


def _fit(cloud: Cloud, work: _Work, band: float, noise: PointNoise) -> tuple[FitRecord, tuple[FittedFace, ...]]:
    faces = []
    for side in work.sides:
        near = np.abs(side.depth) < REACH_M
        at = np.column_stack([side.end_u, side.end_z])[near]
        ends = np.array([[work.line.u0, work.base], [work.line.u1, work.top]])
        holes = np.array([[[o.u0, o.z0], [o.u1, o.z1]] for o in work.openings]).reshape(-1, 2, 2)
        rows = side.row[near][surface_returns(at, side.depth[near], band, ends, holes)]
        if len(rows) >= LEAST_FIT:
            faces.append(_fitted_face(cloud, rows, "finished wall", noise))
    known = work.raster.state
    solid = float((known == 1).sum())
    open_cells = sum(o.width * o.height for o in work.openings) / work.raster.cell**2
    quality = min(1.0, solid / max(known.size - open_cells, 1.0))
    if not faces:
        return FitRecord(None, None, quality, None, work.line.source), ()
    planes = [f.plane for f in faces]
    sigma = [p.position_sigma for p in planes]
    extra = work.line.thickness_sigma / 2
    position = float(np.hypot(np.sqrt(np.sum(np.square(sigma))) / len(sigma), extra))
    record = FitRecord(
        float(np.mean([p.residual_mean for p in planes])), float(np.mean([p.residual_sigma for p in planes])), quality,
        position, work.line.source, sum(p.count for p in planes),
    )
    return record, tuple(faces)
