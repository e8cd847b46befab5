"""A thinned cloud for display, the same whatever the order and size of the blocks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..progress import Progress
from .campaign import ReturnBlock, ScanSource

NEAREST_M, FARTHEST_M = 0.5, 30.0
_GREY = 160


@njit(cache=True, nogil=True)
def _priorities(offsets, words, seed, weighted, near2, far2, out):  # type: ignore[no-untyped-def]
    """Small numbers win: an exponential variate from the hash of the coordinates over the weight of the return."""
    for i in range(offsets.shape[0]):
        h = seed
        for k in range(3):
            h = (h ^ words[i, k]) * np.uint64(0xBF58476D1CE4E5B9)
            h ^= h >> np.uint64(31)
        h = (h ^ (h >> np.uint64(30))) * np.uint64(0x94D049BB133111EB)
        h ^= h >> np.uint64(31)
        uniform = (float(h >> np.uint64(11)) + 0.5) * 2.0**-53
        weight = 1.0
        if weighted:
            range2 = offsets[i, 0] ** 2 + offsets[i, 1] ** 2 + offsets[i, 2] ** 2
            weight = min(max(range2, near2), far2)
        out[i] = -np.log(uniform) / weight


class _Best:
    """Keeps the rows with the smallest priorities; at most twice as many as asked for are held."""

    def __init__(self, most: int) -> None:
        self.most = most
        self.threshold = np.inf
        self.parts: list[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int32], NDArray[np.uint8]]] = []
        self.held = 0

    def add(
        self, priority: NDArray[np.float64], xyz: NDArray[np.float64], station: int, color: NDArray[np.uint8] | None
    ) -> None:
        rows = np.flatnonzero(priority <= self.threshold)
        if len(rows) == 0:
            return
        painted = np.full((len(rows), 3), _GREY, np.uint8) if color is None else color[rows]
        self.parts.append((priority[rows], xyz[rows], np.full(len(rows), station, np.int32), painted))
        self.held += len(rows)
        if self.held > 2 * self.most:
            self.shrink()

    def shrink(self) -> None:
        """Keep the best, ordered by priority and then coordinates, so that equal priorities cannot depend on order."""
        priority, xyz, station, color = (np.concatenate(part) for part in zip(*self.parts, strict=True))
        order = np.lexsort((station, xyz[:, 2], xyz[:, 1], xyz[:, 0], priority))[: self.most]
        self.parts = [(priority[order], xyz[order], station[order], color[order])]
        self.held = len(order)
        if self.held == self.most:
            self.threshold = float(priority[order[-1]])


def thin(
    source: ScanSource, max_points: int, seed: int = 0, progress: Progress | None = None
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.uint8] | None]:
    """Choose at most ``max_points`` returns for display: (xyz (N, 3) scan frame, station (N,), color (N, 3) or None).

    A weighted random sample without replacement (Efraimidis & Spirakis 2006, doi:10.1016/j.ipl.2005.11.003). A return
    of a known station weighs its squared range (0.5 to 30 m), the surface that it stands for, so that near surfaces do
    not take all points. The random numbers are hashes of the coordinates: block size and order do not matter. Memory
    goes with ``max_points``. Returns without colour are grey where others have it.
    """
    if max_points < 1:
        raise ValueError("max_points must be at least 1")
    mix = np.uint64((0x9E3779B97F4A7C15 * (seed + 1)) % 2**64)
    best = _Best(max_points)
    stations = source.stations
    progress, read = progress or Progress(), 0
    name = ", ".join(Path(path).name for path in source.paths)
    colored = False
    for block in source.blocks(attributes=True):
        colored |= block.color is not None
        station = stations[block.station]
        priority = _block_priorities(block, mix, station.known)
        best.add(priority, block.offsets + station.position, block.station, block.color)
        read += len(block.offsets)
        progress.update(read / max(source.point_count, 1), f"Reading {name}")
    if best.parts:
        best.shrink()
        _, xyz, number, color = best.parts[0]
    else:
        xyz, number, color = np.zeros((0, 3)), np.zeros(0, np.int32), np.zeros((0, 3), np.uint8)
    return xyz, number, color if colored else None


def _block_priorities(block: ReturnBlock, mix: np.uint64, weighted: bool) -> NDArray[np.float64]:
    offsets = np.ascontiguousarray(block.offsets) + 0.0
    out = np.empty(len(offsets))
    _priorities(offsets, offsets.view(np.uint64), mix, weighted, NEAREST_M**2, FARTHEST_M**2, out)
    return out
