"""Rays that leave a hole behind the wall say how thick the wall is at most."""

from __future__ import annotations

import numpy as np
import pytest

from bim_verify.core.reconstruction.crossings import Crossings
from bim_verify.core.reconstruction.opening_fill import passed_depth
from bim_verify.core.reconstruction.openings import Opening
from bim_verify.core.reconstruction.thickness import Hint, hint, settle
from bim_verify.core.reconstruction.walls import WallLine

BOX = (1.0, 2.2, 0.9, 2.1)
THICK_M = 0.24


def rays(step_deg: float, back_from: float) -> Crossings:
    """Of a scanner 1.5 m before a wall with a hole; they end on its reveals, or ``back_from`` metres behind the face."""
    turn = np.radians(np.arange(-59.9, 60.0, step_deg))
    tilt = np.radians(np.arange(-19.9, 20.0, step_deg))
    along, up = (v.ravel() for v in np.meshgrid(np.tan(turn), np.tan(tilt)))
    u, z = 0.9 + 1.5 * along, 1.6 + 1.5 * up
    inside = (u > BOX[0]) & (u < BOX[1]) & (z > BOX[2]) & (z < BOX[3])
    u, z, along, up = u[inside], z[inside], along[inside], up[inside]
    with np.errstate(divide="ignore"):
        leave = np.minimum.reduce([
            np.where(along > 0, (BOX[1] - u) / along, (BOX[0] - u) / along),
            np.where(up > 0, (BOX[3] - z) / up, (BOX[2] - z) / up),
        ])  # fmt: skip
    depth = np.where(leave < THICK_M, leave, back_from)
    return Crossings(u, z, depth, u + depth * along, z + depth * up, np.arange(len(u)))


@pytest.mark.parametrize("step_deg", [0.25, 0.5])
def test_rays_that_come_back_from_outside_bound_the_thickness(step_deg: float) -> None:
    bound = passed_depth(rays(step_deg, 8.0), BOX, (0.002, 0.002, 0.002, 0.002))
    assert THICK_M < bound < THICK_M + 0.03


def test_without_returns_from_outside_or_with_hidden_sides_nothing_is_known() -> None:
    assert passed_depth(rays(0.5, 0.2), BOX, (0.0, 0.0, 0.0, 0.0)) == np.inf
    assert passed_depth(rays(0.5, 8.0), BOX, (np.inf, np.inf, 0.0, np.inf)) == np.inf


def test_a_wall_is_no_thicker_than_rays_beside_its_hole_allow() -> None:
    window = Opening(*BOX, "window", True, 1.0, (0.0005,) * 4)
    told = hint(rays(0.5, 8.0), [window], 0.012)
    assert THICK_M < told.at_most < THICK_M + 0.04


@pytest.mark.parametrize(("at_most", "expected"), [(np.inf, 0.314), (0.26, 0.2495), (0.2, 0.314)])
def test_what_one_wall_shows_ends_the_reveals_of_walls_as_thick(at_most: float, expected: float) -> None:
    walls = [WallLine(np.array([1.0, 0.0]), 0.0, 0.0, "ASSUMED", 0.0, 5.0) for _ in range(2)]
    settle(walls, [Hint((0.239, 0.389), 0.239, 0.08), Hint(None, 0.1, 0.08, at_most)])
    assert walls[0].source == "REVEAL" and walls[0].thickness == pytest.approx(expected)
    assert walls[1].thickness == pytest.approx(min(expected, at_most))
