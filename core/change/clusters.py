"""New and gone voxels in groups: what appeared, what vanished, how large, where, of or next to which element.

What is new or gone of one planned element is one group: where rays are sparse, what they show of a removed slab is in pieces.
Outside elements, voxels that hang together are one group.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from ..model.elements import BuildingModel
from ..occupancy.bricks import BrickTable
from ..occupancy.epoch import EMPTY, NEAR, OCCUPIED, Observation
from ..occupancy.grid import CELLS, VoxelGrid, keys_of, voxel_index
from .results import DISAPPEARED, NEW, Cluster, Persistence, State
from .voxels import Universe, VoxelCloud

LEAST_VOXELS = 27
"""Smaller groups of voxels are noise, mixed pixels and dust."""
MOST_CLUSTERS = 10_000
"""More are counted, but not described: the largest tell what changed."""
SEEN_SHARE = 0.5
PART_SHARE = 0.2
Kind = Literal["NEW", "DISAPPEARED"]
KINDS: tuple[tuple[Kind, int], ...] = (("NEW", NEW), ("DISAPPEARED", DISAPPEARED))


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


@dataclass(frozen=True)
class _Group:
    """Voxels (N, 3) of one planned element, or connected ones outside elements, next to ``owner`` (N,) (-1: none)."""

    kind: Kind
    index: NDArray[np.int64]
    owner: NDArray[np.int32]
    planned: int = 0
    """Of an element: so many of them lie in its solid, not beside its faces."""
    inside: bool = False


def find_clusters(
    model: BuildingModel, world: Universe, cloud: VoxelCloud, states: Sequence[State], held: NDArray[np.float64],
    epochs: Sequence[tuple[str, Observation]], reference: Observation | None = None, most: int = MOST_CLUSTERS,
) -> tuple[tuple[Cluster, ...], int]:
    """Clusters of new and of gone voxels, largest first, and how many smaller ones are left out.

    states : of the elements, in the comparison that ``cloud`` shows.
    held : (E,) m3 of each element's solid that one of its voxels stands for.
    epochs : name and observation of all epochs but the reference, in order of time; the last is the one of ``cloud``.

    Beside what is new or gone in ``cloud``, these are things that only an earlier epoch saw: outside elements, not there in the
    reference, and gone from the last.
    """
    groups: list[_Group] = []
    for kind, code in KINDS:
        rows = np.flatnonzero(cloud.state == code)
        index, element = cloud.index[rows], cloud.element[rows]
        changed, in_part = (np.array([state == of for state in states], np.bool_) for of in (kind, "PARTIAL"))
        own = cloud.planned[rows] | ((element >= 0) & (changed | in_part)[element])
        groups += _of_elements(kind, index[own], element[own], cloud.planned[rows][own], changed)
        groups += _outside(kind, index[~own], element[~own])
    index = _came_and_went(world, [o for _, o in epochs], reference)
    groups += _outside("DISAPPEARED", index, np.full(len(index), -1, np.int32))
    groups.sort(key=lambda g: (-len(g.index), g.index.min(axis=0).tolist(), g.index[0].tolist(), g.kind))
    boxes = np.stack(list(model.element_bounds), axis=1)
    found = tuple(_describe(g, model, world.grid, boxes, held, epochs, reference) for g in groups[:most])
    return found, max(len(groups) - most, 0)


def _of_elements(
    kind: Kind, index: NDArray[np.int64], element: NDArray[np.int32], planned: NDArray[np.bool_], changed: NDArray[np.bool_]
) -> Iterator[_Group]:
    """Voxels (N, 3), ``planned`` (N,) or beside a face, by their ``element`` (N,): all of one that ``changed`` (E,) as a whole,
    of others those in pieces that are large enough."""
    order = np.argsort(element, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(element[order])) + 1) if len(order) else ():
        if not changed[element[rows[0]]]:
            rows = np.concatenate([rows[:0], *(rows[piece] for piece in _pieces(index[rows]))])
        if len(rows) >= LEAST_VOXELS:
            yield _Group(kind, index[rows], element[rows], int(planned[rows].sum()), inside=True)


def _outside(kind: Kind, index: NDArray[np.int64], owner: NDArray[np.int32]) -> Iterator[_Group]:
    """The connected groups of voxels (N, 3) that are large enough."""
    for piece in _pieces(index):
        yield _Group(kind, index[piece], owner[piece])


def _pieces(index: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Rows of the connected voxels (N, 3) of each piece that is large enough."""
    group = connected(index)
    order = np.argsort(group, kind="stable")
    pieces = np.split(order, np.flatnonzero(np.diff(group[order])) + 1)
    return [piece for piece in pieces if len(piece) >= LEAST_VOXELS]


def _came_and_went(
    world: Universe, epochs: Sequence[Observation], reference: Observation | None
) -> NDArray[np.int64]:
    """(N, 3) voxels outside elements, occupied in an earlier epoch, empty in the last, and not occupied in the reference."""
    stood = np.zeros(world.wanted.shape, np.bool_)
    for epoch in epochs[:-1]:
        stood |= epoch.state == OCCUPIED
    stood &= (world.element < 0) & (epochs[-1].state == EMPTY)
    if reference is not None:
        stood &= (reference.state != OCCUPIED) & (reference.state != NEAR)
    row, cell = np.nonzero(stood)
    return voxel_index(world.table.keys[row], cell)


def _describe(
    group: _Group, model: BuildingModel, grid: VoxelGrid, boxes: NDArray[np.float64], held: NDArray[np.float64],
    epochs: Sequence[tuple[str, Observation]], reference: Observation | None,
) -> Cluster:
    index, owner = group.index, group.owner
    low = grid.centers(index.min(axis=0)) - grid.edge / 2
    high = grid.centers(index.max(axis=0)) + grid.edge / 2
    middle = (low + high) / 2
    inside = group.inside
    if (owner >= 0).mean() > 0.5:
        nearest = int(np.bincount(owner[owner >= 0]).argmax())
        distance = 0.0
    else:
        gap = np.linalg.norm(np.maximum(np.maximum(boxes[:, 0] - high, low - boxes[:, 1]), 0.0), axis=1)
        nearest = int(np.lexsort((np.linalg.norm(boxes.mean(axis=1) - middle, axis=1), gap))[0])
        distance = float(gap[nearest])
    center = middle + model.origin
    shares = [_shares(index, o) for _, o in epochs]
    answers = [None if there + empty < SEEN_SHARE else there > empty for there, empty in shares]
    loose = group.kind == "DISAPPEARED" and not inside  # of two things at one place, neither may fill it
    names = [
        name for (name, _), (there, empty) in zip(epochs, shares, strict=True) if there > (PART_SHARE if loose else empty)
    ]
    if reference is not None and np.subtract(*_shares(index, reference)) > 0:
        names.insert(0, "reference")
    size = high - low
    volume = group.planned * float(held[nearest]) if inside else len(index) * grid.edge**3
    return Cluster(
        group.kind, len(index), volume, (float(center[0]), float(center[1]), float(center[2])),
        (float(size[0]), float(size[1]), float(size[2])), model.elements[nearest].global_id, distance, inside,
        persistence(group.kind, inside, answers), tuple(names),
    )


def _shares(index: NDArray[np.int64], epoch: Observation) -> tuple[float, float]:
    """Shares of voxels (N, 3) that an epoch saw occupied, and empty."""
    key, cell = keys_of(index)
    row = epoch.table.rows(key)
    state = np.where(row >= 0, epoch.state[row, cell], 0)
    return float(np.mean((state == OCCUPIED) | (state == NEAR))), float(np.mean(state == EMPTY))


def persistence(kind: Kind, inside: bool, answers: Sequence[bool | None]) -> Persistence:
    """Whether a cluster lasts, from whether each epoch saw something there (None: not seen).

    ``answers`` are those of all epochs but the reference, in order of time; the last is the one which the cluster is reported
    for.
    """
    if kind == "DISAPPEARED" and not inside:
        return "temporary"  # it stood once, is not planned, and is gone
    same = [answer == (kind == "NEW") for answer in answers[:-1] if answer is not None]
    if not same:
        return "unknown"
    if same[-1]:
        return "stays" if same == sorted(same) else "temporary"
    return "temporary" if any(same) else "unknown"  # only the last epoch saw it
