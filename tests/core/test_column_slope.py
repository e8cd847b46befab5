"""Columns under a ceiling that is sloped: seen up to where it is over them."""

from __future__ import annotations

import numpy as np
import pytest
from shapely import box

from bim_verify.core.planes.cloud import Cloud
from bim_verify.core.planes.surfels import Surfels
from bim_verify.core.reconstruction.columns import column_returns
from bim_verify.core.reconstruction.plan import PlanRaster
from bim_verify.core.reconstruction.rooms import Room

CELL_M = 0.06
RADIUS_M = 0.2
SIZE_M = 6.0


def over(y: float) -> float:
    """The ceiling's height: 2.6 m at the one side, 4.1 m at the other."""
    return 2.6 + 0.25 * y


@pytest.mark.parametrize("y", [1.0, 3.0, 5.0])
@pytest.mark.parametrize(("below", "found"), [(0.05, True), (0.5, False)])
def test_a_column_reaches_to_the_ceiling_over_it(y: float, below: float, found: bool) -> None:
    angle, z = (v.ravel() for v in np.meshgrid(np.arange(0.0, 2 * np.pi, 0.1), np.arange(0.02, over(y) - below, 0.03)))
    out = np.column_stack([np.cos(angle), np.sin(angle)])
    points = np.column_stack([3.0 + RADIUS_M * out[:, 0], y + RADIUS_M * out[:, 1], z])
    count = len(points)
    upright = Surfels(
        points, np.column_stack([out, np.zeros(count)]), np.full(count, 0.002), np.full(count, 0.01),
        np.full(count, CELL_M**2), np.full(count, 9),
    )  # fmt: skip
    side = np.linspace(0.0, SIZE_M, 41)[:-1]
    flat = np.column_stack([v.ravel() for v in np.meshgrid(side, side)])
    ceiling = np.column_stack([flat, over(flat[:, 1])])
    both = np.concatenate([points, ceiling]).astype(np.float32)
    cloud = Cloud(both, np.zeros(len(both), dtype=np.int32), np.array([[1.0, 1.0, 1.5]]), np.zeros(3), len(both))
    cells = int(SIZE_M / CELL_M)
    heights = np.tile(over((np.arange(cells) + 0.5) * CELL_M), (cells, 1))
    plan = PlanRaster(
        np.zeros(2), CELL_M, heights, np.zeros_like(heights), np.ones(heights.shape, dtype=np.bool_),
        np.ones(heights.shape, dtype=np.int32),
    )  # fmt: skip
    candidates = column_returns(Room(box(0.0, 0.0, SIZE_M, SIZE_M), (), (), 0.0, over(3.0)), upright, cloud, plan)
    assert len(candidates) == found
    for candidate in candidates:
        assert candidate.top == pytest.approx(over(y), abs=0.03)
        assert candidate.rows.max() < count  # none of the ceiling
        assert cloud.points[candidate.rows, 2].max() > over(y) - 0.2
