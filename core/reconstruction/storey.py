"""One storey from the cloud: rooms, walls, openings, columns, with their fits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from shapely import MultiPolygon, Polygon, contains_xy, union_all

from ..planes.cloud import Cloud
from ..planes.derived import Estimate, plumb_deviation
from ..planes.fit import Plane
from ..planes.noise import PointNoise
from ..planes.surfels import Surfels
from ..progress import Progress
from .building import ASSUMED, EDGES, MEASURED, SEEN, BuiltColumn, BuiltRoom, BuiltWall, FitRecord, FittedFace
from .column_fit import fit_column
from .columns import column_returns
from .crossings import BAND_M, Crossings, cross
from .face_points import EDGE_M, REACH_M, surface_returns
from .faces import Face, find_faces, upright_surfels
from .fitted import FIT_POINTS, LEAST_FIT, FaceReturns, Survey, face_returns, fitted_face, returns_on, room_faces
from .hole_rectangles import FaceRaster
from .joins import JoinedWall, join_walls
from .levels import Storey
from .openings import LOST_SHARE, Opening, face_raster, find_openings
from .plan import PlanRaster, make_plan
from .rooms import Room, find_rooms
from .steps import Step, find_step
from .thickness import Hint, hint, settle
from .walls import SEEN_OUTSIDE, WallLine, find_walls

Array = NDArray[np.float64]

LEAST_SOLID = 0.12
"""A wall of which less is solid, where anything is known, is no wall: an opening of the whole width, a row of lamps."""
NOISE_FACTOR = 4.0
BEFORE_WALL_M = 0.12
HIGHEST = 0.97
SLOPE_M = 0.1
"""A ceiling that is nowhere along a wall farther from its room's level is level there."""
LEAST_WALL_HEIGHT_M = 0.3
INTO_WALL_M = 0.03
MOSTLY = 0.8


@dataclass
class _Work:
    line: WallLine
    sides: list[Crossings]
    raster: FaceRaster
    openings: list[Opening]
    base: float
    top: float
    faces: list[FaceReturns] = field(default_factory=list)


@dataclass(frozen=True)
class StoreyParts:
    """What was found in one storey."""

    rooms: list[Room]
    built_rooms: list[BuiltRoom]
    walls: list[BuiltWall]
    columns: list[BuiltColumn]


@dataclass(frozen=True)
class StoreyDraft:
    """The same before its faces are fitted: that takes knowing how well the stations agree, which all storeys tell."""

    work: list[_Work]
    joined: list[JoinedWall]
    rooms: list[Room]
    levels: list[tuple[FaceReturns | None, FaceReturns | None]]
    """Floor and ceiling of each room."""
    columns: list[tuple[Room, float, Array, NDArray[np.int64]]]
    """Room, top [m], (N, 3) returns [m] and their stations of what may be a column."""
    band: float
    """Returns this close to a face are on it [m]."""
    has_ceiling: bool

    @property
    def faces(self) -> list[FaceReturns]:
        """All of the storey."""
        return [f for w in self.work for f in w.faces] + [f for pair in self.levels for f in pair if f is not None]

    def height_source(self, rooms: Sequence[Room]) -> str:
        """Where the heights of some of its rooms come from, at worst (``BuiltWall.height_source``)."""
        if not self.has_ceiling:
            return ASSUMED
        own = [pair for room, pair in zip(self.rooms, self.levels, strict=True) if any(room is r for r in rooms)]
        return MEASURED if own and all(f is not None for pair in own for f in pair) else SEEN


def draft_storey(
    cloud: Cloud, surfels: Surfels, storey: Storey, noise: PointNoise, progress: Progress, below: StoreyDraft | None = None
) -> StoreyDraft:
    """What there is in one storey, and the returns on its faces. On walls of ``below`` that reach up into it its own stand."""
    progress.update(0.0, "Finding rooms")
    plan, upright, faces, rooms = _rooms(cloud, surfels, storey)
    if np.isfinite(storey.past) and not any(r.ceiling > storey.past for r in rooms):
        storey = storey.closed()
        plan, upright, faces, rooms = _rooms(cloud, surfels, storey)
    progress.update(0.3, "Finding walls")
    lines = find_walls(rooms, faces)
    band = max(BAND_M, NOISE_FACTOR * noise.sigma_range)
    work = []
    for k, line in enumerate(lines):
        progress.update(0.35 + 0.5 * k / max(len(lines), 1), "Looking for openings")
        found = _examine(cloud, line, rooms, storey, plan, band, below)
        if found is not None:
            work.append(found)
    settle([w.line for w in work], [_hint(w, band) for w in work])
    joined = join_walls([w.line for w in work])
    progress.update(0.9, "Fitting faces")
    for w in work:
        w.faces = _wall_returns(cloud, w, band, noise)
    columns = [
        (room, c.top, cloud.points[c.rows].astype(np.float64), cloud.station[c.rows].astype(np.int64))
        for room in rooms for c in column_returns(room, upright, cloud, plan)
    ]  # fmt: skip
    levels = [
        (_level_returns(cloud, r, r.floor, 1.0, band, noise),
         _level_returns(cloud, r, r.ceiling, -1.0, band, noise) if storey.has_ceiling else None)
        for r in rooms
    ]  # fmt: skip
    return StoreyDraft(work, joined, rooms, levels, columns, band, storey.has_ceiling)


def _rooms(cloud: Cloud, surfels: Surfels, storey: Storey) -> tuple[PlanRaster, Surfels, list[Face], list[Room]]:
    plan = make_plan(cloud, surfels, storey)
    upright = upright_surfels(surfels, storey.floor + 0.03, storey.top)
    faces = find_faces(upright)
    return plan, upright, faces, find_rooms(plan, faces, storey)


def finish_storey(draft: StoreyDraft, survey: Survey) -> StoreyParts:
    """Faces fitted, edges of openings as uncertain as the poses of those who saw them."""
    walls, pairs = [], []
    for w, j in zip(draft.work, draft.joined, strict=True):
        start_u = float(j.start @ w.line.along)
        openings = tuple(_placed(o, -start_u, survey.poses.sigma) for o in w.openings)
        fitted = [fitted_face(f, survey) for f in w.faces]
        pairs.append(list(zip(w.faces, fitted, strict=True)))
        lean = plumb_deviation(fitted[0].plane) if fitted else Estimate(0.0, 0.0)
        external = is_external(w.line, openings, draft.rooms, survey.stations)
        walls.append(
            BuiltWall(j.start, j.end, w.line.thickness, j.footprint, w.base, w.top, openings, j.joins,
                      tuple(sorted(w.line.rooms)), external, _record(w, fitted),
                      draft.height_source([draft.rooms[r] for r in w.line.rooms]), lean.value, lean.sigma, tuple(fitted),
                      _step(w, draft.band))
        )  # fmt: skip
    columns = [c for candidate in draft.columns if (c := _built_column(draft, *candidate, survey)) is not None]
    built = []
    for room, (bottom, top) in zip(draft.rooms, draft.levels, strict=True):
        floor, ceiling = (None if f is None else fitted_face(f, survey) for f in (bottom, top))
        own = room_faces(room.outline, pairs, survey)
        built.append(BuiltRoom(_without(room, columns), room.floor, room.ceiling, floor, ceiling, own,
                               draft.height_source([room])))
    return StoreyParts(draft.rooms, built, walls, columns)


def _built_column(
    draft: StoreyDraft, room: Room, top: float, points: Array, station: NDArray[np.int64], survey: Survey
) -> BuiltColumn | None:
    def fit_face(own: NDArray[np.int64]) -> Plane:
        own = own[:: max(1, len(own) // FIT_POINTS)]
        face = returns_on(points[own], station[own], survey.stations, "finished wall", survey.noise)
        return fitted_face(face, survey).plane

    shape = fit_column(points, survey.stations[station], draft.band, fit_face, survey.poses.sigma)
    if shape is None:
        return None
    fit = FitRecord(
        shape.residual_mean, shape.residual_sigma, shape.seen, shape.position_sigma, EDGES if shape.hidden else MEASURED,
        shape.returns,
    )
    return BuiltColumn(
        shape.footprint, shape.radius, room.floor, top, fit, shape.hidden, shape.on, draft.height_source([room])
    )


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


def _level_returns(
    cloud: Cloud, room: Room, level: float, up: float, band: float, noise: PointNoise
) -> FaceReturns | None:
    """On the floor (``up`` 1) or ceiling (-1) of a room, near its level."""
    inner = room.outline.buffer(-EDGE_M)
    x0, y0, x1, y1 = inner.bounds if not inner.is_empty else (0.0, 0.0, 0.0, 0.0)
    x, y, z = cloud.points.T
    rows = np.flatnonzero((np.abs(z - level) < REACH_M) & (x > x0) & (x < x1) & (y > y0) & (y < y1))
    rows = rows[:: max(1, len(rows) // (4 * FIT_POINTS))]
    rows = rows[contains_xy(inner, x[rows], y[rows])]
    at, ends = np.column_stack([x[rows], y[rows]]), np.array(room.outline.bounds).reshape(2, 2)
    rows = rows[surface_returns(at, z[rows] - level, band, ends)]
    if len(rows) < LEAST_FIT:
        return None
    return face_returns(cloud, rows, "finished floor" if up > 0 else "finished wall", noise)


def _step(work: _Work, band: float) -> Step | None:
    u, z = (work.line.u0, work.line.u1), (work.base, work.top)
    holes = [(o.u0, o.u1, o.z0, o.z1) for o in work.openings]
    found = [find_step(side, u, z, band, holes) for side in work.sides]
    return max((s for s in found if s is not None), key=lambda s: s.share, default=None)


def _hint(work: _Work, band: float) -> Hint:
    if work.line.two_sided:
        return Hint(None, 0.0, None)
    return hint(work.sides[0], work.openings, band)


def _examine(
    cloud: Cloud, line: WallLine, rooms: list[Room], storey: Storey, plan: PlanRaster, band: float, below: StoreyDraft | None
) -> _Work | None:
    base = min((rooms[r].floor for r in line.rooms), default=storey.floor)
    top = max((ceiling_along(plan, line, r, rooms[r].ceiling) for r in line.rooms), default=storey.ceiling)
    base = max(base, _top_below(line, below)) if below is not None else base
    if top - base < LEAST_WALL_HEIGHT_M:
        return None
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


def _top_below(line: WallLine, below: StoreyDraft) -> float:
    """Top of the wall of the storey below that stands in the same place along most of a line [m]."""
    u = np.linspace(line.u0, line.u1, 50)[:, None]
    x, y = (u * line.along + (line.near - INTO_WALL_M) * line.normal).T
    walls = zip(below.work, below.joined, strict=True)
    return max((w.top for w, j in walls if contains_xy(j.footprint, x, y).mean() > MOSTLY), default=-np.inf)


def ceiling_along(plan: PlanRaster, line: WallLine, room: int, level: float) -> float:
    """The highest that a room's ceiling gets along a wall [m]; ``level``, that of the room, where it is level there."""
    heights = [np.zeros(0)]
    for p in line.pieces:
        u = np.arange(p.u0 + BEFORE_WALL_M, p.u1 - BEFORE_WALL_M, plan.cell)[:, None] * p.along
        for own, face, into in ((p.left, p.near, 1.0), (p.right, p.near - (p.thickness or 0.0), -1.0)):
            if own == room:
                cells = [plan.cells(u + (face + into * k * BEFORE_WALL_M) * p.normal) for k in (1, 2)]
                near, far = (plan.ceiling[c[:, 0], c[:, 1]] for c in cells)
                # a slope goes on to the wall, a step does not
                heights.append(np.where(np.abs(near - far) < BEFORE_WALL_M, 2.0 * near - far, near))
    seen = np.concatenate(heights)
    seen = seen[np.isfinite(seen)]
    if not len(seen):
        return level
    lowest, highest = np.quantile(seen, [1.0 - HIGHEST, HIGHEST])
    return float(highest) if max(level - lowest, highest - level) > SLOPE_M else level


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


def _placed(o: Opening, by: float, sigma: float) -> Opening:
    start, end, sill, head = (float(np.hypot(s, sigma)) for s in o.edge_sigma)
    return replace(o, u0=o.u0 + by, u1=o.u1 + by, edge_sigma=(start, end, sill, head))


def _wall_returns(cloud: Cloud, work: _Work, band: float, noise: PointNoise) -> list[FaceReturns]:
    faces = []
    for side in work.sides:
        near = np.abs(side.depth) < REACH_M
        at = np.column_stack([side.end_u, side.end_z])[near]
        ends = np.array([[work.line.u0, work.base], [work.line.u1, work.top]])
        holes = np.array([[[o.u0, o.z0], [o.u1, o.z1]] for o in work.openings]).reshape(-1, 2, 2)
        rows = side.row[near][surface_returns(at, side.depth[near], band, ends, holes)]
        if len(rows) >= LEAST_FIT:
            faces.append(face_returns(cloud, rows, "finished wall", noise))
    return faces


def _off_fits(line: WallLine, planes: list[Plane]) -> float:
    """How far a wall's axis, which shares its line with others, is from the middle of its own fitted ``planes`` [m]: the root
    mean square of both ends."""
    ends = np.outer([line.u0, line.u1], line.along)
    off = np.zeros(2)
    for plane in planes:
        side = float(np.sign(plane.normal[:2] @ line.normal))
        written = line.near if side > 0 else line.near - line.thickness
        places = np.column_stack([ends + written * line.normal, np.full(2, plane.centroid[2])])
        off += side * plane.distance(places) / len(planes)
    return float(np.sqrt((off**2).mean()))


def _record(work: _Work, faces: list[FittedFace]) -> FitRecord:
    known = work.raster.state
    solid = float((known == 1).sum())
    open_cells = sum(o.width * o.height for o in work.openings) / work.raster.cell**2
    quality = min(1.0, solid / max(known.size - open_cells, 1.0))
    if not faces:
        return FitRecord(None, None, quality, None, work.line.source)
    planes = [f.plane for f in faces]
    sigma = [p.position_sigma for p in planes]
    fits = np.sqrt(np.sum(np.square(sigma))) / len(sigma)
    position = float(np.sqrt(fits**2 + (work.line.thickness_sigma / 2) ** 2 + _off_fits(work.line, planes) ** 2))
    return FitRecord(
        float(np.mean([p.residual_mean for p in planes])), float(np.mean([p.residual_sigma for p in planes])), quality,
        position, work.line.source, sum(p.count for p in planes),
    )
