"""The voxel grid: cubes fixed to the model's frame, kept in bricks of 8 x 8 x 8 only where there is something to say."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

SIDE = 8
"""Voxels along a brick's edge."""
CELLS = SIDE**3
BITS = 21
HALF = 1 << (BITS - 1)
"""Bricks are numbered from -HALF to HALF along each axis: 83 km each way with voxels of 10 mm."""


@dataclass(frozen=True)
class VoxelGrid:
    """Cubes of ``edge`` metres; voxel (i, j, k) spans anchor + edge * (i..i+1, j..j+1, k..k+1) in the local frame."""

    edge: float
    anchor: NDArray[np.float64]
    """(3,) metres, local frame."""

    @classmethod
    def for_model(cls, origin: NDArray[np.float64], edge: float) -> VoxelGrid:
        """The grid whose planes are multiples of ``edge`` in the model frame, seen from its local frame at ``origin``.

        No epoch and no extent decides where voxels lie, so epochs compare without co-registration of voxels.
        """
        return cls(edge, -np.mod(np.asarray(origin, dtype=np.float64), edge))

    def index(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        """(N, 3) voxel indices of points (N, 3) [m, local frame]."""
        return np.floor((points - self.anchor) / self.edge).astype(np.int64)

    def centers(self, index: NDArray[np.int64]) -> NDArray[np.float64]:
        """(N, 3) middles [m, local frame] of voxels (N, 3)."""
        return self.anchor + self.edge * (index + 0.5)


@njit(cache=True, nogil=True, inline="always")
def brick_key(i: int, j: int, k: int) -> int:
    """Key of the brick that holds voxel (i, j, k)."""
    return (((i >> 3) + HALF) << (2 * BITS)) | (((j >> 3) + HALF) << BITS) | ((k >> 3) + HALF)


@njit(cache=True, nogil=True, inline="always")
def cell_of(i: int, j: int, k: int) -> int:
    """Number of the voxel in its brick, 0 ... 511."""
    return ((i & 7) << 6) | ((j & 7) << 3) | (k & 7)


@njit(cache=True, nogil=True, inline="always")
def brick_corner(key: int) -> tuple[int, int, int]:
    """Voxel index of a brick's first voxel."""
    mask = (1 << BITS) - 1
    return (
        (((key >> (2 * BITS)) & mask) - HALF) << 3, (((key >> BITS) & mask) - HALF) << 3, ((key & mask) - HALF) << 3,
    )


def voxel_index(key: NDArray[np.int64], cell: NDArray[np.int64]) -> NDArray[np.int64]:
    """(N, 3) voxel indices of cells (N,) in bricks with keys (N,)."""
    mask = (1 << BITS) - 1
    brick = np.stack([(key >> (2 * BITS)) & mask, (key >> BITS) & mask, key & mask], axis=1) - HALF
    return brick * SIDE + np.stack([cell >> 6, (cell >> 3) & 7, cell & 7], axis=1)


def keys_of(index: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Brick keys (N,) and cells (N,) of voxels (N, 3)."""
    brick = (index >> 3) + HALF
    low = index & 7
    return (
        (brick[:, 0] << (2 * BITS)) | (brick[:, 1] << BITS) | brick[:, 2],
        (low[:, 0] << 6) | (low[:, 1] << 3) | low[:, 2],
    )
