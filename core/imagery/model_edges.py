"""Edges of a building model: sharp edges of its solids, joined across triangles and elements."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.elements import BuildingModel

Vector = NDArray[np.float64]
WELD_M = 1e-5
SHARPEST_FLAT = math.radians(25.0)
"""Faces that meet at less than this are one curved surface; tessellated round members stay below it."""
SAME_LINE_M = 1e-3
SAME_DIRECTION = 1e-3
SHORTEST_M = 0.03


@dataclass(frozen=True)
class ModelEdges:
    """Straight edges, local frame."""

    start: Vector
    """(N, 3) metres"""
    end: Vector
    """(N, 3) metres"""
    owner: NDArray[np.int64]
    """(P, 2) rows of edges, and of the model's elements whose edges they are: one, or several on one line."""

    def __len__(self) -> int:
        return len(self.start)

    @property
    def length(self) -> Vector:
        """(N,) metres."""
        return np.asarray(np.linalg.norm(self.end - self.start, axis=1))

    def owned(self, edge: NDArray[np.int64], element: NDArray[np.int64]) -> NDArray[np.bool_]:
        """(N,) whether an edge (N,) is one of an element (N,)."""
        size = max(int(self.owner.max(initial=0)), int(element.max(initial=0))) + 1
        return np.asarray(np.isin(edge * size + element, self.owner[:, 0] * size + self.owner[:, 1]) & (element >= 0))


def sharp_edges(model: BuildingModel, *, dihedral: float = SHARPEST_FLAT, shortest: float = SHORTEST_M) -> ModelEdges:
    """Edges where faces of an element meet at more than ``dihedral`` [rad], or where a surface ends.

    Edges between triangles of one plane are none; pieces on one line that touch are one edge.
    """
    owner = model.triangle_element.astype(np.int64)
    corner = _welded(model)[model.triangles]
    flat = (corner[:, 0] == corner[:, 1]) | (corner[:, 1] == corner[:, 2]) | (corner[:, 2] == corner[:, 0])
    a, b, c = (model.vertices[model.triangles[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    size = np.linalg.norm(normal, axis=1)
    good = ~flat & (size > 1e-12)
    corner, owner, normal = corner[good], owner[good], normal[good] / size[good, None]
    vertex = model.vertices[model.triangles[good]]
    side = np.concatenate([corner[:, [0, 1]], corner[:, [1, 2]], corner[:, [2, 0]]])
    ends = np.concatenate([vertex[:, [0, 1]], vertex[:, [1, 2]], vertex[:, [2, 0]]])
    face = np.tile(np.arange(len(corner)), 3)
    swap = side[:, 0] > side[:, 1]
    side[swap] = side[swap][:, ::-1]
    ends[swap] = ends[swap][:, ::-1]
    order = np.lexsort((face, side[:, 1], side[:, 0], owner[face]))
    side, ends, face = side[order], ends[order], face[order]
    who = owner[face]
    new = np.ones(len(side), dtype=np.bool_)
    new[1:] = (side[1:] != side[:-1]).any(axis=1) | (who[1:] != who[:-1])
    first = np.flatnonzero(new)
    count = np.diff(np.concatenate([first, [len(side)]]))
    sharp = np.ones(len(first), dtype=np.bool_)
    shared = count == 2
    together = np.einsum("ni,ni->n", normal[face[first[shared]]], normal[face[first[shared] + 1]])
    sharp[shared] = together < math.cos(dihedral)
    kept = first[sharp]
    return _joined(ends[kept, 0], ends[kept, 1], who[kept], shortest)


def _welded(model: BuildingModel) -> NDArray[np.int64]:
    """(V,) number of each vertex' place; close vertices have one number."""
    _, number = np.unique(np.round(model.vertices / WELD_M).astype(np.int64), axis=0, return_inverse=True)
    return np.asarray(number.ravel())


def _joined(start: Vector, end: Vector, element: NDArray[np.int64], shortest: float) -> ModelEdges:
    """Pieces on one line that touch or overlap as one edge."""
    along = end - start
    size = np.linalg.norm(along, axis=1)
    ok = size > 1e-6
    start, end, element, along = start[ok], end[ok], element[ok], along[ok] / size[ok, None]
    main = np.take_along_axis(along, np.abs(along).argmax(axis=1)[:, None], axis=1)
    along = along * np.sign(main)
    foot = start - along * np.einsum("ni,ni->n", along, start)[:, None]
    key = np.column_stack([np.round(along / SAME_DIRECTION), np.round(foot / SAME_LINE_M)]).astype(np.int64)
    _, line = np.unique(key, axis=0, return_inverse=True)
    line = line.ravel()
    t = np.sort(np.column_stack([np.einsum("ni,ni->n", along, start), np.einsum("ni,ni->n", along, end)]), axis=1)
    order = np.lexsort((t[:, 0], line))
    starts, ends = [], []
    owners: list[tuple[int, int]] = []
    members: set[int] = set()
    last, low, high, longest, row = -1, 0.0, 0.0, 0.0, -1

    def close() -> None:
        if row >= 0 and high - low >= shortest:
            starts.append(foot[row] + low * along[row])
            ends.append(foot[row] + high * along[row])
            owners.extend((len(starts) - 1, e) for e in sorted(members))

    for k in order:
        if line[k] != last or t[k, 0] > high + SAME_LINE_M:
            close()
            last, low, high, longest, row = int(line[k]), float(t[k, 0]), float(t[k, 1]), 0.0, int(k)
            members.clear()
        members.add(int(element[k]))
        high = max(high, float(t[k, 1]))
        if t[k, 1] - t[k, 0] > longest:
            longest, row = float(t[k, 1] - t[k, 0]), int(k)
    close()
    return ModelEdges(
        np.array(starts).reshape(-1, 3), np.array(ends).reshape(-1, 3), np.array(owners, dtype=np.int64).reshape(-1, 2)
    )
