"""Floors that do not lie everywhere: a gallery, split levels."""

from __future__ import annotations

import numpy as np
import pytest

from bim_verify.core.reconstruction.building import Reconstruction

from .box_scan import WALL_M, scanned, walls_around


@pytest.fixture(scope="module")
def gallery(tmp_path_factory: pytest.TempPathFactory) -> Reconstruction:
    """A room of 7 x 5 m, 5.2 m high, with a deck over 3 of its 7 m."""
    t = WALL_M
    slabs = [(-t, -t, -0.25, 7 + t, 5 + t, 0.0), (-t, -t, 5.2, 7 + t, 5 + t, 5.4), (4.0, 0.0, 2.4, 7.0, 5.0, 2.6)]
    stations = [(1.5, 1.2, 1.5), (5.5, 2.5, 1.5), (5.5, 2.5, 4.1)]
    return scanned(tmp_path_factory.mktemp("gallery"), walls_around(7.0, 5.0, 0.0, 5.2), slabs, stations)


@pytest.fixture(scope="module")
def split(tmp_path_factory: pytest.TempPathFactory) -> Reconstruction:
    """Two rooms of 4 x 4 m, 2.6 m high, the second one 1.3 m higher; between them a wall with a hole above 1.3 m."""
    t = WALL_M
    walls = [
        (-t, -t, 0.0, 4.0, 0.0, 2.6), (-t, 4.0, 0.0, 4.0, 4 + t, 2.6), (-t, 0.0, 0.0, 0.0, 4.0, 2.6),
        (4.2, -t, 1.3, 8.2 + t, 0.0, 3.9), (4.2, 4.0, 1.3, 8.2 + t, 4 + t, 3.9), (8.2, 0.0, 1.3, 8.2 + t, 4.0, 3.9),
        (4.0, -t, 0.0, 4.2, 1.0, 3.9), (4.0, 2.0, 0.0, 4.2, 4 + t, 3.9), (4.0, 1.0, 0.0, 4.2, 2.0, 1.3),
        (4.0, 1.0, 2.4, 4.2, 2.0, 3.9),
    ]  # fmt: skip
    slabs = [
        (-t, -t, -0.25, 4.0, 4 + t, 0.0), (-t, -t, 2.6, 4.0, 4 + t, 2.8), (4.2, -t, 1.05, 8.2 + t, 4 + t, 1.3),
        (4.0, -t, 3.9, 8.2 + t, 4 + t, 4.1),
    ]  # fmt: skip
    stations = [(1.2, 1.5, 1.5), (2.8, 2.8, 1.55), (5.4, 1.5, 2.8), (7.0, 2.8, 2.85)]
    return scanned(tmp_path_factory.mktemp("split"), walls, slabs, stations)


def rooms(found: Reconstruction) -> list[list[tuple[float, float, float]]]:
    """Area, floor and height of each room of each storey, largest first."""
    z = found.origin[2]
    return [[(r.outline.area, r.floor + z, r.ceiling - r.floor) for r in s.rooms] for s in found.storeys]


def test_a_gallery_is_a_room_of_the_storey_where_its_deck_is(gallery: Reconstruction) -> None:
    (whole, below), (deck,) = rooms(gallery)
    assert whole == pytest.approx((20.0, 0.0, 5.2), abs=0.3) and whole[2] == pytest.approx(5.2, abs=0.005)
    assert below == pytest.approx((15.0, 0.0, 2.4), abs=0.3) and below[2] == pytest.approx(2.4, abs=0.005)
    assert deck == pytest.approx((15.0, 2.6, 2.6), abs=0.3) and deck[2] == pytest.approx(2.6, abs=0.005)


def test_the_slab_of_a_gallery_is_not_in_the_air_and_one_roof_covers_all(gallery: Reconstruction) -> None:
    upper = gallery.storeys[1]
    floor = next(s for s in upper.slabs if s.kind == "FLOOR")
    assert floor.footprint.area == pytest.approx(3.3 * 5.0, abs=0.6) and floor.thickness == pytest.approx(0.2, abs=0.005)
    (roof,) = [s for storey in gallery.storeys for s in storey.slabs if s.kind == "ROOF"]
    assert roof.footprint.area > 7.0 * 5.0


def test_a_wall_past_the_deck_stands_once(gallery: Reconstruction) -> None:
    lower, upper = gallery.storeys
    assert sorted(round(w.top - w.base, 1) for w in lower.walls) == [2.4, 5.2, 5.2, 5.2]
    assert [round(w.top - w.base, 1) for w in upper.walls] == [2.6]


def test_split_levels_have_their_whole_rooms(split: Reconstruction) -> None:
    (west,), (east,) = rooms(split)
    assert west == pytest.approx((16.0, 0.0, 2.6), abs=0.05)
    assert east == pytest.approx((16.0, 1.3, 2.6), abs=0.05)
    roofs = [[s.top - s.thickness + split.origin[2] for s in storey.slabs if s.kind == "ROOF"] for storey in split.storeys]
    assert np.concatenate(roofs) == pytest.approx([2.6, 3.9], abs=0.005)


def test_the_wall_between_split_levels_is_two_that_do_not_overlap(split: Reconstruction) -> None:
    z = split.origin[2]
    x = split.origin[0]
    lower, upper = (
        next(w for w in s.walls if abs(w.start[0] + x - 4.1) < 0.05 and abs(w.along[1]) > 0.9) for s in split.storeys
    )
    assert (lower.base + z, lower.top + z) == pytest.approx((0.0, 2.6), abs=0.005)
    assert (upper.base + z, upper.top + z) == pytest.approx((2.6, 3.9), abs=0.005)
    (hole,) = lower.openings
    assert (hole.z0 + z, hole.z1 + z) == pytest.approx((1.3, 2.4), abs=0.02) and not upper.openings


def test_it_is_said(gallery: Reconstruction, split: Reconstruction) -> None:
    assert all(sum("reach past the next storey's floor" in w for w in found.warnings) == 1 for found in (gallery, split))
