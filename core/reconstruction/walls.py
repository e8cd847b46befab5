"""Walls: sides of rooms paired across the solid between them; a side without a partner has only one face."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from shapely import Point, prepare, union_all

from .faces import Face
from .rooms import Room, RoomEdge

Array = NDArray[np.float64]

OPPOSITE_COS = -np.cos(np.radians(4.0))
THINNEST_M, THICKEST_M = 0.03, 0.7
LEAST_OVERLAP_M = 0.15
LEAST_ONE_SIDED_M = 0.3
LEAST_REMAINDER_M = 0.75
"""The rest of a side beside its partner is a wall of its own from this length; less lies against a crossing wall."""
SAME_LINE_M = 0.02
SAME_THICKNESS_M = 0.03
SAME_DIRECTION = np.sin(np.radians(2.0))
LARGEST_GAP_M = 0.8
HIDDEN_DEPTH_M = 3.0
"""A room that ends unseen may reach this much farther, to the line of its neighbours' walls."""
OUTER_SHARE = 0.3
"""Share of the inner face's length along which the outer one must be seen as well."""
PLACE_M = 0.15
ROWS = 100_000
SEEN_OUTSIDE = -2
SHORT_SHARE = 0.5
LONG_SHARE = 2.0
"""Seen from one side for more than this many times its length between two rooms, a side goes on as another wall: where a
building steps back, its outer wall follows in the line of a partition."""


@dataclass
class Piece:
    """A straight piece of wall: along ``along`` from ``u0`` to ``u1``; its room (``left``) lies at the left.

    Across the line the left face is at ``near`` and the right one at ``near - thickness`` (along the left normal).
    """

    along: Array
    near: float
    thickness: float | None
    u0: float
    u1: float
    left: int
    """Room at the left."""
    right: int
    """Room at the right, -1 for none, SEEN_OUTSIDE for a face that was seen where no room is."""
    face: int = -1
    """Row of the storey's faces of the surface seen at the left; -1 for none."""

    @property
    def normal(self) -> Array:
        """(2,) to the left."""
        return np.array([-self.along[1], self.along[0]])

    @property
    def length(self) -> float:
        """Metres."""
        return self.u1 - self.u0

    def point(self, u: float, across: float) -> Array:
        """(2,) place."""
        return self.along * u + self.normal * across


@dataclass
class WallLine:
    """A wall in plan: pieces in one line."""

    along: Array
    near: float
    """Of the left face along the left normal, metres."""
    thickness: float
    source: str
    """MEASURED, REVEAL or ASSUMED."""
    u0: float
    u1: float
    pieces: list[Piece] = field(default_factory=list)
    thickness_sigma: float = 0.0
    """What the thickness may be off by, beside the faces' own uncertainty [m]."""

    @property
    def normal(self) -> Array:
        """(2,) to the left."""
        return np.array([-self.along[1], self.along[0]])

    @property
    def axis(self) -> float:
        """Of the middle along the left normal, metres."""
        return self.near - self.thickness / 2

    @property
    def length(self) -> float:
        """Metres."""
        return self.u1 - self.u0

    @property
    def two_sided(self) -> bool:
        """Both faces were seen."""
        return any(p.thickness is not None for p in self.pieces)

    def point(self, u: float, across: float) -> Array:
        """(2,) place: ``across`` along the left normal from the origin."""
        return self.along * u + self.normal * across

    @property
    def rooms(self) -> set[int]:
        """Rooms that it bounds."""
        return {r for p in self.pieces for r in (p.left, p.right) if r >= 0}


def find_walls(rooms: list[Room], faces: list[Face]) -> list[WallLine]:
    """Walls of a storey; those of which one side was seen are still ASSUMED, with thickness 0.

    No wall stands where a room ends without a surface that was seen.
    """
    pieces = _pieces(rooms)
    unseen = [p for p in pieces if p.face < 0]
    pieces = [p for p in pieces if p.face >= 0]
    for piece in pieces:
        if piece.thickness is None:
            _look_outside(piece, faces)
    return _merge(pieces, unseen, rooms)


def _pieces(rooms: list[Room]) -> list[Piece]:
    sides: list[tuple[int, RoomEdge]] = [(r, e) for r, room in enumerate(rooms) for e in room.edges if e.length > 0.05]
    partners: list[list[tuple[float, float, int, float]]] = [[] for _ in sides]
    for i, (_, a) in enumerate(sides):
        for j, (_, b) in enumerate(sides):
            if i == j or min(a.face, b.face) < 0 or a.inward @ b.inward > OPPOSITE_COS:
                continue
            s = np.sort([(b.start - a.start) @ a.along, (b.end - a.start) @ a.along])
            s0, s1 = max(0.0, s[0]), min(a.length, s[1])
            if s1 - s0 < min(LEAST_OVERLAP_M, 0.5 * min(a.length, b.length)):
                continue
            middle = a.start + 0.5 * (s0 + s1) * a.along
            slope = b.inward @ a.inward
            distance = float((b.start - middle) @ b.inward / -slope)
            if THINNEST_M < distance < THICKEST_M:
                partners[i].append((distance, s0, j, s1))
    out = []
    for i, (room, a) in enumerate(sides):
        taken: list[tuple[float, float]] = []
        start = float(a.start @ a.along)
        near = float(0.5 * (a.start + a.end) @ a.inward)
        for distance, s0, j, s1 in sorted(partners[i]):
            for p, q in _without(s0, s1, taken):
                if q - p > 0.05:
                    taken.append((p, q))
                    if i < j:
                        out.append(Piece(a.along, near, distance, start + p, start + q, room, sides[j][0], a.face))
        rest = _without(0.0, a.length, taken)
        for p, q in rest:
            least = LEAST_REMAINDER_M if taken else LEAST_ONE_SIDED_M
            if q - p >= least:
                out.append(Piece(a.along, near, None, start + p, start + q, room, -1, a.face))
    return out


def _without(low: float, high: float, taken: list[tuple[float, float]]) -> list[tuple[float, float]]:
    parts = [(low, high)]
    for a, b in taken:
        parts = [r for p, q in parts for r in ((p, min(q, a)), (max(p, b), q)) if r[1] - r[0] > 1e-6]
    return parts


def _look_outside(piece: Piece, faces: list[Face]) -> None:
    """The face seen from outside behind a one-sided piece, if there is one.

    It counts only where the inner face was seen as well: panes and panels that stand in openings are no faces of a wall.
    """
    if piece.face < 0:
        return
    inner = _places(faces[piece.face], piece)
    if not len(inner):
        return
    best = None
    for face in faces:
        if face.normal @ piece.normal > OPPOSITE_COS:
            continue
        middle = piece.point(0.5 * (piece.u0 + piece.u1), piece.near)
        distance = float((face.normal @ middle - face.offset) / (face.normal @ piece.normal))
        if not THINNEST_M < distance < THICKEST_M or (best is not None and distance >= best):
            continue
        both = np.intersect1d(inner, _places(face, piece))
        if len(np.unique(both // ROWS)) >= OUTER_SHARE * len(np.unique(inner // ROWS)):
            best = distance
    if best is not None:
        piece.thickness, piece.right = best, SEEN_OUTSIDE


def _places(face: Face, piece: Piece) -> NDArray[np.int64]:
    """Cells along the piece and in height in which the face was seen."""
    u = (face.normal * face.offset + face.u[:, None] * face.along) @ piece.along
    inside = (u > piece.u0) & (u < piece.u1)
    column = ((u[inside] - piece.u0) / PLACE_M).astype(np.int64)
    row = np.clip(np.floor(face.z[inside] / PLACE_M).astype(np.int64) + ROWS // 2, 0, ROWS - 1)
    return np.unique(column * ROWS + row)


def _merge(pieces: list[Piece], unseen: list[Piece], rooms: list[Room]) -> list[WallLine]:
    """Pieces in one line become one wall; where two walls would cross, the longer one goes through."""
    inside = union_all([r.outline.buffer(-0.02) for r in rooms]) if rooms else None
    if inside is not None:
        prepare(inside)
    joins = []
    for i, a in enumerate(pieces):
        for j in range(i + 1, len(pieces)):
            b = pieces[j]
            if not _same_line(a, b):
                continue
            b0, b1 = sorted(float(b.point(u, b.near) @ a.along) for u in (b.u0, b.u1))
            gap = max(b0 - a.u1, a.u0 - b1)
            if gap > LARGEST_GAP_M and not _hidden_between(a, min(a.u1, b1), max(a.u0, b0), unseen):
                continue
            u = 0.5 * (min(a.u1, b1) + max(a.u0, b0))
            middle = a.point(u, a.near - 0.5 * (a.thickness or b.thickness or 0.1))
            if gap > 0.02 and inside is not None and inside.contains(Point(middle)):
                continue
            length = max(a.u1, b1) - min(a.u0, b0)
            joins.append((-length, i, j, middle, gap))
    joins.sort(key=lambda x: (x[0], x[1], x[2]))
    parent = list(range(len(pieces)))

    def root(k: int) -> int:
        while parent[k] != k:
            k = parent[k]
        return k

    passed: list[tuple[Array, Array]] = []
    for _, i, j, middle, gap in joins:
        crossing = gap > 0.02 and any(
            np.linalg.norm(middle - place) < 0.6 and abs(_cross(along, pieces[i].along)) > 0.3 for place, along in passed
        )
        if crossing:
            continue
        if gap > 0.02:
            passed.append((middle, pieces[i].along))
        parent[root(j)] = root(i)
    groups: dict[int, list[Piece]] = {}
    for k, piece in enumerate(pieces):
        groups.setdefault(root(k), []).append(piece)
    return [_line(group) for group in groups.values()]


def _hidden_between(a: Piece, start: float, end: float, unseen: list[Piece]) -> bool:
    """Whether a room in front of the gap ends unseen, so that nothing speaks against one wall."""
    for q in unseen:
        u = sorted(float(q.point(v, q.near) @ a.along) for v in (q.u0, q.u1))
        before = float(q.point(q.u0, q.near) @ a.normal) - a.near
        if q.normal @ a.normal > -OPPOSITE_COS and 0.0 <= before < HIDDEN_DEPTH_M and (
            u[0] < start + LARGEST_GAP_M and u[1] > end - LARGEST_GAP_M
        ):
            return True
    return False


def _cross(a: Array, b: Array) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def _same_line(a: Piece, b: Piece) -> bool:
    if abs(_cross(a.along, b.along)) > SAME_DIRECTION:
        return False
    same = bool(a.along @ b.along > 0)
    u = float(np.clip(0.5 * (b.u0 + b.u1) * (1 if same else -1), a.u0, a.u1))
    place = a.point(u, a.near)
    # faces of b along a's left normal at that place
    at = float(a.near + (b.near - place @ b.normal) * (1 if same else -1))
    b_thick = b.thickness
    if a.thickness is not None and b_thick is not None:
        a_axis = a.near - a.thickness / 2
        b_axis = at - b_thick / 2 if same else at + b_thick / 2
        return abs(a_axis - b_axis) < SAME_LINE_M and abs(a.thickness - b_thick) < SAME_THICKNESS_M
    if a.thickness is None and b_thick is None:
        return same and abs(at - a.near) < SAME_LINE_M
    measured, single = (a, b) if a.thickness is not None else (b, a)
    one_side = a.face >= 0 and a.face == b.face and a.left == b.left and single.length < LONG_SHARE * measured.length
    if single.length > SHORT_SHARE * measured.length and not one_side:
        return False
    if same:
        return abs(at - a.near) < SAME_LINE_M
    other = a.near - a.thickness if a.thickness is not None else a.near + (b_thick or 0.0)
    return abs(at - (other if a.thickness is not None else a.near)) < SAME_LINE_M and (
        a.thickness is not None or abs(at + (b_thick or 0.0) - a.near) < SAME_LINE_M
    )


def _line(group: list[Piece]) -> WallLine:
    """One wall through its pieces, weighted by length."""
    group = sorted(group, key=lambda p: (p.thickness is None, -p.length))
    first = group[0]
    along, normal = first.along, first.normal
    near, thickness, weight, single = 0.0, 0.0, 0.0, 0.0
    ends = []
    for p in group:
        same = p.along @ along > 0
        ends += [p.point(p.u0, p.near) @ along, p.point(p.u1, p.near) @ along]
        middle = p.point(0.5 * (p.u0 + p.u1), p.near)
        face = float(middle @ normal)
        if p.thickness is None:
            single += p.length
            if first.thickness is None:
                near += p.length * face
                weight += p.length
            continue
        near += p.length * (face if same else face + p.thickness)
        thickness += p.length * p.thickness
        weight += p.length
    measured = first.thickness is not None
    return WallLine(
        along, near / weight, thickness / weight if measured else 0.0, "MEASURED" if measured else "ASSUMED",
        float(min(ends)), float(max(ends)), group,
    )
