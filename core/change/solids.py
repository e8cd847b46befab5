"""The model's solids as voxels, inside included, in height layers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..model.elements import BuildingModel
from ..occupancy.bricks import BrickTable
from ..occupancy.grid import VoxelGrid
from ..progress import Progress
from .holders import Further
from .owners import Owners

NUDGE_M = (1.1e-6, 1.3e-6, 1.7e-6)
"""Middles are moved by this, so that faces at whole millimetres never go through one."""
CELLS_AT_ONCE = 8_000_000
BLOCK_SIDE = 512
"""Voxels of a block along x and y, so that memory follows the solid and not the box around it."""
BYTES_PER_CELL = 9
"""Element, wanted, labels and states of two epochs, and their copies while they are made."""
THIN_SHARE = 0.5
"""An element of which the middles of voxels catch less than this share of its volume is kept by its surface."""


@dataclass(frozen=True)
class SolidVoxels:
    """Which elements hold each voxel."""

    grid: VoxelGrid
    table: BrickTable
    element: NDArray[Any]
    """(B, 512) int16 or int32, rows of ``model.elements``, the first one that holds a voxel; -1 where there is none."""
    further: Further
    """The others."""
    by_surface: NDArray[np.bool_]
    """(E,) kept by the voxels that its surface goes through, because it is thin or open."""
    count: NDArray[np.int64]
    """(E,) voxels of each element."""
    volume: NDArray[np.float64]
    """(E,) m3 of the solid itself, from its triangles; 0 for an open surface."""

    @property
    def held(self) -> NDArray[np.float64]:
        """(E,) m3 of the solid that one of its voxels stands for; of an open surface, the voxel."""
        return np.where(self.volume > 0, self.volume / np.maximum(self.count, 1), self.grid.edge**3)


def fitting_edge(model: BuildingModel, edge: float, memory_gb: float) -> float:
    """The smallest of edge, 2 edge, 4 edge ... whose voxels of the whole model fit into ``memory_gb``."""
    volume = mesh_volumes(model)
    corner = model.vertices[model.triangles]
    area = 0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1).sum()
    for _ in range(12):
        cells = (volume.sum() + 8 * edge * area) / edge**3
        if cells * BYTES_PER_CELL < 0.8 * memory_gb * 1e9:
            return edge
        edge *= 2
    raise BimVerifyError(
        f"The solids of {model.path} fill too much space for {memory_gb:g} GB; give more --memory-gb or a larger --voxel-mm."
    )


def mesh_volumes(model: BuildingModel) -> NDArray[np.float64]:
    """(E,) m3 inside closed surfaces; 0 for open ones."""
    corner = model.vertices[model.triangles]
    start = model.triangle_start[:-1]
    reference = corner[np.minimum(start, len(corner) - 1), 0][model.triangle_element]
    a, b, c = (corner[:, n] - reference for n in range(3))
    signed = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0
    volume = np.bincount(model.triangle_element, weights=signed, minlength=len(model.elements))
    return np.where(model.closed, np.maximum(volume, 0.0), 0.0)


def voxelise(model: BuildingModel, grid: VoxelGrid, progress: Progress | None = None) -> SolidVoxels:
    """Voxels whose middle lies inside an element; of thin and open elements those that their surface goes through.

    A voxel in several solids is held by all of them; a surface takes only voxels in no solid.
    """
    progress = progress or Progress()
    volume = mesh_volumes(model)
    count = len(model.elements)
    owners = Owners(np.int16 if count < 2**15 else np.int32, count)
    start = model.triangle_start
    corner = (model.vertices[model.triangles] - grid.anchor - NUDGE_M) / grid.edge
    for row in range(count):
        progress.update(row / count, "Filling solids with voxels")
        part = corner[start[row] : start[row + 1]]
        if not len(part):
            continue
        found = 0
        if model.closed[row]:
            for mask, first in _inside(part):
                found += owners.enter(mask, first, row)
        owners.by_surface[row] = found * grid.edge**3 < THIN_SHARE * volume[row] or not found
    for row in np.flatnonzero(owners.by_surface):
        owners.enter_surface(corner[start[row] : start[row + 1]], row)
    (keys, element), *more = owners.layers()
    table = BrickTable(keys)
    further = Further.of(more, table, element.dtype)
    return SolidVoxels(
        grid, table, element, further, owners.by_surface,
        _count_voxels(element, count) + _count_voxels(further.element, count), volume,
    )


def _count_voxels(element: NDArray[Any], elements: int) -> NDArray[np.int64]:
    """(E,) voxels (N, 512) of each element."""
    counts = np.zeros(elements, np.int64)
    for begin in range(0, len(element), 4096):
        part = element[begin : begin + 4096]
        counts += np.bincount(part[part >= 0], minlength=elements)
    return counts


@dataclass(frozen=True)
class VoxelBox:
    """Numbers for the voxels of a box, eight bytes each; those around it have numbers of their own, too."""

    low: NDArray[np.int64]
    """(3,) its first voxel."""
    size: NDArray[np.int64]
    """(3,)"""

    @classmethod
    def around(cls, first: NDArray[np.int64], last: NDArray[np.int64]) -> VoxelBox:
        """The box of all voxels from ``first`` to ``last`` (3,)."""
        return cls(first - 1, last - first + 3)

    def part(self, index: NDArray[np.int64]) -> NDArray[np.int64]:
        """(M, 3) those of voxels (N, 3) that lie in the box."""
        return index[((index >= self.low) & (index < self.low + self.size)).all(axis=1)]

    def code(self, index: NDArray[np.int64]) -> NDArray[np.int64]:
        """(N,) numbers of voxels (N, 3) in the box."""
        x, y, z = (index - self.low).T
        return np.asarray((x * self.size[1] + y) * self.size[2] + z, np.int64)

    def index(self, code: NDArray[np.int64]) -> NDArray[np.int64]:
        """(N, 3) the voxels with these numbers."""
        rest, z = np.divmod(code, self.size[2])
        x, y = np.divmod(rest, self.size[1])
        return np.stack([x, y, z], axis=1) + self.low

    def step(self, side: NDArray[np.int64]) -> int:
        """By how much the number of a voxel's neighbour on that side (3,) is larger."""
        return int((side[0] * self.size[1] + side[1]) * self.size[2] + side[2])


def solid_voxels_of(model: BuildingModel, edge: float, row: int) -> tuple[NDArray[np.int64], VoxelBox]:
    """The voxels whose middle lies inside one closed element, in the grid of ``voxelise``: sorted numbers, and their box."""
    grid = VoxelGrid.for_model(model.origin, edge)
    start = model.triangle_start
    corner = (model.vertices[model.triangles[start[row] : start[row + 1]]] - grid.anchor - NUDGE_M) / grid.edge
    box = VoxelBox.around(*(np.floor(of(corner, axis=(0, 1))).astype(np.int64) for of in (np.min, np.max)))
    found = [np.zeros(0, np.int64)]
    for mask, first in _inside(corner) if model.closed[row] else ():
        for layer in range(len(mask)):
            y, x = np.nonzero(mask[layer])
            found.append(box.code(np.stack([x, y, np.full(len(x), layer)], axis=1) + first))
    return np.sort(np.concatenate(found)), box


def _inside(corner: NDArray[np.float64]) -> Iterator[tuple[NDArray[np.bool_], NDArray[np.int64]]]:
    """Which voxels (layers, rows, columns) of a block lie inside a closed surface (T, 3, 3) given in voxel units, and the
    block's first voxel (x, y, z). Blocks of BLOCK_SIDE a side and some height layers, those around the solid alone."""
    low = np.floor(corner.min(axis=(0, 1))).astype(np.int64)
    high = np.floor(corner.max(axis=(0, 1))).astype(np.int64) + 1
    across = np.minimum(high - low, BLOCK_SIDE)
    layers = max(int(CELLS_AT_ONCE // (across[0] * across[1])), 1)
    for k0, k1 in _cuts(low[2], high[2], layers):
        layer = _between(corner, 2, k0, k1)
        for j0, j1 in _cuts(low[1], high[1], BLOCK_SIDE):
            strip = _between(layer, 1, j0, j1)
            for i0, i1 in _cuts(low[0], high[0], BLOCK_SIDE):
                before = strip[strip[:, :, 0].min(axis=1) < i1]
                if not len(before) or strip[:, :, 0].max() <= i0:
                    continue
                turn = np.zeros((k1 - k0, j1 - j0, i1 - i0 + 1), np.int16)
                _cross_rows(before, i0, j0, k0, turn)
                yield _wind(turn), np.array([i0, j0, k0])


def _cuts(first: int, last: int, step: int) -> Iterator[tuple[int, int]]:
    for begin in range(int(first), int(last), step):
        yield begin, min(begin + step, int(last))


def _between(corner: NDArray[np.float64], axis: int, first: int, last: int) -> NDArray[np.float64]:
    """Triangles (T, 3, 3) that reach into a slice."""
    return corner[(corner[:, :, axis].max(axis=1) > first) & (corner[:, :, axis].min(axis=1) < last)]


@njit(cache=True, nogil=True, parallel=True)
def _wind(turn: NDArray[np.int16]) -> NDArray[np.bool_]:
    out = np.zeros((turn.shape[0], turn.shape[1], turn.shape[2] - 1), np.bool_)
    for k in prange(turn.shape[0]):
        for j in range(turn.shape[1]):
            total = 0
            for i in range(turn.shape[2] - 1):
                total += turn[k, j, i]
                out[k, j, i] = total != 0
    return out


@njit(cache=True, nogil=True, parallel=True)
def _cross_rows(corner: NDArray[np.float64], i0: int, j0: int, k0: int, turn: NDArray[np.int16]) -> None:
    """Count, row by row along x, where the surface is entered (+) and left (-), at the first middle behind it;
    what lies before the block counts at its first middle, what lies behind it in the last column, which no voxel has."""
    layers, rows, columns = turn.shape
    for k in prange(layers):
        z = k0 + k + 0.5
        for t in range(len(corner)):
            c = corner[t]
            z0, z1, z2 = c[0, 2], c[1, 2], c[2, 2]
            if max(z0, z1, z2) <= z or min(z0, z1, z2) > z:
                continue
            # the section of the triangle at this height is one segment
            n = 0
            ax = ay = bx = by = 0.0
            for e in range(3):
                p, q = c[e], c[(e + 1) % 3]
                if (p[2] <= z) == (q[2] <= z):
                    continue
                if p[2] > q[2]:  # the same point from both triangles of an edge
                    p, q = q, p
                s = (z - p[2]) / (q[2] - p[2])
                x, y = p[0] + s * (q[0] - p[0]), p[1] + s * (q[1] - p[1])
                if n == 0:
                    ax, ay = x, y
                else:
                    bx, by = x, y
                n += 1
            if n != 2 or ay == by:
                continue
            nx = (c[1, 1] - c[0, 1]) * (c[2, 2] - c[0, 2]) - (c[1, 2] - c[0, 2]) * (c[2, 1] - c[0, 1])
            sign = 1 if nx < 0 else -1
            low, high = min(ay, by), max(ay, by)
            for j in range(max(int(np.ceil(low - 0.5)) - j0, 0), min(int(np.ceil(high - 0.5)) - j0, rows)):
                y = j0 + j + 0.5
                x = ax + (y - ay) / (by - ay) * (bx - ax)
                i = int(np.ceil(x - 0.5)) - i0
                turn[k, j, min(max(i, 0), columns - 1)] += sign
