"""Does the colour lie where the points are? The shift between a station's picture of colour and that of its returns."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from ..progress import Progress
from ..scans.campaign import Grid, ScanSource

MOST_PIXELS = 1_500_000
LEAST_FILLED = 0.1
LEAST_PEAK = 6.0
"""Height of the correlation's peak over its spread, below which the shift is not found."""
GREY = np.array([0.299, 0.587, 0.114])


@dataclass(frozen=True)
class ColorStudy:
    """What can be said of the colour of a campaign."""

    shift_rad: float | None
    """Median angle between colour and geometry; None where it cannot be measured."""
    why: str
    """What was measured, or why nothing was."""


class _Picture:
    def __init__(self, grid: Grid) -> None:
        self.step = max(1, math.ceil(math.sqrt(grid.rows * grid.columns / MOST_PIXELS)))
        shape = math.ceil(grid.rows / self.step), math.ceil(grid.columns / self.step)
        self.color, self.shade, self.count = (np.zeros(shape) for _ in range(3))

    def add(self, row: NDArray[np.int32], column: NDArray[np.int32], color: NDArray[np.uint8], shade: NDArray) -> None:
        at = (row // self.step).astype(np.int64) * self.color.shape[1] + column // self.step
        good = (at >= 0) & (at < self.color.size)
        at, size = at[good], self.color.size
        for picture, values in ((self.color, color[good] @ GREY), (self.shade, shade[good]), (self.count, np.ones(len(at)))):
            picture += np.bincount(at, weights=values, minlength=size).reshape(picture.shape)

    def shift(self) -> tuple[float, float] | None:
        """(rows, columns) by which the colour lies off; None where no clear peak is found."""
        known = self.count > 0
        if known.mean() < LEAST_FILLED:
            return None
        first, second = (_edges(p / np.maximum(self.count, 1), known) for p in (self.color, self.shade))
        if first.std() < 1e-9 or second.std() < 1e-9:
            return None
        cross = np.fft.rfft2(first) * np.conj(np.fft.rfft2(second))
        size = np.abs(cross)
        found = np.fft.irfft2(cross / np.maximum(size, 1e-9 * size.max()), s=first.shape)  # phases alone: a sharp peak
        peak = np.unravel_index(int(np.argmax(found)), found.shape)
        if (found[peak] - found.mean()) / found.std() < LEAST_PEAK:
            return None
        shift: list[float] = []
        for axis, size in enumerate(found.shape):
            line = np.take(found, peak[1 - axis], axis=1 - axis)
            around = [float(line[(peak[axis] + d) % size]) for d in (-1, 0, 1)]
            curve = around[0] - 2 * around[1] + around[2]
            place = int(peak[axis]) + (0.5 * (around[0] - around[2]) / curve if curve < 0 else 0.0)
            shift.append(((place + size / 2) % size - size / 2) * self.step)
        return shift[0], shift[1]


def _edges(picture: NDArray[np.float64], known: NDArray[np.bool_]) -> NDArray[np.float64]:
    inner = ndimage.binary_erosion(known, iterations=2)
    picture = np.where(known, picture, picture[known].mean())
    size = np.hypot(ndimage.sobel(picture, 0), ndimage.sobel(picture, 1))
    size = np.where(inner, np.sqrt(size), 0.0)
    return np.where(inner, size - (size[inner].mean() if inner.any() else 0.0), 0.0)


def study_color(source: ScanSource, spacing: list[float], progress: Progress) -> ColorStudy:
    """Shift between colour and intensity (range, where there is none) of organised scans. ``spacing`` [rad] per station."""
    first = next(iter(source.blocks(4096, attributes=True)), None)
    if first is None or first.color is None:
        return ColorStudy(None, "the file has no colour")
    grids = [s.grid for s in source.stations]
    if first.row is None or not any(grids):
        return ColorStudy(None, "the scans are not in rows and columns, so edges of colour cannot be set against other edges")
    pictures: dict[int, _Picture] = {}
    done = 0
    for block in source.blocks(attributes=True):
        done += len(block.offsets)
        progress.update(done / max(source.point_count, 1), "Comparing colour with geometry")
        grid = grids[block.station]
        if grid is None or block.color is None or block.row is None or block.column is None:
            continue
        picture = pictures.setdefault(block.station, _Picture(grid))
        shade = block.intensity if block.intensity is not None else np.log(np.linalg.norm(block.offsets, axis=1))
        picture.add(block.row, block.column, block.color, shade)
    found = []
    for station, picture in pictures.items():
        shift = picture.shift()
        if shift is not None and math.isfinite(spacing[station]):
            found.append(math.hypot(*shift) * spacing[station])
    if not found:
        return ColorStudy(None, "the pictures of colour and of intensity have no edges in common that would show a shift")
    angle = float(np.median(found))
    return ColorStudy(
        angle,
        f"colour lies {math.degrees(angle):.3f} degrees off the returns ({1000 * 10 * angle:.1f} mm at 10 m), "
        f"median of {len(found)} stations",
    )
