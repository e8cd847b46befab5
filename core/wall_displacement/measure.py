"""Joints of two epochs paired and measured, column by column."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .columns import Face, FoundJoint
from .edge_section import Samples
from .edges import LEAST_NOISE_M, Edge, Flanks, choose_flank, fit_edges
from .epoch import spread_rows
from .face_lines import FaceLine, FacePart, fit_faces

Array = NDArray[np.float64]
LARGEST_MOVE_M = 0.25
NEAR_FACE_M = 0.06
FAR_FACE_M = 0.7
EDGE_REACH_M = 0.12
EDGE_RANGE_M = (-0.1, 0.04)
"""Heights about a joint between which its lower edge is looked for (its upper one mirrored)."""
BEYOND_M = 0.15
"""A ray that crosses the face near a joint may come back from so much higher or lower."""
MOST_NEAR_EDGE = 40_000
STEPPED_M = 0.002
"""Panels that stand so far before or behind the next one are taken for stepped."""
MOST_RELIEF = 0.8
NOT_DETERMINED_M = 0.02
"""A joint's height that is less certain than this is not stated."""


@dataclass(frozen=True)
class ColumnPoints:
    """A column in one epoch, column frame: thinned points (N, 3) with their face, and all returns (M, 3) near its joints."""

    points: Array
    face: Face
    returns: Array
    station: Array
    """(M, 3) where each return was measured from; NaN: not known."""


@dataclass(frozen=True)
class Movement:
    """Of one paired joint [m]."""

    height: float
    vertical: float | None
    vertical_sigma: float | None
    lateral: float | None
    lateral_sigma: float | None
    opening: float | None
    opening_sigma: float | None


def pair_joints(base: list[FoundJoint], later: list[FoundJoint]) -> list[tuple[int, int]]:
    """Pairs of rows, in order of height: the most pairs about one common shift, each near it.

    The shift is voted for among those smaller than ``LARGEST_MOVE_M`` and 45 % of the panels' height; where votes are
    equal the smaller shift wins, so a joint of a new panel is not taken for an old one.
    """
    if not base or not later:
        return []
    b, n = np.array([j.height for j in base]), np.array([j.height for j in later])
    pitch = float(np.median(np.diff(b))) if len(b) > 1 else float(np.median(np.diff(n))) if len(n) > 1 else 1.0
    most = min(LARGEST_MOVE_M, 0.45 * pitch)
    shifts = (n[None, :] - b[:, None]).ravel()
    shifts = shifts[np.abs(shifts) < most]
    if not len(shifts):
        return []
    loose = min(0.08, 0.2 * pitch)
    votes = [np.sum(np.maximum(1 - np.abs(shifts - s) / loose, 0.0)) - 0.5 * abs(s) / most for s in shifts]
    common = float(shifts[int(np.argmax(votes))])
    pairs, used = [], -1
    for i in range(len(b)):
        away = np.abs(n - b[i] - common)
        away[: used + 1] = np.inf
        k = int(np.argmin(away))
        if away[k] < loose + 0.5 * abs(common) and abs(n[k] - b[i]) < most:
            pairs.append((i, k))
            used = k
    return pairs


@dataclass(frozen=True)
class JointSection:
    """A paired joint in both epochs (base, later): lines of the face below and above, samples of the lower and upper edge."""

    joints: tuple[FoundJoint, FoundJoint]
    lines: tuple[tuple[FaceLine | None, FaceLine | None], ...]
    samples: tuple[tuple[Samples | None, Samples | None], ...]
    """By edge, then by epoch."""


def joint_sections(
    base: ColumnPoints, later: ColumnPoints, pairs: Sequence[tuple[FoundJoint, FoundJoint, tuple[float, float]]]
) -> list[JointSection]:
    """What both epochs show of the paired joints of a column.

    A pair is a joint of each epoch and the free height [m] below and above it, to the next joints.
    """
    epochs = (base, later)
    parts = []
    for first, second, room in pairs:
        for epoch, joint in zip(epochs, (first, second), strict=True):
            parts.append(face_part(epoch, joint.height - min(FAR_FACE_M, room[0]), joint.height - NEAR_FACE_M, joint.height))
            parts.append(face_part(epoch, joint.height + NEAR_FACE_M, joint.height + min(FAR_FACE_M, room[1]), joint.height))
    found = iter(fit_faces(parts, max(base.face.noise, later.face.noise)))
    sections = []
    for first, second, room in pairs:
        lines, lower, upper = [], [], []
        reach = min(EDGE_REACH_M, 0.4 * min(room))
        for epoch, joint in zip(epochs, (first, second), strict=True):
            below, above = next(found), next(found)
            lines.append((below, above))
            lower.append(edge_samples(epoch, below, above, joint.height, reach, rising=True))
            upper.append(edge_samples(epoch, above, below, joint.height, reach, rising=False))
        sections.append(JointSection((first, second), tuple(lines), ((lower[0], lower[1]), (upper[0], upper[1]))))
    return sections


def measure_joints(sections: Sequence[JointSection]) -> list[Movement]:
    """Movements of the joints of one column, whose edges are alike."""
    wanted = [(k, side) for k, section in enumerate(sections) for side in (0, 1) if None not in section.samples[side]]
    rows = {(k, side, epoch): 2 * n + epoch for n, (k, side) in enumerate(wanted) for epoch in (0, 1)}
    measured = [s for k, side in wanted for s in sections[k].samples[side] if s is not None]
    mates = [rows.get((k, 1 - side, epoch)) for k, side, epoch in rows]
    flanks, measured = choose_flank(measured, mates, *EDGE_RANGE_M)
    fitted = iter(fit_edges(measured, flanks, *EDGE_RANGE_M))
    edges: list[list[list[Edge] | None]] = [[None, None] for _ in sections]
    for k, side in wanted:
        sign = 1.0 if side == 0 else -1.0
        edges[k][side] = [
            Edge(joint.height + sign * edge.at, edge.sigma, joint.height + sign * edge.others)
            for joint, edge in zip(sections[k].joints, (next(fitted), next(fitted)), strict=True)
        ]
    return [_movement(s.lines, e, flanks, *s.joints) for s, e in zip(sections, edges, strict=True)]


def _movement(
    lines: Sequence[Sequence[FaceLine | None]], edges: list[list[Edge] | None], flanks: Flanks,
    first: FoundJoint, second: FoundJoint,
) -> Movement:
    shifts = [(e[1].at - e[0].at, float(np.hypot(e[0].sigma, e[1].sigma))) for e in edges if e is not None]
    vertical = sigma = opening = opening_sigma = None
    if shifts:
        weight = 1.0 / np.maximum([s for _, s in shifts], 2e-4) ** 2
        even = len(shifts) == 2 and max(s for _, s in shifts) < 2.5 * min(s for _, s in shifts) + 5e-4
        share = np.full(2, 0.5) if even else weight / weight.sum()
        vertical = float(np.dot(share, [d for d, _ in shifts]))
        # the flank is common to all edges: what another one would give for the whole movement
        others = np.dot(share, [e[1].others - e[0].others for e in edges if e is not None])
        by_flank = float(np.dot(flanks.probability[1:], (others - vertical) ** 2))
        sigma = float(np.sqrt(np.dot(share**2, [s**2 for _, s in shifts]) + by_flank))
        if sigma > NOT_DETERMINED_M:
            vertical = sigma = None
    if len(shifts) == 2:
        opening = shifts[1][0] - shifts[0][0]
        lower, upper = (e[1].others - e[0].others for e in edges if e is not None)
        by_flank = float(np.dot(flanks.probability[1:], (upper - lower - opening) ** 2))
        opening_sigma = math.sqrt(shifts[0][1] ** 2 + shifts[1][1] ** 2 + by_flank)
    middles = []
    for k, joint in ((0, first), (1, second)):
        ends = [e[k].at for e in edges if e is not None]
        middles.append(float(np.mean(ends)) if ends else joint.height)
    sides = []
    for side in (0, 1):
        a, b = lines[0][side], lines[1][side]
        if a is not None and b is not None:
            change = float(b.depth(middles[1])) - float(a.depth(middles[0]))
            sides.append((change, float(np.hypot(a.sigma, b.sigma))))
    lateral = float(np.mean([d for d, _ in sides])) if sides else None
    lateral_sigma = float(np.sqrt(np.sum([s**2 for _, s in sides])) / len(sides)) if sides else None
    return Movement(middles[0], vertical, sigma, lateral, lateral_sigma, opening, opening_sigma)


def face_part(epoch: ColumnPoints, low: float, high: float, about: float) -> FacePart:
    """The face's points between two heights."""
    inside = (epoch.points[:, 2] > low) & (epoch.points[:, 2] < high) & (np.abs(epoch.face.residual) < 0.05)
    x, y, z = epoch.points[inside].T
    return FacePart(x, y, z, about)


def edge_samples(
    epoch: ColumnPoints, line: FaceLine | None, next_line: FaceLine | None, about: float, reach: float, *, rising: bool
) -> Samples | None:
    """Where rays cross the plane of the face within ``reach`` of ``about``, and how deep behind it they come back.

    Only up to the recess between this face and the next panel's, which may stand before or behind it.
    """
    if line is None:
        return None
    near = np.flatnonzero(np.abs(epoch.returns[:, 2] - about) < reach + BEYOND_M)
    near = near[spread_rows(len(near), MOST_NEAR_EDGE)]
    p, s = epoch.returns[near], epoch.station[near]
    ray = p - s
    with np.errstate(divide="ignore", invalid="ignore"):
        toward = ray[:, 1] - line.slope * ray[:, 2]
        share = (line.at + line.slope * (s[:, 2] - about) - s[:, 1]) / toward
        climb = -ray[:, 2] / toward
    v = np.where(np.isfinite(share), s[:, 2] + share * ray[:, 2], p[:, 2]) - about
    x, depth = p[:, 0], np.asarray(line.depth(p[:, 2])) - p[:, 1]
    deep = max(epoch.face.threshold, 0.004)
    recessed = depth > 0.5 * deep
    if next_line is not None and abs(float(line.depth(about)) - float(next_line.depth(about))) > STEPPED_M:
        # grooves of two faces that stand in one plane lie on both sides alike; here those of one would outweigh the others
        recessed = np.minimum(depth, np.asarray(next_line.depth(p[:, 2])) - p[:, 1]) > deep
    side = (v < 0.04 if rising else v > -0.04) & (np.abs(v) < reach)
    if (recessed & side).sum() < 2 or (~recessed & side).sum() < 4:
        return None
    sign = 1.0 if rising else -1.0
    # only up to the middle of the recess: beyond it the other edge begins
    middle = float(np.median(sign * v[(np.abs(v) < reach) & recessed]))
    own = side & (sign * v < middle + 1e-9)
    if not (recessed & own).any():
        return None
    # relief lies behind the front, so what is before it says how much single returns scatter
    face = depth[own & (sign * v < -NEAR_FACE_M)]
    before = -face[face < 0]
    noise = max(float(np.median(before)) / np.log(2.0) if len(before) else epoch.face.noise, LEAST_NOISE_M)
    behind = face[(face > 5.0 * noise) & (face < 2.0 * deep)]
    rough = min(len(behind) / len(face), MOST_RELIEF) if len(face) else 0.0
    groove = float(np.median(behind)) if len(behind) else 0.5 * deep
    groove_noise = max(float(np.mean(np.abs(behind - groove))), noise) if len(behind) else deep
    # at the edge, not over all the face
    known = climb[own & recessed & np.isfinite(climb)]
    rise = sign * float(np.median(known)) if len(known) else 0.0
    deepest = float(np.quantile(depth[own], 0.98))
    return Samples(
        sign * v[own], depth[own], x[own], rise, sign * line.slope, noise, deep, rough, groove, groove_noise, deepest,
        line.sigma,
    )
