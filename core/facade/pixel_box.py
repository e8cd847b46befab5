"""A rectangle of a rectified picture, and rows and columns of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SAME_M = 0.2
"""Edges of elements of one row or column agree as well as this."""


@dataclass(frozen=True)
class PixelBox:
    """Rows and columns of the rectified picture, end not included; fractions of pixels."""

    x0: float
    y0: float
    x1: float
    y1: float
    inferred: bool = False

    @property
    def width(self) -> float:
        return self.x1 - self.x0

    @property
    def height(self) -> float:
        return self.y1 - self.y0


def overlap(a: PixelBox, b: PixelBox) -> float:
    """Of the smaller one's area."""
    w, h = min(a.x1, b.x1) - max(a.x0, b.x0), min(a.y1, b.y1) - max(a.y0, b.y0)
    return 0.0 if w <= 0 or h <= 0 else w * h / max(min(a.width * a.height, b.width * b.height), 1e-9)


def groups(boxes: list[PixelBox], axis: str, scale: float) -> list[list[int]]:
    """Rows (axis y) or columns (axis x): boxes whose two edges along that axis agree."""
    out: list[list[int]] = []
    for k, box in enumerate(boxes):
        for group in out:
            first = boxes[group[0]]
            if all(abs(getattr(box, f"{axis}{e}") - getattr(first, f"{axis}{e}")) < SAME_M * scale for e in (0, 1)):
                group.append(k)
                break
        else:
            out.append([k])
    return out


def mean_in(values: NDArray[np.generic], box: PixelBox) -> float:
    part = values[max(round(box.y0), 0) : max(round(box.y1), 1), max(round(box.x0), 0) : max(round(box.x1), 1)]
    return float(part.mean()) if part.size else 0.0
