"""Which side of a triangle is outside."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

WELD_M = 1e-6
"""Corners of one element closer than this are one, metres: far below any edge, far above rounding."""


def orient_outward(
    vertices: NDArray[np.float64],
    triangles: NDArray[np.int32],
    owner: NDArray[np.int32],
    transparent: NDArray[np.bool_],
    element_count: int,
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.bool_], NDArray[np.bool_]]:
    """Turn closed shells outward; give open sheets both sides.

    A connected shell is closed when every directed edge has its opposite exactly once, if need be after corners of the
    element in the same place are taken as one. Closed shells of negative volume
    are turned, unless the element's total volume is positive (then they are voids inside it). The sides of an open sheet
    cannot be told apart, so it is kept twice, once for each side; sampling later drops the side that looks only at itself.

    vertices (V, 3); triangles (T, 3); owner (T,) ascending; transparent (T,). Returns triangles (T', 3), owner (T',)
    ascending, transparent (T',), and closed (E,).
    """
    area2 = np.linalg.norm(_cross(vertices, triangles), axis=1)
    keep = area2 > 1e-12
    triangles, owner, transparent = triangles[keep], owner[keep], transparent[keep]
    if not len(triangles):
        return triangles, owner, transparent, np.zeros(element_count, dtype=np.bool_)

    shell, shell_closed = _shells(triangles, len(vertices))
    loose = np.flatnonzero(~shell_closed[shell])
    if len(loose):
        again, again_closed = _shells(_weld(vertices, triangles[loose], owner[loose]), len(vertices))
        shell[loose] = again + len(shell_closed)
        shell_closed = np.concatenate([shell_closed, again_closed])
    shell_count = len(shell_closed)

    corner = vertices[triangles]
    reference = np.zeros((shell_count, 3))
    reference[shell] = corner[:, 0]
    local = corner - reference[shell][:, None, :]
    volume6 = np.einsum("ij,ij->i", local[:, 0], np.cross(local[:, 1], local[:, 2]))
    shell_volume = np.bincount(shell, weights=volume6, minlength=shell_count)
    shell_owner = np.zeros(shell_count, dtype=np.int64)
    shell_owner[shell] = owner
    element_volume = np.bincount(
        shell_owner, weights=np.where(shell_closed, shell_volume, 0.0), minlength=element_count
    )
    turn = shell_closed & (shell_volume < 0) & (element_volume[shell_owner] <= 0)

    turned = triangles.copy()
    flip = turn[shell]
    turned[flip] = turned[flip][:, ::-1]
    open_triangle = ~shell_closed[shell]
    both = np.concatenate([turned, turned[open_triangle][:, ::-1]])
    both_transparent = np.concatenate([transparent, transparent[open_triangle]])
    both_owner = np.concatenate([owner, owner[open_triangle]])
    order = np.argsort(both_owner, kind="stable")
    closed = np.ones(element_count, dtype=np.bool_)
    closed[owner[open_triangle]] = False
    return np.ascontiguousarray(both[order]), both_owner[order], both_transparent[order], closed


def _shells(triangles: NDArray[np.int32], vertex_count: int) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Connected shell (T,) of each triangle, and (S,) whether a shell is closed."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]).astype(np.int64)
    graph = coo_array((np.ones(len(edges), dtype=np.int8), (edges[:, 0], edges[:, 1])), shape=(vertex_count,) * 2)
    shell = connected_components(graph, directed=False)[1][triangles[:, 0]].astype(np.int64)
    code = edges[:, 0] * vertex_count + edges[:, 1]
    opposite = edges[:, 1] * vertex_count + edges[:, 0]
    unique, count = np.unique(code, return_counts=True)
    at = np.minimum(np.searchsorted(unique, opposite), len(unique) - 1)
    paired = (unique[at] == opposite) & (count[at] == 1) & (count[np.searchsorted(unique, code)] == 1)
    return shell, np.bincount(np.tile(shell, 3), weights=~paired) == 0


def _weld(
    vertices: NDArray[np.float64], triangles: NDArray[np.int32], owner: NDArray[np.int32]
) -> NDArray[np.int32]:
    """(T, 3) the triangles with one vertex where an element has several in the same place.

    The kernel gives some faces of a solid, such as those around a cut opening, vertices of their own.
    """
    used, first = np.unique(triangles, return_index=True)
    place = np.column_stack([owner[first // 3], np.round(vertices[used] / WELD_M).astype(np.int64)])
    _, one, group = np.unique(place, axis=0, return_index=True, return_inverse=True)
    return used[one][group.ravel()][np.searchsorted(used, triangles)]


def _cross(vertices: NDArray[np.float64], triangles: NDArray[np.int32]) -> NDArray[np.float64]:
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    return np.cross(b - a, c - a)
