"""Holes of which furniture leaves little to see."""

from __future__ import annotations

import numpy as np
import pytest

from bim_verify.core.reconstruction.crossings import Crossings
from bim_verify.core.reconstruction.hole_rectangles import HIDDEN, OPEN, SOLID, FaceRaster, without_islands
from bim_verify.core.reconstruction.openings import Opening, face_raster, find_openings

BAND = 0.012
Box = tuple[float, float, float, float]


def openings(holes: list[Box], hidden: list[Box], touching: Box = (0.0, 0.0, 0.0, 0.0)) -> list[Opening]:
    """Of a wall of 4 m by 2.6 m seen at right angles; boxes are u0, u1, z0, z1, what hides stands 0.5 m before the wall.

    What is ``touching`` lies in the wall's plane before a hole.
    """
    u, z = (v.ravel() for v in np.meshgrid(np.arange(0.005, 4.0, 0.01), np.arange(0.005, 2.6, 0.01)))
    depth = np.random.default_rng(1).normal(0.0, 0.002, len(u))
    for boxes, at in ((holes, 3.0), (hidden, -0.5), ([touching], 0.0)):
        for u0, u1, z0, z1 in boxes:
            depth[(u > u0) & (u < u1) & (z > z0) & (z < z1)] = at
    side = Crossings(u, z, depth, u, z, np.arange(len(u)))
    return find_openings(face_raster([side], (0.0, 4.0), (0.0, 2.6), BAND), [side], 0.0, 0.3, BAND, False)


def test_a_strip_over_a_cupboard_is_a_hole_where_wall_is_seen_beside_and_above_it() -> None:
    (opening,) = openings([(1.0, 2.2, 0.9, 2.1)], [(0.6, 2.8, 0.0, 2.02)])
    assert (opening.u0, opening.u1, opening.z1) == pytest.approx((1.0, 2.2, 2.1), abs=0.03)
    assert "sill" in opening.hidden and opening.foot_hidden


def test_a_strip_of_which_two_sides_are_hidden_is_no_hole() -> None:
    assert openings([(1.0, 2.2, 0.9, 2.1)], [(0.6, 2.8, 0.0, 1.9), (0.6, 2.8, 1.98, 2.6)]) == []


def test_a_strip_beside_the_rest_of_its_hole_is_no_hole_of_its_own() -> None:
    post = (1.44, 1.6, 1.9, 2.6)
    found = openings([(1.0, 2.4, 0.9, 2.1)], [(1.5, 3.0, 0.0, 2.02), post])
    assert len(found) == 1 and (found[0].u0, found[0].u1) == pytest.approx((1.0, 2.4), abs=0.02)


def test_a_corner_gives_the_place_of_a_hole_that_is_mostly_hidden() -> None:
    (opening,) = openings([(1.0, 2.6, 0.9, 2.1)], [(1.16, 3.0, 0.0, 1.95)])
    assert (opening.u0, opening.u1, opening.z0, opening.z1) == pytest.approx((1.0, 2.6, 0.9, 2.1), abs=0.02)
    assert opening.hidden == ()


def test_a_hole_goes_on_to_where_its_side_is_seen_again_between_two_things() -> None:
    hole, chest, shelf = (1.0, 2.0, 0.7, 2.3), (0.8, 2.4, 0.0, 1.36), (0.8, 2.4, 1.45, 1.8)
    (opening,) = openings([hole], [chest, shelf])
    assert (opening.u0, opening.u1, opening.z1) == pytest.approx((1.0, 2.0, 2.3), abs=0.02)
    assert opening.hidden == ("sill",) and 0.0 < opening.z0 < 1.36


def test_a_thing_that_stands_free_in_a_doorway_in_the_walls_plane_is_no_wall() -> None:
    """The floor's returns in that plane join it to the wall in the lowest line of cells."""
    (opening,) = openings([(1.0, 2.2, 0.02, 2.1)], [], (1.3, 2.0, 0.02, 1.25))
    assert (opening.u0, opening.u1, opening.z0, opening.z1) == pytest.approx((1.0, 2.2, 0.0, 2.1), abs=0.02)
    assert opening.hidden == ()


def test_what_stands_in_a_hole_and_meets_its_side_is_wall() -> None:
    state = np.full((100, 60), SOLID, dtype=np.int8)
    state[20:60, 2:50] = OPEN
    state[20:50, 2:30] = SOLID
    assert (without_islands(FaceRaster(state, 0.02, 0.0, 0.0)).state == state).all()
    state[20:30, 2:30] = OPEN
    assert (without_islands(FaceRaster(state, 0.02, 0.0, 0.0)).state == HIDDEN).sum() == 20 * 25


def test_wall_between_two_holes_over_each_other_parts_them() -> None:
    upper, lower = (1.0, 2.0, 1.7, 2.3), (1.0, 2.0, 0.5, 1.1)
    found = openings([upper, lower], [(0.8, 1.4, 1.0, 1.8)])
    assert sorted(o.z1 for o in found) == pytest.approx([1.1, 2.3], abs=0.02)


@pytest.mark.parametrize("row", [(1.3, 1.4, 1.48, 1.5), (1.3, 1.7, 1.49, 1.5)])
def test_a_row_of_returns_on_a_cupboards_top_is_not_the_sill(row: Box) -> None:
    (opening,) = openings([(1.0, 2.2, 0.9, 2.1)], [(0.6, 2.8, 0.0, 1.5)], row)
    assert opening.foot_hidden and opening.hidden == ("sill",)
    assert opening.z0 - 1.96 * opening.edge_sigma[2] < 0.9 < 1.45 < opening.z0 + 1.96 * opening.edge_sigma[2]


def test_a_low_strip_of_wall_over_a_cupboard_shows_the_sill() -> None:
    (opening,) = openings([(1.0, 2.2, 0.9, 2.1)], [(0.6, 2.8, 0.0, 0.84)])
    assert not opening.foot_hidden and opening.hidden == ()
    assert opening.z0 == pytest.approx(0.9, abs=0.006)
