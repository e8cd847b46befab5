"""Where the faces of an element end: noise behaves otherwise there, because beams straddle the edge."""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from ..model.elements import BuildingModel
from ..model.samples import SurfaceSamples

SHARP_COS = math.cos(math.radians(20.0))
"""Faces that meet at less than this angle are one smooth surface."""
WELD_M = 1e-5


def feature_edges(model: BuildingModel) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """(segments (S, 2, 3) [m, local frame], start (E + 1,)): the sharp and the open edges of every element.

    Element ``e`` owns the segments ``start[e]:start[e + 1]``.
    """
    corners = model.vertices[model.triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    used, corner = np.unique(model.triangles, return_inverse=True)
    _, same = np.unique(np.round(model.vertices[used] / WELD_M).astype(np.int64), axis=0, return_inverse=True)
    corner = same.ravel()[corner.reshape(-1, 3)].astype(np.int64)
    ends = np.concatenate([corner[:, [0, 1]], corner[:, [1, 2]], corner[:, [2, 0]]])
    triangle = np.tile(np.arange(len(corner)), 3)
    element = model.triangle_element[triangle].astype(np.int64)
    key = np.column_stack([element, np.sort(ends, axis=1)])
    _, first, inverse, times = np.unique(key, axis=0, return_index=True, return_inverse=True, return_counts=True)
    inverse = inverse.ravel()
    # the smallest cosine between the first triangle of an edge and its others
    cosine = np.einsum("ij,ij->i", normal[triangle], normal[triangle[first[inverse]]])
    least = np.ones(len(first))
    np.minimum.at(least, inverse, cosine)
    sharp = np.flatnonzero((times == 1) | (least < SHARP_COS))
    place = first[sharp]
    flat = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    order = np.argsort(element[place], kind="stable")
    place = place[order]
    start = np.searchsorted(element[place], np.arange(len(model.elements) + 1))
    return flat[place], start


def edge_distance(model: BuildingModel, samples: SurfaceSamples, most: float) -> NDArray[np.float64]:
    """(N,) distance of each query position to the nearest edge of its element [m], ``most`` where that is farther."""
    segments, start = feature_edges(model)
    return _nearest(samples.position, samples.element, np.ascontiguousarray(segments), start, most)


@njit(cache=True, nogil=True, parallel=True)
def _nearest(point, element, segment, start, most):  # type: ignore[no-untyped-def]
    out = np.full(len(point), most)
    for i in prange(len(point)):
        best = most * most
        p = point[i]
        for s in range(start[element[i]], start[element[i] + 1]):
            a, b = segment[s, 0], segment[s, 1]
            dx, dy, dz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
            px, py, pz = p[0] - a[0], p[1] - a[1], p[2] - a[2]
            along = (px * dx + py * dy + pz * dz) / max(dx * dx + dy * dy + dz * dz, 1e-30)
            along = min(max(along, 0.0), 1.0)
            px, py, pz = px - along * dx, py - along * dy, pz - along * dz
            best = min(best, px * px + py * py + pz * pz)
        out[i] = math.sqrt(best)
    return out
