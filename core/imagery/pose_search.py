"""Kernels that look for a pose: lines matched with edges under a pose that is only coarsely known.

A hypothesis starts from the coarse pose with its covariance. One edge and one line that its gate allows are taken for each
other, which narrows the pose (a Kalman update) and with it the gates of all other edges; a few such steps fix the pose.
Every hypothesis is scored by how much of the visible edges it explains (a truncated score, MSAC). Each hypothesis draws
its numbers from its own seed, so results do not depend on the number of threads.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
NEAREST_M = 0.05
STEPS = 4
"""Matches of a hypothesis: eight conditions for six parameters."""
TRIES = 12
POLISH = 2
WIDE = 13.8
"""Chi-square of two degrees at 99.9 %."""


@njit(cache=True, nogil=True)
def turned(rotation: Floats, vector: Floats) -> Floats:
    """Rotation by a vector [rad] in the camera frame, applied after ``rotation`` (3, 3)."""
    angle = np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    if angle < 1e-15:
        return rotation.copy()
    x, y, z = vector[0] / angle, vector[1] / angle, vector[2] / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return (np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross)) @ rotation


@njit(cache=True, nogil=True)
def seen_edge(rotation: Floats, position: Floats, start: Floats, end: Floats, out: Floats) -> bool:
    """An edge in the camera frame (2, 3), cut at the nearest depth; False if none of it is in front."""
    out[0] = rotation @ (start - position)
    out[1] = rotation @ (end - position)
    if out[0, 2] < NEAREST_M and out[1, 2] < NEAREST_M:
        return False
    for k in range(2):
        if out[k, 2] < NEAREST_M:
            other = out[1 - k]
            share = (NEAREST_M - out[k, 2]) / (other[2] - out[k, 2])
            out[k] = out[k] + share * (other - out[k])
    return True


@njit(cache=True, nogil=True)
def line_residual(
    edge: Floats, rotation: Floats, inside: Floats, line: Floats, model_sigma: float, design: Floats, value: Floats,
    variance: Floats,
) -> float:
    """Places of a line's ends across a projected edge, with derivatives to the pose.

    ``edge`` (2, 3) camera frame; ``line`` x0, y0, x1, y1, sigma across, sigma of the direction; ``inside`` fx, fy, cx, cy.
    ``value`` (2,) [px] is how far the line's ends lie off the edge, ``variance`` (2,) of both without the pose. Returns the
    share of the line that lies along the edge, 0 to 1 (negative where they are turned away from each other).
    """
    fx, fy, cx, cy = inside[0], inside[1], inside[2], inside[3]
    p = np.empty((2, 2))
    jac = np.empty((2, 2, 6))
    for k in range(2):
        q = edge[k]
        p[k, 0], p[k, 1] = fx * q[0] / q[2] + cx, fy * q[1] / q[2] + cy
        a0, a2 = fx / q[2], -fx * q[0] / (q[2] * q[2])
        b1, b2 = fy / q[2], -fy * q[1] / (q[2] * q[2])
        # d q / d rotation = e x q; d q / d position = -R
        jac[k, 0, 0], jac[k, 0, 1], jac[k, 0, 2] = a2 * q[1], a0 * q[2] - a2 * q[0], -a0 * q[1]
        jac[k, 1, 0], jac[k, 1, 1], jac[k, 1, 2] = -b1 * q[2] + b2 * q[1], -b2 * q[0], b1 * q[0]
        for j in range(3):
            jac[k, 0, 3 + j] = -(a0 * rotation[0, j] + a2 * rotation[2, j])
            jac[k, 1, 3 + j] = -(b1 * rotation[1, j] + b2 * rotation[2, j])
    dx, dy = p[1, 0] - p[0, 0], p[1, 1] - p[0, 1]
    size = np.sqrt(dx * dx + dy * dy)
    if size < 1e-6:
        return -1.0
    tx, ty = dx / size, dy / size
    nx, ny = -ty, tx
    length = np.sqrt((line[2] - line[0]) ** 2 + (line[3] - line[1]) ** 2)
    if abs((line[2] - line[0]) * tx + (line[3] - line[1]) * ty) < 0.7 * length:
        return -1.0
    along = np.empty(2)
    mean_depth = 0.5 * (edge[0, 2] + edge[1, 2])
    model = (model_sigma * fx / mean_depth) ** 2
    for k in range(2):
        ex, ey = line[2 * k] - p[0, 0], line[2 * k + 1] - p[0, 1]
        along[k] = (ex * tx + ey * ty) / size
        value[k] = ex * nx + ey * ny
        share = along[k]
        for j in range(6):
            first = nx * jac[0, 0, j] + ny * jac[0, 1, j]
            second = nx * jac[1, 0, j] + ny * jac[1, 1, j]
            design[k, j] = (1.0 - share) * first + share * second
        variance[k] = model + line[4] ** 2 + (0.5 * length * line[5]) ** 2
    low, high = min(along[0], along[1]), max(along[0], along[1])
    common = min(high, 1.0) - max(low, 0.0)
    return common / max(high - low, 1e-9)


@njit(cache=True, nogil=True)
def _update(
    covariance: Floats, design: Floats, value: Floats, variance: Floats, shift: Floats, apply: bool
) -> float:
    """Chi-square of a match under a pose's covariance; if ``apply``, the Kalman update of ``covariance`` and ``shift``."""
    cross = covariance @ design.T
    s = design @ cross
    s[0, 0] += variance[0]
    s[1, 1] += variance[1]
    det = s[0, 0] * s[1, 1] - s[0, 1] * s[1, 0]
    if det <= 0.0:
        return 1e30
    i00, i01, i11 = s[1, 1] / det, -s[0, 1] / det, s[0, 0] / det
    y0 = i00 * value[0] + i01 * value[1]
    y1 = i01 * value[0] + i11 * value[1]
    chi = value[0] * y0 + value[1] * y1
    if apply:
        for j in range(6):
            shift[j] = cross[j, 0] * y0 + cross[j, 1] * y1
        gain = np.empty((6, 2))
        for j in range(6):
            gain[j, 0] = cross[j, 0] * i00 + cross[j, 1] * i01
            gain[j, 1] = cross[j, 0] * i01 + cross[j, 1] * i11
        covariance -= gain @ cross.T
    return chi


@njit(cache=True, nogil=True, parallel=True)
def gate(
    rotation: Floats, position: Floats, covariance: Floats, inside: Floats, start: Floats, end: Floats, lines: Floats,
    model_sigma: float, slack: float, limit: float,
) -> NDArray[np.bool_]:
    """(E, L) which lines an edge may be, under the pose's covariance; ``slack`` is how far a line may slip along [px]."""
    out = np.zeros((len(start), len(lines)), dtype=np.bool_)
    for e in prange(len(start)):
        edge = np.empty((2, 3))
        design, value, variance, shift = np.empty((2, 6)), np.empty(2), np.empty(2), np.empty(6)
        if not seen_edge(rotation, position, start[e], end[e], edge):
            continue
        size = np.hypot(
            inside[0] * (edge[0, 0] / edge[0, 2] - edge[1, 0] / edge[1, 2]),
            inside[1] * (edge[0, 1] / edge[0, 2] - edge[1, 1] / edge[1, 2]),
        )
        for k in range(len(lines)):
            length = np.hypot(lines[k, 2] - lines[k, 0], lines[k, 3] - lines[k, 1])
            common = line_residual(edge, rotation, inside, lines[k], model_sigma, design, value, variance)
            if common == -1.0 or length > size + 2.0 * slack:
                continue
            if common * length < min(length, size) - slack - 0.5 * min(length, size):
                continue
            if _update(covariance, design, value, variance, shift, False) <= limit:
                out[e, k] = True
    return out


@njit(cache=True, nogil=True)
def _random(state: Ints) -> float:
    """Uniform number of a small generator with its own state (1,)."""
    x = np.uint64(state[0])
    x ^= (x << np.uint64(13)) & np.uint64(0xFFFFFFFFFFFFFFFF)
    x ^= x >> np.uint64(7)
    x ^= (x << np.uint64(17)) & np.uint64(0xFFFFFFFFFFFFFFFF)
    state[0] = np.int64(x & np.uint64(0x7FFFFFFFFFFFFFFF))
    return float(x >> np.uint64(11)) / 9007199254740992.0


@njit(cache=True, nogil=True)
def score_pose(
    rotation: Floats, position: Floats, inside: Floats, start: Floats, end: Floats, lines: Floats, first: Ints, candidate: Ints,
    model_sigma: float, extra: float, limit: float, best: Ints,
) -> float:
    """How much of the edges a pose explains [px]: overlap with the best line, less the more it is off (MSAC).

    ``extra`` [px] is added to the tolerance, for a pose that is not yet exact; ``best`` (E,) gets the line of each edge.
    """
    total = 0.0
    edge = np.empty((2, 3))
    design, value, variance = np.empty((2, 6)), np.empty(2), np.empty(2)
    for e in range(len(start)):
        best[e] = -1
        if not seen_edge(rotation, position, start[e], end[e], edge):
            continue
        most = 0.0
        for c in range(first[e], first[e + 1]):
            k = candidate[c]
            common = line_residual(edge, rotation, inside, lines[k], model_sigma, design, value, variance)
            if common <= 0.2:
                continue
            off = max(
                value[0] ** 2 / (variance[0] + extra * extra), value[1] ** 2 / (variance[1] + extra * extra)
            )
            if off >= limit:
                continue
            length = np.hypot(lines[k, 2] - lines[k, 0], lines[k, 3] - lines[k, 1])
            worth = common * length * (1.0 - off / limit)
            if worth > most:
                most, best[e] = worth, k
        total += most
    return total


@njit(cache=True, nogil=True, parallel=True)
def search(
    rotation: Floats, position: Floats, covariance: Floats, inside: Floats, start: Floats, end: Floats, chance: Floats,
    lines: Floats, first: Ints, candidate: Ints, model_sigma: float, extra: float, limit: float, count: int, seed: int,
) -> tuple[Floats, Floats, Floats]:
    """``count`` hypotheses: their scores (H,), rotations (H, 3, 3) and positions (H, 3).

    ``chance`` (E,) sums up to where each edge is drawn; the lines of edge e are ``candidate[first[e]:first[e + 1]]``.
    """
    scores = np.zeros(count)
    rotations, positions = np.zeros((count, 3, 3)), np.zeros((count, 3))
    for h in prange(count):
        state = np.empty(1, dtype=np.int64)
        state[0] = (seed + 1) * 7919 + (h + 1) * 104729 + 88172645463325252
        for _ in range(5):
            _random(state)
        r, x, p = rotation.copy(), position.copy(), covariance.copy()
        edge = np.empty((2, 3))
        design, value, variance, shift = np.empty((2, 6)), np.empty(2), np.empty(2), np.empty(6)
        edges, chosen = np.full(STEPS, -1), np.full(STEPS, -1)
        taken = 0
        for _ in range(TRIES):
            if taken == STEPS:
                break
            e = int(np.searchsorted(chance, _random(state) * chance[-1]))
            e = min(e, len(start) - 1)
            again = False
            for t in range(taken):
                again |= edges[t] == e
            if again or first[e + 1] == first[e] or not seen_edge(r, x, start[e], end[e], edge):
                continue
            sum_of, pick = 0.0, -1
            for c in range(first[e], first[e + 1]):
                k = candidate[c]
                common = line_residual(edge, r, inside, lines[k], model_sigma, design, value, variance)
                if common == -1.0 or (taken >= 2 and common < 0.3):
                    continue
                variance += extra * extra
                chi = _update(p, design, value, variance, shift, False)
                if chi > WIDE:
                    continue
                worth = np.hypot(lines[k, 2] - lines[k, 0], lines[k, 3] - lines[k, 1]) * np.exp(-0.25 * chi)
                sum_of += worth
                if _random(state) * sum_of < worth:
                    pick = k
            if pick < 0:
                continue
            line_residual(edge, r, inside, lines[pick], model_sigma, design, value, variance)
            variance += extra * extra
            _update(p, design, value, variance, shift, True)
            r = turned(r, shift[:3].copy())
            x = x + shift[3:]
            edges[taken], chosen[taken] = e, pick
            taken += 1
        if taken < 3:
            continue
        _polish(rotation, position, covariance, inside, start, end, lines, model_sigma, edges[:taken], chosen[:taken], r, x)
        best = np.empty(len(start), dtype=np.int64)
        scores[h] = score_pose(
            r, x, inside, start, end, lines, first, candidate, model_sigma, extra, limit, best
        )
        rotations[h], positions[h] = r, x
    return scores, rotations, positions


@njit(cache=True, nogil=True)
def _turn_of(rotation: Floats) -> Floats:
    """Rotation vector (3,) of a rotation that is not far from half a turn's beginning."""
    trace = min(max((rotation[0, 0] + rotation[1, 1] + rotation[2, 2] - 1.0) / 2.0, -1.0), 1.0)
    angle = np.arccos(trace)
    axis = np.array([
        rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1],
    ])
    return axis * (0.5 if angle < 1e-7 else 0.5 * angle / np.sin(angle))


@njit(cache=True, nogil=True)
def _polish(
    rotation: Floats, position: Floats, covariance: Floats, inside: Floats, start: Floats, end: Floats, lines: Floats,
    model_sigma: float, edges: Ints, chosen: Ints, r: Floats, x: Floats,
) -> None:
    """Least squares over the chosen matches and the coarse pose; changes ``r`` and ``x``."""
    prior = np.linalg.inv(covariance)
    edge = np.empty((2, 3))
    design, value, variance = np.empty((2, 6)), np.empty(2), np.empty(2)
    for _ in range(POLISH):
        away = np.empty(6)
        away[:3] = _turn_of(rotation @ r.T)
        away[3:] = position - x
        normal, right = prior.copy(), prior @ away
        for t in range(len(edges)):
            e = edges[t]
            if not seen_edge(r, x, start[e], end[e], edge):
                continue
            if line_residual(edge, r, inside, lines[chosen[t]], model_sigma, design, value, variance) == -1.0:
                continue
            for k in range(2):
                w = 1.0 / variance[k]
                for i in range(6):
                    right[i] += w * design[k, i] * value[k]
                    for j in range(6):
                        normal[i, j] += w * design[k, i] * design[k, j]
        step = np.linalg.solve(normal, right)
        r[:] = turned(r, step[:3].copy())
        x += step[3:]


@njit(cache=True, nogil=True)
def refine(
    rotation: Floats, position: Floats, covariance: Floats, inside: Floats, start: Floats, end: Floats, lines: Floats,
    first: Ints, candidate: Ints, model_sigma: float, widths: Floats, limit: float,
) -> tuple[Floats, Floats, float]:
    """A pose from all edges and the line that is best for each, with a tolerance that shrinks over ``widths`` [px]."""
    prior = np.linalg.inv(covariance)
    r, x = rotation.copy(), position.copy()
    edge = np.empty((2, 3))
    design, value, variance = np.empty((2, 6)), np.empty(2), np.empty(2)
    best = np.empty(len(start), dtype=np.int64)
    for width in widths:
        score_pose(r, x, inside, start, end, lines, first, candidate, model_sigma, width, limit, best)
        normal, right = prior * 1e-2, np.zeros(6)
        for e in range(len(start)):
            if best[e] < 0 or not seen_edge(r, x, start[e], end[e], edge):
                continue
            line_residual(edge, r, inside, lines[best[e]], model_sigma, design, value, variance)
            for k in range(2):
                v = variance[k] + width * width
                w = max(1.0 - value[k] ** 2 / (v * limit), 0.0) ** 2 / v
                for i in range(6):
                    right[i] += w * design[k, i] * value[k]
                    for j in range(6):
                        normal[i, j] += w * design[k, i] * design[k, j]
        step = np.linalg.solve(normal, right)
        r = turned(r, step[:3].copy())
        x = x + step[3:]
    last = score_pose(r, x, inside, start, end, lines, first, candidate, model_sigma, widths[-1], limit, best)
    return r, x, last
