"""One column of panels in both epochs: its joints found, paired, measured and tested, its profiles and its field."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from .columns import Face, FoundJoint, horizontal_joints, trace_face
from .field import column_field, face_profile
from .measure import ColumnPoints, joint_sections, measure_joints, pair_joints
from .result import Column, DisplacementField, JointDisplacement, State
from .wall import Wall, WallPoints

Array = NDArray[np.float64]
LEAST_POINTS = 100
NEAR_M = 0.4
"""Points this near to the column's middle plane in the base epoch belong to it."""
PROFILE_STEP_M = 0.1
QUANTILE = 1.959964
"""Of the normal distribution at 95 %, two-sided."""


@dataclass(frozen=True)
class ColumnFrame:
    """Wall frame turned about the vertical into one column's own direction: x along it, y out of it; z is the wall's."""

    turn: Array
    shift: Array
    wall: Wall
    origin: Array
    """Of the local frame, scan frame."""

    def to_column(self, points: Array) -> Array:
        """(N, 3) wall frame to column frame."""
        return (points - self.shift) @ self.turn.T

    def to_scan(self, points: Array) -> Array:
        """(N, 3) column frame to scan frame."""
        return self.wall.to_local(points @ self.turn + self.shift) + self.origin

    def direction_to_scan(self, directions: Array) -> Array:
        """(N, 3) directions, column frame to scan frame."""
        return directions @ self.turn @ self.wall.axes

    def place(self, height: float) -> tuple[float, float, float]:
        """The middle of the column at a height, scan frame."""
        x, y, z = self.to_scan(np.array([[0.0, 0.0, height]]))[0]
        return float(x), float(y), float(z)


@dataclass(frozen=True)
class Draft:
    """A column whose joints were found in both epochs (base, later) and not measured yet."""

    number: int
    bounds: tuple[float, float]
    frame: ColumnFrame
    points: tuple[Array, Array]
    """(N, 3) thinned, column frame, without what stands in front of the face."""
    faces: tuple[Face, Face]
    ahead: tuple[float, float]
    """Metres before the face, beyond which a return is of something else."""
    joints: tuple[list[FoundJoint], list[FoundJoint]]


def find_joints(
    number: int, bounds: tuple[float, float], base: Array, later: Array, wall: Wall, origin: Array, spacing: tuple[float, float]
) -> Draft | None:
    """A column between ``bounds`` [m along the wall] from thinned points (N, 3), wall frame; None where there are too few."""
    if min(len(base), len(later)) < LEAST_POINTS:
        return None
    frame = _column_frame(0.5 * (bounds[0] + bounds[1]), base, wall, origin)
    points, faces, ahead, joints = [], [], [], []
    for part, apart in zip((base, later), spacing, strict=True):
        own = frame.to_column(part)
        own = own[np.abs(own[:, 1]) < NEAR_M]
        if len(own) < LEAST_POINTS:
            return None
        face = trace_face(own)
        ahead.append(max(5 * face.noise, 0.03))
        own = own[face.residual < ahead[-1]]
        points.append(own)
        faces.append(trace_face(own))
        joints.append(horizontal_joints(own, faces[-1], apart))
    return Draft(
        number, bounds, frame, (points[0], points[1]), (faces[0], faces[1]), (ahead[0], ahead[1]), (joints[0], joints[1])
    )


def compare_column(
    draft: Draft, base: WallPoints, later: WallPoints, spacing: float, registration_sigma: float
) -> tuple[Column, DisplacementField]:
    """The column measured: ``base`` and ``later`` are all its returns near joints, ``spacing`` is that of thinned points."""
    frame = draft.frame
    epochs = [_with_returns(draft, k, part) for k, part in enumerate((base, later))]
    joints = _joints(draft, epochs, registration_sigma)
    z = epochs[0].points[:, 2]
    level = np.arange(z.min() + 0.5 * PROFILE_STEP_M, z.max(), PROFILE_STEP_M)
    profiles = [face_profile(face, level) for face in draft.faces]
    field = column_field(draft.number, epochs[0], epochs[1], spacing, registration_sigma)
    field = replace(field, points=frame.to_scan(field.points), normals=frame.direction_to_scan(field.normals))
    chance = [
        _chance([(j.vertical, j.vertical_sigma) for j in joints], registration_sigma),
        _chance([(j.lateral, j.lateral_sigma) for j in joints], registration_sigma),
    ]
    column = Column(
        draft.number, *draft.bounds, tuple(joints), level + frame.place(0.0)[2], profiles[0], profiles[1], *chance
    )
    return column, field


def _column_frame(middle: float, base: Array, wall: Wall, origin: Array) -> ColumnFrame:
    slope = np.polyfit(base[:, 0] - middle, base[:, 1], 1)[0] if np.ptp(base[:, 0]) > 0.2 else 0.0
    c, s = np.cos(np.arctan(slope)), np.sin(np.arctan(slope))
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return ColumnFrame(turn, np.array([middle, float(np.median(base[:, 1])), 0.0]), wall, origin)


def _with_returns(draft: Draft, side: int, part: WallPoints) -> ColumnPoints:
    returns, stations = draft.frame.to_column(part.points), draft.frame.to_column(part.stations)
    face = draft.faces[side]
    before = returns[:, 1] - np.interp(returns[:, 2], face.z, face.y)
    kept = np.flatnonzero((np.abs(returns[:, 1]) < NEAR_M) & (before < draft.ahead[side]))
    return ColumnPoints(draft.points[side], face, returns[kept], stations[part.station[kept]])


def _joints(draft: Draft, epochs: list[ColumnPoints], registration_sigma: float) -> list[JointDisplacement]:
    number, frame, found = draft.number, draft.frame, draft.joints
    middle = 0.5 * (draft.bounds[0] + draft.bounds[1])
    pairs = pair_joints(found[0], found[1])
    moves = measure_joints(joint_sections(
        epochs[0], epochs[1], [(found[0][i], found[1][k], _room(found, epochs, i, k)) for i, k in pairs]
    ))
    joints = []
    for (i, k), move in zip(pairs, moves, strict=True):
        first, second = found[0][i], found[1][k]
        spot = frame.place(move.height)
        joints.append(JointDisplacement(
            number, "PAIRED", middle, spot, spot[2], move.vertical, move.vertical_sigma, move.lateral, move.lateral_sigma,
            move.opening, move.opening_sigma, first.completeness, second.completeness,
            _significant(move.vertical, move.vertical_sigma, registration_sigma),
            _significant(move.lateral, move.lateral_sigma, registration_sigma),
        ))
    states: tuple[State, State] = ("MISSING", "NEW")
    for side, state in enumerate(states):
        taken = {pair[side] for pair in pairs}
        for row, joint in enumerate(found[side]):
            if row not in taken:
                spot = frame.place(joint.height)
                seen = (joint.completeness, 0.0) if side == 0 else (0.0, joint.completeness)
                joints.append(JointDisplacement(
                    number, state, middle, spot, spot[2], completeness_base=seen[0], completeness_later=seen[1]
                ))
    return sorted(joints, key=lambda j: j.height)


def _room(found: tuple[list[FoundJoint], ...], epochs: list[ColumnPoints], i: int, k: int) -> tuple[float, float]:
    """Free height below and above a joint in both epochs, to the next joint or the column's end [m]."""
    below, above = [], []
    for joints, row, epoch in ((found[0], i, epochs[0]), (found[1], k, epochs[1])):
        z = epoch.points[:, 2]
        low = joints[row - 1].height + 0.06 if row > 0 else float(z.min())
        high = joints[row + 1].height - 0.06 if row + 1 < len(joints) else float(z.max())
        below.append(joints[row].height - low)
        above.append(high - joints[row].height)
    return min(below), min(above)


def _significant(value: float | None, sigma: float | None, registration_sigma: float) -> bool | None:
    if value is None or sigma is None:
        return None
    return bool(abs(value) > QUANTILE * np.hypot(sigma, registration_sigma))


def _chance(displacements: list[tuple[float | None, float | None]], registration_sigma: float) -> float | None:
    """Probability that displacements as large as a column's joints show come from measurement and registration alone.

    d' C^-1 d is chi-square distributed with as many degrees of freedom as joints, when nothing moved; C has each joint's own
    variance on its diagonal, and the registration's, which all joints share, everywhere.
    """
    known = [(v, s) for v, s in displacements if v is not None and s is not None]
    if not known:
        return None
    d = np.array([v for v, _ in known])
    own = np.maximum([s for _, s in known], 1e-5)
    covariance = np.diag(own**2) + registration_sigma**2
    return float(chdtrc(len(d), d @ np.linalg.solve(covariance, d)))


