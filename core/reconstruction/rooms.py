"""Room outlines: the plan is cut by the lines of the walls around a room; cells that are mostly free belong to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation
from shapely import LineString, Point, Polygon, box, polygonize, prepare, union_all
from shapely.geometry.polygon import orient

from .faces import Face
from .levels import Storey
from .plan import CELL_M, PlanRaster

Array = NDArray[np.float64]

NEAR_CELLS = 3
BEFORE_CELLS = 2.5
UPPER_M = 0.6
"""A wall shows itself in this height below the ceiling, above furniture."""
LEAST_UPPER_HEIGHT_M = 0.3
LEAST_LINE_M = 0.22
COLUMN_M = 0.24
LEAST_BELOW_M = 0.6
SAME_LINE_M = 0.045
MOST_LINES = 48
AT_END_M = 0.3
LEAST_ACROSS = np.cos(np.radians(75.0))
MOSTLY = 0.5
"""A room is bounded in a direction where so much of its end is so near to walls that stand across that direction."""
LEAST_FREE = 0.5
ROUND_M = 1e-6
LEAST_ENCLOSED = 0.6
"""Share of an outline along which a surface was seen; below it the place is outside under a roof, or seen in part only."""
LEAST_WIDTH_M = 0.5
LEAST_COLUMN_M2 = 0.01
MOST_COLUMN_M2 = 2.5


@dataclass(frozen=True)
class RoomEdge:
    """One side of a room: from ``start`` to ``end`` the room lies to the left."""

    start: Array
    end: Array
    face: int
    """Row of the storey's faces; -1 where no surface was seen and the room merely ends."""

    @property
    def length(self) -> float:
        """Metres."""
        return float(np.linalg.norm(self.end - self.start))

    @property
    def along(self) -> Array:
        """(2,) unit vector."""
        return np.asarray((self.end - self.start) / max(self.length, 1e-12))

    @property
    def inward(self) -> Array:
        """(2,) unit vector into the room."""
        a = self.along
        return np.array([-a[1], a[0]])


@dataclass(frozen=True)
class Room:
    """A room in plan, local frame, metres."""

    outline: Polygon
    """Counter-clockwise; without the columns that stand in it."""
    edges: tuple[RoomEdge, ...]
    columns: tuple[Polygon, ...]
    floor: float
    ceiling: float

    @property
    def enclosed(self) -> float:
        """Share of its outline along which a surface was seen, 0..1."""
        return sum(e.length for e in self.edges if e.face >= 0) / max(sum(e.length for e in self.edges), 1e-9)


@dataclass(frozen=True)
class _Line:
    normal: Array
    offset: float
    face: int
    support: float


def find_rooms(plan: PlanRaster, faces: list[Face], storey: Storey) -> list[Room]:
    """Rooms of a storey, largest first."""
    bounds = [_face_cells(plan, f) for f in faces]
    out = []
    for number in np.unique(plan.rooms[plan.rooms > 0]):
        room = _room(plan, faces, bounds, plan.rooms == number, storey)
        if room is not None and room.enclosed >= LEAST_ENCLOSED and not room.outline.buffer(-LEAST_WIDTH_M / 2).is_empty:
            out.append(room)
    out.sort(key=lambda r: -r.outline.area)
    return _apart(out)


def _apart(rooms: list[Room]) -> list[Room]:
    """Leave out rooms that lie mostly in a larger one."""
    kept: list[Room] = []
    for room in rooms:
        if all(room.outline.intersection(other.outline).area < 0.3 * room.outline.area for other in kept):
            kept.append(room)
    return kept


def _face_cells(plan: PlanRaster, face: Face) -> NDArray[np.int64]:
    return plan.cells(face.normal * face.offset + face.u[:, None] * face.along)


def _room(
    plan: PlanRaster, faces: list[Face], bounds: list[NDArray[np.int64]], mask: NDArray[np.bool_], storey: Storey
) -> Room | None:
    ix, iy = np.nonzero(mask)
    ceiling = float(np.median(plan.ceiling[ix, iy]))
    seen_floor = plan.floor[ix, iy]
    with np.errstate(invalid="ignore"):
        floors = seen_floor[np.isfinite(seen_floor)]
    floor = float(np.median(floors)) if len(floors) > 10 else storey.floor
    grown = binary_dilation(mask, iterations=NEAR_CELLS)
    lines = []
    for k, (face, cells) in enumerate(zip(faces, bounds, strict=True)):
        near = grown[cells[:, 0], cells[:, 1]]
        if near.sum() < 4:
            continue
        line = _as_line(plan, face, k, near, mask, 0.5 * (floor + ceiling))
        if line is not None:
            lines.append(line)
    lines = _without_doubles(lines)[:MOST_LINES]
    centres = plan.centres(ix, iy)
    lines += _missing_sides(lines, centres)
    outline = _union_of_free_cells(plan, lines, mask)
    if outline is None:
        return None
    holes = [Polygon(ring) for ring in outline.interiors]
    outline = orient(Polygon(outline.exterior), 1.0)
    columns = tuple(
        h for h in holes if LEAST_COLUMN_M2 < h.area < MOST_COLUMN_M2 and _stands(h, faces, floor, ceiling)
    )
    edges = _edges(outline, lines)
    if len(edges) < 3:
        return None
    return Room(Polygon([e.start for e in edges]), tuple(edges), columns, floor, ceiling)


def _as_line(
    plan: PlanRaster, face: Face, row: int, near: NDArray[np.bool_], mask: NDArray[np.bool_], middle: float
) -> _Line | None:
    """The face as a side of the room, if it reaches the ceiling before it, level or not, and looks into the room.

    Over a wide window a strip of wall is seen, as of a beam: it is a wall's where the face reaches below the room's ``middle``.
    """
    front = _before(plan, face, face.u)
    ceiling = plan.ceiling[front[:, 0], front[:, 1]]
    with np.errstate(invalid="ignore"):
        upper = near & (face.z > ceiling - UPPER_M) & (face.z < ceiling + 0.05)
    if upper.sum() < 4:
        return None
    bins = np.unique(np.floor(face.u[upper] / plan.cell))
    support = len(bins) * plan.cell
    if support < LEAST_LINE_M:
        return None
    if face.area[upper].sum() < LEAST_UPPER_HEIGHT_M * support and not _stands_beside(face, near, upper, middle):
        return None
    front = _before(plan, face, (bins + 0.5) * plan.cell)
    if mask[front[:, 0], front[:, 1]].mean() < 0.5:
        return None
    return _Line(face.normal, face.offset, row, support)


def _stands_beside(face: Face, near: NDArray[np.bool_], upper: NDArray[np.bool_], middle: float) -> bool:
    """Whether somewhere along it, a pier beside a window, the face is seen below the ceiling and nearly down to the floor."""
    column = np.floor((face.u - face.u.min()) / COLUMN_M).astype(np.int64)
    tall = np.bincount(column[upper], face.area[upper], minlength=column.max() + 1) >= LEAST_UPPER_HEIGHT_M * COLUMN_M
    below = near & (face.z < middle)
    deep = np.bincount(column[below], face.area[below], minlength=column.max() + 1) >= LEAST_BELOW_M * COLUMN_M
    return bool((tall & deep).any())


def _before(plan: PlanRaster, face: Face, u: Array) -> NDArray[np.int64]:
    """Cells before the face at places along it."""
    place = face.normal * face.offset + u[:, None] * face.along
    return plan.cells(place + BEFORE_CELLS * plan.cell * face.normal)


def _without_doubles(lines: list[_Line]) -> list[_Line]:
    """Best supported first; of lines nearly the same the best one."""
    kept: list[_Line] = []
    for line in sorted(lines, key=lambda line: -line.support):
        if all(
            line.normal @ other.normal < 0.999 or abs(line.offset - other.offset) > SAME_LINE_M for other in kept
        ):
            kept.append(line)
    return kept


def _missing_sides(lines: list[_Line], centres: Array) -> list[_Line]:
    """Where the room ends without a wall that was seen: lines at the end of its free cells.

    The last cells in a direction end at seen walls where these stand across it, at a slant too: a sharp corner is an end.
    """
    main = lines[0].normal if lines else np.array([1.0, 0.0])
    out = []
    for n in (main, -main, np.array([-main[1], main[0]]), np.array([main[1], -main[0]])):
        place = centres @ n
        end = float(np.quantile(place, 0.002))
        last = centres[place <= end]
        before = [abs(last @ line.normal - line.offset) < AT_END_M for line in lines if line.normal @ n > LEAST_ACROSS]
        if np.mean(np.any(before, axis=0) if before else np.zeros(1)) < MOSTLY:
            out.append(_Line(n, end - 0.5 * CELL_M, -1, 0.0))
    return out


def _union_of_free_cells(plan: PlanRaster, lines: list[_Line], mask: NDArray[np.bool_]) -> Polygon | None:
    ix, iy = np.nonzero(mask)
    low = plan.centres(ix.min(keepdims=True), iy.min(keepdims=True))[0] - 0.5
    high = plan.centres(ix.max(keepdims=True), iy.max(keepdims=True))[0] + 0.5
    gx, gy = np.meshgrid(
        np.arange(max(ix.min() - 8, 0), min(ix.max() + 9, mask.shape[0])),
        np.arange(max(iy.min() - 8, 0), min(iy.max() + 9, mask.shape[1])), indexing="ij",
    )
    gx, gy = gx.ravel(), gy.ravel()
    normals = np.stack([line.normal for line in lines])
    offsets = np.array([line.offset for line in lines])
    side = plan.centres(gx, gy) @ normals.T > offsets
    code = np.packbits(side, axis=1)
    kinds, index = np.unique(code, axis=0, return_inverse=True)
    total = np.bincount(index.ravel(), minlength=len(kinds))
    free = np.bincount(index.ravel(), mask[gx, gy].astype(np.float64), minlength=len(kinds))
    share = {kind.tobytes(): f / t for kind, f, t in zip(kinds, free, total, strict=True)}
    frame = box(*low, *high)
    reach = float(np.linalg.norm(high - low)) + 1.0
    cuts = [frame.exterior]
    middle = 0.5 * (low + high)
    for line in lines:
        foot = middle + (line.offset - line.normal @ middle) * line.normal
        along = np.array([line.normal[1], -line.normal[0]])
        cuts.append(LineString([foot - reach * along, foot + reach * along]).intersection(frame))
    pieces = polygonize([union_all([c for c in cuts if not c.is_empty])])
    chosen = []
    for piece in pieces.geoms:
        inner = piece.representative_point()
        key = np.packbits(np.array([inner.x, inner.y]) @ normals.T > offsets).tobytes()
        if share.get(key, 0.0) > LEAST_FREE:
            chosen.append(piece.buffer(ROUND_M, join_style="mitre"))
    if not chosen:
        return None
    whole = union_all(chosen)
    parts = list(whole.geoms) if hasattr(whole, "geoms") else [whole]
    best = max(parts, key=lambda p: p.area)
    return best if best.area > 0.4 else None


def _edges(outline: Polygon, lines: list[_Line]) -> list[RoomEdge]:
    """Sides of the outline with their faces; corners are where the lines of two sides meet."""
    points = np.array(outline.exterior.coords)[:-1]
    runs: list[list] = []
    for p, q in zip(points, np.roll(points, -1, axis=0), strict=True):
        length = np.linalg.norm(q - p)
        if length < 1e-4:
            continue
        inward = np.array([-(q - p)[1], (q - p)[0]]) / length
        middle = 0.5 * (p + q)
        match = [
            (abs(line.normal @ middle - line.offset), k)
            for k, line in enumerate(lines)
            if abs(line.normal @ inward) > 0.9999 and abs(line.normal @ middle - line.offset) < 1e-4
        ]
        if not match:
            continue
        row = min(match)[1]
        if runs and runs[-1][0] == row:
            runs[-1][2] = q
        else:
            runs.append([row, p, q, inward])
    if len(runs) > 1 and runs[0][0] == runs[-1][0]:
        runs[0][1] = runs.pop()[1]
    corners = []
    for k in range(len(runs)):
        a, b = lines[runs[k - 1][0]], lines[runs[k][0]]
        system = np.stack([a.normal, b.normal])
        if abs(np.linalg.det(system)) < 0.02:
            corners.append(np.asarray(runs[k][1]))
        else:
            corners.append(np.linalg.solve(system, [a.offset, b.offset]))
    out = []
    for k, (row, _, _, inward) in enumerate(runs):
        facing = lines[row].normal @ inward > 0
        out.append(RoomEdge(corners[k], corners[(k + 1) % len(runs)], lines[row].face if facing else -1))
    return [e for e in out if e.length > 1e-3]


def _stands(hole: Polygon, faces: list[Face], floor: float, ceiling: float) -> bool:
    """Whether surfaces around the hole reach from near the floor to near the ceiling."""
    near = hole.buffer(0.05)
    prepare(near)
    levels = []
    for face in faces:
        low, high = face.u.min(), face.u.max()
        if not LineString([face.point(low), face.point(high + 1e-6)]).intersects(near):
            continue
        xy = face.normal * face.offset + face.u[:, None] * face.along
        bounds = np.array(near.bounds)
        close = np.all((xy > bounds[:2]) & (xy < bounds[2:]), axis=1)
        levels += [z for (x, y), z in zip(xy[close], face.z[close], strict=True) if near.contains(Point(x, y))]
    if not levels:
        return False
    rows = np.unique(((np.array(levels) - floor) / 0.1).astype(np.int64))
    return len(rows) * 0.1 > 0.7 * (ceiling - floor)
