"""Query positions on the planned surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class SurfaceSamples:
    """Query positions Q, area-weighted, in the local frame of the model they were taken from."""

    position: NDArray[np.float64]
    """(N, 3) metres, local frame."""
    normal: NDArray[np.float64]
    """(N, 3) outward unit normals."""
    area: NDArray[np.float64]
    """(N,) m2 of surface that the sample stands for; an element's samples add up to its surface area."""
    element: NDArray[np.int32]
    """(N,) rows of ``model.elements``; ascending."""
    triangle: NDArray[np.int32]
    """(N,) rows of ``model.triangles``."""
    exposed: NDArray[np.bool_]
    """(N,) False where another element touches or encloses the position: no scanner could ever see it."""

    def __len__(self) -> int:
        return len(self.area)

    def first_of(self, elements: int) -> NDArray[np.int64]:
        """(elements + 1,) element ``e`` owns the rows ``first[e]:first[e + 1]``."""
        first: NDArray[np.int64] = np.searchsorted(self.element, np.arange(elements + 1))
        return first
