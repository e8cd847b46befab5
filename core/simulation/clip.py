"""Closed bodies of triangles cut by planes, with the cut faces closed."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SAME_M = 1e-9


def cut_away(corners: Array, direction: Array, low: float, high: float) -> Array:
    """(K, 3, 3) what is left of a closed body (T, 3, 3) without its part between two heights along a unit vector [m].

    An infinite height takes an end away.
    """
    parts = [np.zeros((0, 3, 3))]
    if math.isfinite(low):
        parts.append(keep_below(corners, direction, low))
    if math.isfinite(high):
        parts.append(keep_below(corners, -direction, -high))
    return np.concatenate(parts)


def keep_below(corners: Array, direction: Array, height: float) -> Array:
    """(K, 3, 3) the part of a closed body (T, 3, 3) up to a height along a unit vector [m]."""
    above = corners @ direction - height
    above = np.where(np.abs(above) < SAME_M, -SAME_M, above)
    out = above > 0
    kept = [corners[~out.any(axis=1)]]
    section = []
    for corner, level in zip(*(v[out.any(axis=1) & ~out.all(axis=1)] for v in (corners, above)), strict=True):
        ring, crossing = [], []
        for n in range(3):
            p, q, a, b = corner[n], corner[(n + 1) % 3], level[n], level[(n + 1) % 3]
            if a <= 0:
                ring.append(p)
            if (a <= 0) != (b <= 0):
                crossing.append(p + a / (a - b) * (q - p))
                ring.append(crossing[-1])
        kept.append(np.array([[ring[0], ring[n], ring[n + 1]] for n in range(1, len(ring) - 1)]))
        section.append(crossing)
    return np.concatenate([*kept, _cap(np.array(section).reshape(-1, 2, 3), direction)])


def body_volume(corners: Array) -> float:
    """m3 inside closed surfaces (T, 3, 3), outward."""
    if not len(corners):
        return 0.0
    a, b, c = (corners[:, n] - corners[0, 0] for n in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


def _cap(section: Array, direction: Array) -> Array:
    """(K, 3, 3) the plane figure inside segments (S, 2, 3), facing ``direction``: between neighbouring ends of segments
    it is trapezoids."""
    if not len(section):
        return np.zeros((0, 3, 3))
    u = np.cross(direction, np.eye(3)[int(np.argmin(np.abs(direction)))])
    u /= np.linalg.norm(u)
    v = np.cross(direction, u)
    origin = section[0, 0]
    place = (section - origin) @ np.stack([u, v], axis=1)
    ends = np.unique(np.round(place[..., 0], 9))
    found = []
    for left, right in itertools.pairwise(ends):
        middle = (left + right) / 2
        across = place[(place[..., 0].min(axis=1) < middle) & (place[..., 0].max(axis=1) > middle)]
        slope = (across[:, 1, 1] - across[:, 0, 1]) / (across[:, 1, 0] - across[:, 0, 0])
        at = across[:, 0, 1] + slope * (np.array([[left], [middle], [right]]) - across[:, 0, 0])
        at = at[:, np.argsort(at[1])]
        for n in range(0, at.shape[1] - 1, 2):
            quad = [(left, at[0, n]), (right, at[2, n]), (right, at[2, n + 1]), (left, at[0, n + 1])]
            ring = [origin + x * u + y * v for x, y in quad]
            found += [ring[:3], [ring[0], ring[2], ring[3]]]
    return np.array(found).reshape(-1, 3, 3)
