"""Ends of walls where three of them meet."""

from __future__ import annotations

import numpy as np
import pytest

from bim_verify.core.reconstruction.joins import join_walls
from bim_verify.core.reconstruction.walls import WallLine


def line(start: tuple[float, float], end: tuple[float, float], thickness: float) -> WallLine:
    """By its axis."""
    step = np.subtract(end, start)
    along = step / np.linalg.norm(step)
    normal = np.array([-along[1], along[0]])
    return WallLine(
        along, float(normal @ start) + thickness / 2, thickness, "MEASURED", float(along @ start), float(along @ end)
    )


def test_a_partition_ends_at_the_corner_of_two_outer_walls() -> None:
    east, north = line((6.5, 5.15), (12.0, 5.15), 0.3), line((6.65, 5.24), (6.65, 9.0), 0.3)
    partition = join_walls([line((0.0, 5.12), (6.5, 5.12), 0.24), north, east])[0]
    assert partition.end == pytest.approx([6.5, 5.12])
    assert partition.joins[1] is not None and partition.joins[1].kind == "BUTT"
    assert partition.footprint.bounds == pytest.approx((0.0, 5.0, 6.5, 5.24))


def test_two_walls_at_a_corner_are_mitred() -> None:
    a, b = join_walls([line((0.0, 0.0), (4.0, 0.0), 0.2), line((4.0, 0.0), (4.0, 3.0), 0.2)])
    assert a.end == pytest.approx([4.0, 0.0]) and b.start == pytest.approx([4.0, 0.0])
    assert a.footprint.intersection(b.footprint).area == pytest.approx(0.0, abs=1e-9)
    assert {j.kind for w in (a, b) for j in w.joins if j} == {"CORNER"}
