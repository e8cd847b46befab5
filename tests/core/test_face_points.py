"""Which returns of a wall are taken for its face: bulges and leans are, what stands before it is not."""

from __future__ import annotations

import numpy as np
import pytest

from bim_verify.core.planes.conformity import flatness, plumb
from bim_verify.core.planes.fit import fit_plane
from bim_verify.core.planes.noise import PointNoise
from bim_verify.core.reconstruction.face_points import EDGE_M, surface_returns

WIDE, HIGH, BAND = 5.0, 2.7, 0.012
ENDS = np.array([[0.0, 0.0], [WIDE, HIGH]])
NOTHING = np.zeros((0, 2, 2))


def wall(count: int = 60_000, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.random((count, 2)) * (WIDE, HIGH), rng.normal(0.0, 0.002, count)


def test_a_flat_wall_is_flat_beside_what_stands_before_it() -> None:
    at, off = wall()
    furniture = (at[:, 0] > 1.0) & (at[:, 0] < 2.0) & (at[:, 1] < 2.0)
    off[furniture] -= 0.04
    mixed = (np.abs(at[:, 0] - 2.0) < 0.02) & (at[:, 1] < 2.0)
    off[mixed] -= np.random.default_rng(2).random(int(mixed.sum())) * 0.04
    own = surface_returns(at, off, BAND, ENDS, np.array([[[3.0, 0.9], [4.0, 2.0]]]))
    assert not own[furniture].any()
    assert own[~furniture & ~mixed].mean() > 0.7
    assert not own[(at < EDGE_M).any(axis=1)].any()
    points = np.column_stack([at[own, 0], off[own], at[own, 1]])
    plane = fit_plane(points[::3], points[::3] - (0.0, 1.0, 0.0), PointNoise(0.002, 0.0, 0.0))
    assert all(t.p_value > 0.01 and not t.exceeds for t in flatness(plane, points))


@pytest.mark.parametrize("bulge", [0.015, 0.03, 0.06])
def test_a_bulge_shows_the_more_the_larger_it_is(bulge: float) -> None:
    at, off = wall()
    away = np.hypot(at[:, 0] - 2.5, at[:, 1] - 1.35)
    off += np.where(away < 0.6, bulge * np.cos(np.pi * away / 1.2) ** 2, 0.0)
    own = surface_returns(at, off, BAND, ENDS, NOTHING)
    points = np.column_stack([at[own, 0], off[own], at[own, 1]])
    plane = fit_plane(points, points - (0.0, 1.0, 0.0), PointNoise(0.002, 0.0, 0.0))
    test = next(t for t in flatness(plane, points) if t.name == "flatness 1 m")
    assert test.exceeds
    assert 0.75 * bulge < test.value < 1.1 * bulge


def test_a_wall_that_leans_out_of_the_band_leans_as_far() -> None:
    at, off = wall()
    off += 0.06 * (at[:, 1] / HIGH - 0.5)
    own = surface_returns(at, off, BAND, ENDS, NOTHING)
    points = np.column_stack([at[own, 0], -off[own], at[own, 1]])
    plane = fit_plane(points, points + np.array([0.0, 1.0, 0.0]), PointNoise(0.002, 0.0, 0.0))
    lean = plumb(plane.facing(np.array([2.0, 5.0, 1.0])), HIGH)
    assert abs(lean.value) == pytest.approx(0.06, abs=0.001)
    assert lean.exceeds
