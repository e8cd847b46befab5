"""How wide the face is around a point: a beam must fall on a slender one as a whole to measure it."""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from ..model.elements import BuildingModel
from ..quality.edges import feature_edges
from .cover import Array

IN_PLANE_M = 0.002
"""Edges this close to the plane of a point's face belong to the face."""


def face_widths(
    model: BuildingModel, position: Array, normal: Array, element: NDArray[np.int32]
) -> tuple[Array, Array]:
    """(across (P, 3) unit vectors, width (P,) [m]): the way over a point from its face's nearest edge to the opposite one.

    Points (P, 3) with their normals, metres, local frame. The width is infinite where a face has no edges around the point.
    """
    segments, start = feature_edges(model)
    return _widths(position, normal, element, np.ascontiguousarray(segments), start)


@njit(cache=True, nogil=True, parallel=True)
def _widths(point, normal, element, segment, start):  # type: ignore[no-untyped-def]
    across = np.zeros((len(point), 3))
    width = np.full(len(point), np.inf)
    for i in prange(len(point)):
        p, n = point[i], normal[i]
        first, last = start[element[i]], start[element[i] + 1]
        best = np.inf
        for s in range(first, last):
            a, b = segment[s, 0] - p, segment[s, 1] - p
            if abs(a @ n) > IN_PLANE_M or abs(b @ n) > IN_PLANE_M:
                continue
            d = b - a
            along = min(max(-(a @ d) / max(d @ d, 1e-30), 0.0), 1.0)
            foot = a + along * d
            square = foot @ foot
            if square < best:
                best = square
                # at an edge itself the way leads at right angles to it
                across[i] = foot if square > 1e-12 else np.cross(d, n)
        length = math.sqrt(across[i] @ across[i])
        if not best < np.inf or length < 1e-12:
            continue
        across[i] /= length
        e, f = across[i], np.cross(n, across[i])
        near = math.sqrt(best)
        other = np.inf
        for s in range(first, last):
            a, b = segment[s, 0] - p, segment[s, 1] - p
            if abs(a @ n) > IN_PLANE_M or abs(b @ n) > IN_PLANE_M:
                continue
            side_a, side_b = a @ f, b @ f
            if side_a * side_b > 0.0 or side_a == side_b:
                continue
            x = (a @ e) + (b @ e - a @ e) * (side_a / (side_a - side_b))
            if abs(x - near) > IN_PLANE_M:
                other = min(other, abs(x) if near < IN_PLANE_M else (-x if x < 0.0 else np.inf))
        width[i] = near + other
    return across, width
