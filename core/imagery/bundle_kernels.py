"""Kernels of the bundle adjustment: projection with analytic derivatives, reduced normal equations, covariances.

Observations are sorted by point. Points are taken in a number of chunks that the block's size decides, and their sums are
added in order, so results do not depend on the number of threads.

``slot`` (C, 14) says where each camera's parameters stand among the free ones; -1 for those that are fixed.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

POSE = 6
INSIDE = 8
"""Relative focal length, principal point (2), k1, k2, p1, p2, k3."""
OWN = POSE + INSIDE
FEW = 1e-12

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@njit(cache=True, nogil=True)
def project(
    rotation: Floats, position: Floats, inside: Floats, point: Floats, pixel: Floats, to_own: Floats, to_point: Floats
) -> bool:
    """Distorted pixel (2,) of a point and its derivatives (2, 14) and (2, 3); False behind the camera.

    ``inside`` holds fx, fy, cx, cy, k1, k2, p1, p2, k3. The pose's parameters are a rotation vector in the camera frame and
    the position in the world.
    """
    d = point - position
    q = rotation @ d
    if q[2] <= FEW:
        return False
    fx, fy, k1, k2, p1, p2, k3 = inside[0], inside[1], inside[4], inside[5], inside[6], inside[7], inside[8]
    x, y = q[0] / q[2], q[1] / q[2]
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = k1 + r2 * (2.0 * k2 + 3.0 * k3 * r2)
    xd = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
    yd = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
    pixel[0], pixel[1] = fx * xd + inside[2], fy * yd + inside[3]
    xx = radial + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x
    xy = 2.0 * x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y
    yy = radial + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x
    to_q = np.empty((2, 3))
    to_q[0, 0], to_q[0, 1] = fx * xx / q[2], fx * xy / q[2]
    to_q[1, 0], to_q[1, 1] = fy * xy / q[2], fy * yy / q[2]
    to_q[0, 2] = -(to_q[0, 0] * x + to_q[0, 1] * y)
    to_q[1, 2] = -(to_q[1, 0] * x + to_q[1, 1] * y)
    for i in range(2):
        to_own[i, 0] = to_q[i, 2] * q[1] - to_q[i, 1] * q[2]
        to_own[i, 1] = to_q[i, 0] * q[2] - to_q[i, 2] * q[0]
        to_own[i, 2] = to_q[i, 1] * q[0] - to_q[i, 0] * q[1]
        for j in range(3):
            value = to_q[i, 0] * rotation[0, j] + to_q[i, 1] * rotation[1, j] + to_q[i, 2] * rotation[2, j]
            to_point[i, j] = value
            to_own[i, 3 + j] = -value
    to_own[0, 6], to_own[1, 6] = fx * xd, fy * yd
    to_own[0, 7], to_own[1, 7] = 1.0, 0.0
    to_own[0, 8], to_own[1, 8] = 0.0, 1.0
    to_own[0, 9], to_own[1, 9] = fx * x * r2, fy * y * r2
    to_own[0, 10], to_own[1, 10] = fx * x * r2 * r2, fy * y * r2 * r2
    to_own[0, 11], to_own[1, 11] = fx * 2.0 * x * y, fy * (r2 + 2.0 * y * y)
    to_own[0, 12], to_own[1, 12] = fx * (r2 + 2.0 * x * x), fy * 2.0 * x * y
    to_own[0, 13], to_own[1, 13] = fx * x * r2 * r2 * r2, fy * y * r2 * r2 * r2
    return True


@njit(cache=True, nogil=True, parallel=True)
def residuals(
    rotations: Floats, positions: Floats, insides: Floats, inside_of: Ints, points: Floats,
    camera: Ints, point: Ints, pixel: Floats,
) -> Floats:
    """Computed minus observed pixels (N, 2); NaN behind a camera."""
    out = np.empty((len(camera), 2))
    for k in prange(len(camera)):
        c = camera[k]
        found, own, to_point = np.empty(2), np.empty((2, OWN)), np.empty((2, 3))
        if project(rotations[c], positions[c], insides[inside_of[c]], points[point[k]], found, own, to_point):
            out[k] = found - pixel[k]
        else:
            out[k] = np.nan
    return out


@njit(cache=True, nogil=True)
def _fill(
    first: int, last: int, rotations: Floats, positions: Floats, insides: Floats, inside_of: Ints, here: Floats,
    camera: Ints, pixel: Floats, weight: Floats, own: Floats, to_point: Floats, left: Floats,
) -> None:
    """Weighted derivatives and residuals (observed minus computed) of one point's observations."""
    found = np.empty(2)
    for k in range(first, last):
        c = camera[k]
        a, b = own[k - first], to_point[k - first]
        if weight[k] > 0.0 and project(rotations[c], positions[c], insides[inside_of[c]], here, found, a, b):
            root = np.sqrt(weight[k])
            for i in range(2):
                left[k - first, i] = root * (pixel[k, i] - found[i])
            a *= root
            b *= root
        else:
            a[:] = 0.0
            b[:] = 0.0
            left[k - first] = 0.0


@njit(cache=True, nogil=True, parallel=True)
def reduced_normals(
    rotations: Floats, positions: Floats, insides: Floats, inside_of: Ints, points: Floats,
    first_of: Ints, camera: Ints, pixel: Floats, weight: Floats, known: Floats, pull: Floats, damping: float,
    slot: Ints, total: int, most: int, chunks: int,
) -> tuple[Floats, Floats, Floats, Floats]:
    """Schur complement over the points: sums per chunk (chunks, T, T), (chunks, T), and V^-1 (M, 3, 3), V^-1 g (M, 3).

    ``known`` (M, 3, 3) and ``pull`` (M, 3) are what control says of the points.
    """
    count = len(points)
    normal, right = np.zeros((chunks, total, total)), np.zeros((chunks, total))
    inverse, shift = np.zeros((count, 3, 3)), np.zeros((count, 3))
    for chunk in prange(chunks):
        own, to_point, left = np.empty((most, 2, OWN)), np.empty((most, 2, 3)), np.empty((most, 2))
        cross = np.empty((most, OWN, 3))
        for p in range(count * chunk // chunks, count * (chunk + 1) // chunks):
            first, last = first_of[p], first_of[p + 1]
            size = last - first
            _fill(first, last, rotations, positions, insides, inside_of, points[p], camera, pixel, weight, own, to_point, left)
            v, g = known[p].copy(), pull[p].copy()
            for k in range(size):
                v += to_point[k].T @ to_point[k]
                g += to_point[k].T @ left[k]
            for i in range(3):
                v[i, i] += damping * v[i, i] + 1e-30
            inv = np.linalg.inv(v)
            inverse[p] = inv
            moved = inv @ g
            shift[p] = moved
            for k in range(size):
                cross[k] = own[k].T @ to_point[k]
            for k in range(size):
                c = camera[first + k]
                block = own[k].T @ own[k]
                side = own[k].T @ left[k] - cross[k] @ moved
                for i in range(OWN):
                    a = slot[c, i]
                    if a < 0:
                        continue
                    right[chunk, a] += side[i]
                    for j in range(OWN):
                        if slot[c, j] >= 0:
                            normal[chunk, a, slot[c, j]] += block[i, j]
                half = cross[k] @ inv
                for m in range(size):
                    d = camera[first + m]
                    block = half @ cross[m].T
                    for i in range(OWN):
                        a = slot[c, i]
                        if a < 0:
                            continue
                        for j in range(OWN):
                            if slot[d, j] >= 0:
                                normal[chunk, a, slot[d, j]] -= block[i, j]
    return normal, right, inverse, shift


@njit(cache=True, nogil=True, parallel=True)
def back_substitute(
    rotations: Floats, positions: Floats, insides: Floats, inside_of: Ints, points: Floats,
    first_of: Ints, camera: Ints, pixel: Floats, weight: Floats, inverse: Floats, shift: Floats, step: Floats,
    slot: Ints, most: int, chunks: int,
) -> Floats:
    """How far each point moves (M, 3) when the cameras' parameters move by ``step`` (T,)."""
    out = np.empty_like(points)
    for chunk in prange(chunks):
        own, to_point, left = np.empty((most, 2, OWN)), np.empty((most, 2, 3)), np.empty((most, 2))
        local = np.empty(OWN)
        for p in range(len(points) * chunk // chunks, len(points) * (chunk + 1) // chunks):
            first, last = first_of[p], first_of[p + 1]
            _fill(first, last, rotations, positions, insides, inside_of, points[p], camera, pixel, weight, own, to_point, left)
            g = np.zeros(3)
            for k in range(last - first):
                c = camera[first + k]
                for i in range(OWN):
                    local[i] = step[slot[c, i]] if slot[c, i] >= 0 else 0.0
                g += to_point[k].T @ (own[k] @ local)
            out[p] = shift[p] - inverse[p] @ g
    return out


@njit(cache=True, nogil=True, parallel=True)
def point_covariances(
    rotations: Floats, positions: Floats, insides: Floats, inside_of: Ints, points: Floats,
    first_of: Ints, camera: Ints, pixel: Floats, weight: Floats, inverse: Floats, covariance: Floats,
    slot: Ints, most: int, chunks: int,
) -> tuple[Floats, Floats]:
    """Covariance of every point (M, 3, 3), and of every observation what the estimate takes of its variance (N, 2).

    The second is the diagonal of J Sigma J^T with weighted derivatives: one minus it is the redundancy number.
    """
    count = len(points)
    out, taken = np.empty((count, 3, 3)), np.zeros((len(camera), 2))
    for chunk in prange(chunks):
        own, to_point, left = np.empty((most, 2, OWN)), np.empty((most, 2, 3)), np.empty((most, 2))
        for p in range(count * chunk // chunks, count * (chunk + 1) // chunks):
            first, last = first_of[p], first_of[p + 1]
            size = last - first
            _fill(first, last, rotations, positions, insides, inside_of, points[p], camera, pixel, weight, own, to_point, left)
            cross = np.zeros((size * OWN, 3))
            sigma = np.empty((size * OWN, size * OWN))
            for k in range(size):
                cross[k * OWN : (k + 1) * OWN] = own[k].T @ to_point[k]
                c = camera[first + k]
                for m in range(size):
                    d = camera[first + m]
                    for i in range(OWN):
                        a = slot[c, i]
                        for j in range(OWN):
                            b = slot[d, j]
                            sigma[k * OWN + i, m * OWN + j] = covariance[a, b] if a >= 0 and b >= 0 else 0.0
            with_point = -(sigma @ cross) @ inverse[p]
            out[p] = inverse[p] - inverse[p] @ (cross.T @ with_point)
            for k in range(size):
                rows = slice(k * OWN, (k + 1) * OWN)
                for i in range(2):
                    u, w = own[k, i], to_point[k, i]
                    variance = u @ (sigma[rows, rows].copy() @ u) + 2.0 * (u @ (with_point[rows].copy() @ w)) + w @ (out[p] @ w)
                    taken[first + k, i] = variance
    return out, taken
