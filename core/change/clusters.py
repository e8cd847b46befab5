"""Connected new and gone voxels: what appeared, what vanished, how large, where, next to which element."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from ..model.elements import BuildingModel
from ..occupancy.bricks import BrickTable
from ..occupancy.epoch import EMPTY, NEAR, OCCUPIED, Observation
from ..occupancy.grid import CELLS, VoxelGrid, keys_of
from .results import DISAPPEARED, NEW, Cluster, Persistence
from .voxels import VoxelCloud

LEAST_VOXELS = 27
"""Smaller groups of voxels are noise, mixed pixels and dust."""
MOST_CLUSTERS = 500
SEEN_SHARE = 0.5


@njit(cache=True, nogil=True)
def _root(parent: NDArray[np.int64], n: int) -> int:
    while parent[n] != n:
        parent[n] = parent[parent[n]]
        n = parent[n]
    return n


@njit(cache=True, nogil=True, inline="always")
def _neighbour(x: int, y: int, z: int, number: NDArray[np.int32], around: NDArray[np.int32]) -> int:
    """Number of the voxel at a cell of a brick or just outside it (-1 to 8 per axis); -1 where there is none.

    ``around`` (27,) are the rows of the brick's neighbours.
    """
    there = around[((x >> 3) + 1) * 9 + ((y >> 3) + 1) * 3 + (z >> 3) + 1]
    return number[there, ((x & 7) << 6) | ((y & 7) << 3) | (z & 7)] if there >= 0 else -1


@njit(cache=True, nogil=True)
def _connect(
    index: NDArray[np.int64], number: NDArray[np.int32], around: NDArray[np.int32], row: NDArray[np.int32]
) -> NDArray[np.int64]:
    """Root of each voxel: the first voxel of its connected group (26 neighbours)."""
    parent = np.arange(len(index))
    for n in range(len(index)):
        i, j, k = index[n, 0] & 7, index[n, 1] & 7, index[n, 2] & 7
        for a in range(-1, 2):
            for b in range(-1, 2):
                for c in range(-1, 2):
                    m = _neighbour(i + a, j + b, k + c, number, around[row[n]])
                    if 0 <= m < n:
                        p, q = _root(parent, n), _root(parent, m)
                        if p != q:
                            parent[max(p, q)] = min(p, q)
    for n in range(len(index)):
        parent[n] = _root(parent, n)
    return parent


class Neighbours:
    """Voxels (N, 3) that can be asked for those around them."""

    def __init__(self, index: NDArray[np.int64]) -> None:
        key, cell = keys_of(index)
        table = BrickTable(np.unique(key))
        self._index = index
        self._row = table.rows(key)
        self._number = np.full((len(table), CELLS), -1, np.int32)
        self._number[self._row, cell] = np.arange(len(index), dtype=np.int32)
        self._around = table.around()

    def connected(self) -> NDArray[np.int64]:
        """(N,) number of the connected group of each voxel: the row of its first voxel."""
        return _connect(self._index, self._number, self._around, self._row)

    def pull(self) -> NDArray[np.float64]:
        """(N, 3) sum of the steps to the neighbours of each voxel."""
        return _pull(self._index, self._number, self._around, self._row)


@njit(cache=True, nogil=True, parallel=True)
def _pull(
    index: NDArray[np.int64], number: NDArray[np.int32], around: NDArray[np.int32], row: NDArray[np.int32]
) -> NDArray[np.float64]:
    out = np.zeros((len(index), 3))
    for n in prange(len(index)):
        i, j, k = index[n, 0] & 7, index[n, 1] & 7, index[n, 2] & 7
        for a in range(-1, 2):
            for b in range(-1, 2):
                for c in range(-1, 2):
                    if _neighbour(i + a, j + b, k + c, number, around[row[n]]) >= 0:
                        out[n, 0] += a
                        out[n, 1] += b
                        out[n, 2] += c
    return out


def connected(index: NDArray[np.int64]) -> NDArray[np.int64]:
    """(N,) number of the connected group of each voxel (N, 3): the row of its first voxel."""
    return Neighbours(index).connected() if len(index) else np.zeros(0, np.int64)


def find_clusters(
    model: BuildingModel, grid: VoxelGrid, cloud: VoxelCloud, others: Sequence[Observation]
) -> tuple[Cluster, ...]:
    """Clusters of new voxels outside elements and of gone voxels, largest first; ``others`` are the other epochs."""
    found: list[Cluster] = []
    start = model.triangle_start
    boxes = np.array([
        (lambda c: np.stack([c.min(axis=0), c.max(axis=0)]))(
            model.vertices[model.triangles[start[n] : start[n + 1]]].reshape(-1, 3)
        )
        for n in range(len(model.elements))
    ])
    for kind, code in (("NEW", NEW), ("DISAPPEARED", DISAPPEARED)):
        rows = np.flatnonzero(cloud.state == code)
        group = connected(cloud.index[rows])
        size = np.bincount(group, minlength=1)
        order = np.argsort(group, kind="stable")
        for root in np.flatnonzero(size >= LEAST_VOXELS):
            a, b = np.searchsorted(group[order], [root, root + 1])
            found.append(_describe(kind, rows[order[a:b]], model, grid, cloud, boxes, others))
    return tuple(sorted(found, key=lambda c: (-c.voxels, c.center)))[:MOST_CLUSTERS]


def _describe(
    kind: str, rows: NDArray[np.int64], model: BuildingModel, grid: VoxelGrid, cloud: VoxelCloud,
    boxes: NDArray[np.float64], others: Sequence[Observation],
) -> Cluster:
    index = cloud.index[rows]
    low = grid.centers(index.min(axis=0)) - grid.edge / 2
    high = grid.centers(index.max(axis=0)) + grid.edge / 2
    middle = (low + high) / 2
    owner = cloud.element[rows]
    inside = cloud.planned[rows].mean() > 0.5
    if (owner >= 0).mean() > 0.5:
        nearest = int(np.bincount(owner[owner >= 0]).argmax())
        distance = 0.0
    else:
        gap = np.linalg.norm(np.maximum(np.maximum(boxes[:, 0] - high, low - boxes[:, 1]), 0.0), axis=1)
        nearest = int(np.lexsort((np.linalg.norm(boxes.mean(axis=1) - middle, axis=1), gap))[0])
        distance = float(gap[nearest])
    center = middle + model.origin
    return Cluster(
        kind, len(rows), len(rows) * grid.edge**3, (float(center[0]), float(center[1]), float(center[2])),  # type: ignore[arg-type]
        tuple(float(v) for v in high - low), model.elements[nearest].global_id, distance, bool(inside),  # type: ignore[arg-type]
        _persistence(index, others),
    )


def _persistence(index: NDArray[np.int64], others: Sequence[Observation]) -> Persistence:
    key, cell = keys_of(index)
    answers = []
    for epoch in others:
        row = epoch.table.rows(key)
        state = np.where(row >= 0, epoch.state[row, cell], 0)
        there, empty = np.mean((state == OCCUPIED) | (state == NEAR)), np.mean(state == EMPTY)
        if there + empty >= SEEN_SHARE:
            answers.append(bool(there > empty))
    if not answers:
        return "unknown"
    return "stays" if all(answers) else "temporary"
