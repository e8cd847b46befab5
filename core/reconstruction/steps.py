"""What lies flat a few centimetres before or behind the rest of a wall's face: boards, linings, wainscots, bare wall."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from .crossings import Crossings
from .face_points import EDGE_M, SMALLEST_CELL_M, middles

Box = tuple[float, float, float, float]

REACH_M = 0.05
LEAST_STEP_M = 0.008
LEAST_SHARE = 0.05
"""Of a face; less is not worth a word."""
FLAT = 0.5
"""Returns of one surface scatter less than this share of the band, in half the distance of their quartiles."""


@dataclass(frozen=True)
class Step:
    """A part of a face that does not lie in its plane."""

    by: float
    """Where most of it lies: behind the face, or before it where negative [m]."""
    share: float
    """Of what was seen of the face, 0..1."""


def find_step(
    side: Crossings, u: tuple[float, float], z: tuple[float, float], band: float, holes: Iterable[Box] = ()
) -> Step | None:
    """The larger one of what lies before and what lies behind; None where there is little of either.

    What stands in ``holes`` (u0, u1, z0, z1) is no part of the face.
    """
    near = np.abs(side.depth) < REACH_M
    for u0, u1, z0, z1 in holes:
        near &= ~(
            (side.end_u > u0 - EDGE_M) & (side.end_u < u1 + EDGE_M) & (side.end_z > z0 - EDGE_M) & (side.end_z < z1 + EDGE_M)
        )
    number = ((np.column_stack([side.end_u, side.end_z])[near] - (u[0], z[0])) / SMALLEST_CELL_M).astype(np.int64)
    shape = tuple(int((high - low) / SMALLEST_CELL_M) + 1 for low, high in (u, z))
    number = np.clip(number, 0, np.array(shape) - 1)
    middle, scatter = middles(number[:, 0] * shape[1] + number[:, 1], side.depth[near], (shape[0], shape[1]))
    seen = np.isfinite(middle) & (scatter < FLAT * band)
    parts = [seen & (middle < -LEAST_STEP_M), seen & (middle > LEAST_STEP_M)]
    part = max(parts, key=np.count_nonzero)
    share = part.sum() / max(int(seen.sum()), 1)
    return Step(float(np.median(middle[part])), float(share)) if share > LEAST_SHARE else None
