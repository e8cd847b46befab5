"""Upright planes of a storey, as lines in plan with the side from which they were seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..planes.surfels import Surfels
from .face_points import EDGE_M, surface_pieces, surface_returns

Array = NDArray[np.float64]

UPRIGHT = 0.17
"""Largest vertical part of a wall's normal (10 degrees)."""
ROUGHEST_M = 0.012
LEAST_PLANAR = 0.2
SEED_CELL_M = 0.3
SEED_SECTORS = 36
REACH_M = 0.014
"""A surfel this close to a line belongs to it."""
TAKEN_M = 0.025
"""Surfels this close to a found line, turned as it is, start no other line, if they lie on the same surface."""
STEP_M = 0.008
"""A lean or a bulge goes on; beyond a step between neighbouring places of a wall a board or a lining begins, or ends."""
SAME_COS = np.cos(np.radians(12.0))
TURNED = np.sin(np.radians(3.0))
"""Mean turn of the normals in a window of a line beyond which they belong to another surface."""
ON_LINE_M = 0.003
"""Of lines through a wall with steps the one with most area so close to it counts, the more the closer."""
MORE = 1.03
LEAST_PIECE = 0.05
"""Of a wall's area: the second piece of one that has a step."""
PIECES = 3
"""Lines are tried through this many of its largest pieces without a step."""
LEAST_AREA_M2 = 0.12
MOST_FACES = 1500


@dataclass(frozen=True)
class Face:
    """An upright plane: normal . (x, y) = offset; ``normal`` points to those who saw it."""

    normal: Array
    """(2,) unit vector."""
    offset: float
    u: Array
    """(M,) places of its surfels along ``along`` [m]."""
    z: Array
    area: Array

    @property
    def along(self) -> Array:
        """(2,) unit vector along the line, the normal turned by -90 degrees."""
        return np.array([self.normal[1], -self.normal[0]])

    def point(self, u: float) -> Array:
        """(2,) place on the line."""
        return self.normal * self.offset + self.along * u


def upright_surfels(surfels: Surfels, low: float, high: float) -> Surfels:
    """Those of upright surfaces between two heights."""
    z = surfels.position[:, 2]
    return surfels.where(
        (np.abs(surfels.normal[:, 2]) < UPRIGHT) & (z > low) & (z < high)
        & (surfels.roughness < ROUGHEST_M) & (surfels.planarity < LEAST_PLANAR)
    )  # fmt: skip


def find_faces(upright: Surfels) -> list[Face]:
    """Lines, each grown from the place of most support, best first."""
    if not len(upright):
        return []
    xy = upright.position[:, :2]
    normal = upright.normal[:, :2] / np.linalg.norm(upright.normal[:, :2], axis=1, keepdims=True)
    area, z = upright.area, upright.position[:, 2]
    low = xy.min(axis=0)
    cell = ((xy - low) / SEED_CELL_M).astype(np.int64)
    sector = (np.arctan2(normal[:, 1], normal[:, 0]) / (2 * np.pi) * SEED_SECTORS).astype(np.int64) % SEED_SECTORS
    columns = int(cell[:, 1].max()) + 1
    key = (cell[:, 0] * columns + cell[:, 1]) * SEED_SECTORS + sector
    used, inverse = np.unique(key, return_inverse=True)
    inverse = inverse.ravel()
    members = np.argsort(inverse, kind="stable")
    begin = np.searchsorted(inverse[members], np.arange(len(used) + 1))
    left = area.copy()
    support = np.bincount(inverse, left)
    faces: list[Face] = []
    while len(faces) < MOST_FACES:
        best = int(np.argmax(support))
        if support[best] < 0.5 * LEAST_AREA_M2:
            break
        seed = members[begin[best] : begin[best + 1]]
        seed = seed[left[seed] > 0]
        line = _grow(xy, z, normal, left, seed) if len(seed) >= 4 else None
        if line is None:
            support[best] = 0.0
            continue
        n, c, inside = line
        near = np.flatnonzero((np.abs(xy @ n - c) < TAKEN_M) & (normal @ n > SAME_COS) & (left > 0))
        near = near[_same_surface(xy[near], z[near], n, c)]
        if not np.isin(near, seed).any():
            support[best] = 0.0
        np.subtract.at(support, inverse[near], left[near])
        left[near] = 0.0
        inside = _consistent(xy, normal, area, n, inside)
        if len(inside) and area[inside].sum() >= LEAST_AREA_M2:
            along = np.array([n[1], -n[0]])
            faces.append(Face(n, float(c), xy[inside] @ along, z[inside], area[inside]))
    return faces


def _same_surface(xy: Array, z: Array, n: Array, c: float) -> NDArray[np.bool_]:
    """(N,) whether surfels near a line are its own: within reach, or beyond it where the surface leans or bulges."""
    off = xy @ n - c
    own = np.abs(off) < REACH_M
    if own.all() or not own.any():
        return own
    at = np.column_stack([xy @ np.array([n[1], -n[0]]), z])
    outline = np.stack([at.min(axis=0) - 2 * EDGE_M, at.max(axis=0) + 2 * EDGE_M])
    return np.asarray(own | surface_returns(at, off, REACH_M, outline, step=STEP_M))


def _consistent(xy: Array, normal: Array, area: Array, n: Array, inside: NDArray[np.int64]) -> NDArray[np.int64]:
    """Without the places where another surface merely crosses the line: there normals are turned, all the same way."""
    along = np.array([n[1], -n[0]])
    u = xy[inside] @ along
    window = ((u - u.min()) / SEED_CELL_M).astype(np.int64)
    weight = np.bincount(window, area[inside])
    turn = np.bincount(window, area[inside] * (normal[inside] @ along)) / np.maximum(weight, 1e-12)
    return inside[(np.abs(turn) < TURNED)[window]]


def _grow(
    xy: Array, z: Array, normal: Array, left: Array, seed: NDArray[np.int64]
) -> tuple[Array, float, NDArray[np.int64]] | None:
    n = normal[seed].mean(axis=0)
    n /= np.linalg.norm(n)
    at = xy[seed] @ n
    order = np.sort(at)
    width = np.searchsorted(order, order + 0.02) - np.arange(len(order))
    c = float(order[np.argmax(width)]) + 0.01
    centre = xy[seed].mean(axis=0)
    free = np.flatnonzero((left > 0) & (normal @ n > SAME_COS - 0.05))
    reach, tolerance = 0.5, 0.02
    members = seed
    for _ in range(12):
        along = np.array([n[1], -n[0]])
        place = xy[free] - centre
        chosen = (np.abs(xy[free] @ n - c) < tolerance) & (np.abs(place @ along) < reach)
        chosen &= normal[free] @ n > SAME_COS
        members = free[chosen]
        if len(members) < 4:
            return None
        n, c = _fitted(xy[members], left[members], n)
        tolerance = REACH_M
        if reach > 200:
            break
        reach *= 2.0
    near = free[(np.abs(xy[free] @ n - c) < TAKEN_M) & (normal[free] @ n > SAME_COS)]
    better = _through_most(xy[near], z[near], left[near], n, c)
    if better is not None:
        n, c = better
        members = free[(np.abs(xy[free] @ n - c) < REACH_M) & (normal[free] @ n > SAME_COS)]
    return (n, c, members) if len(members) else None


def _fitted(xy: Array, weight: Array, towards: Array) -> tuple[Array, float]:
    """Normal and offset of the line through places."""
    mean = weight @ xy / weight.sum()
    q = (xy - mean) * np.sqrt(weight)[:, None]
    n = np.linalg.eigh(q.T @ q)[1][:, 0]
    n = n if n @ towards > 0 else -n
    return n, float(n @ mean)


def _through_most(xy: Array, z: Array, area: Array, n: Array, c: float) -> tuple[Array, float] | None:
    """The line through one of the pieces that steps part a wall into, if more of the wall lies on it; else None."""

    def close(normal: Array, offset: float) -> Array:
        return np.asarray(np.maximum(1.0 - ((xy @ normal - offset) / ON_LINE_M) ** 2, 0.0))

    piece = surface_pieces(np.column_stack([xy @ np.array([n[1], -n[0]]), z]), xy @ n, STEP_M)
    weight = np.bincount(piece + 1, area)[1:]
    largest = np.argsort(-weight)[:PIECES]
    if len(largest) < 2 or weight[largest[1]] < LEAST_PIECE * weight.sum():
        return None
    best, most = None, MORE * float(area @ close(n, c))
    for number in largest[weight[largest] > 0]:
        own = piece == number
        line = _fitted(xy[own], area[own], n)
        for _ in range(3):
            share = area * close(*line)
            line = _fitted(xy, share, n) if share.any() else line
        if (found := float(area @ close(*line))) > most:
            best, most = line, found
    return best
