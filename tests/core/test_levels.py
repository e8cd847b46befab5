"""Storeys from what the stations stand on and under."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from bim_verify.core.planes.surfels import Surfels
from bim_verify.core.reconstruction.levels import find_storeys

STEP_M = 0.06


def level(height: float, up: float, x: tuple[float, float], y: tuple[float, float] = (0.0, 5.0)) -> NDArray[np.float64]:
    """(N, 6) places and normals of a level surface that is seen from above (``up`` 1) or below (-1)."""
    gx, gy = (v.ravel() for v in np.meshgrid(np.arange(*x, STEP_M), np.arange(*y, STEP_M)))
    rows = np.zeros((len(gx), 6))
    rows[:, 0], rows[:, 1], rows[:, 2], rows[:, 5] = gx, gy, height, up
    return rows


def surfels(*levels: NDArray[np.float64]) -> Surfels:
    rows = np.concatenate(levels)
    n = len(rows)
    return Surfels(rows[:, :3], rows[:, 3:], np.full(n, 0.001), np.zeros(n), np.full(n, STEP_M**2), np.full(n, 20))


@pytest.mark.parametrize("upper", [5.0, 7.0, 9.0])
def test_a_storey_below_an_equal_or_a_larger_one_has_its_own_ceiling(upper: float) -> None:
    shown = surfels(
        level(0.0, 1.0, (0.0, 7.0)), level(2.7, -1.0, (0.0, 7.0), (0.0, 3.5)), level(3.0, 1.0, (0.0, upper)),
        level(5.6, -1.0, (0.0, upper)),
    )
    stations = np.array([[1.5, 1.2, 1.5], [5.5, 1.5, 1.5], [1.5, 1.2, 4.5], [4.5, 3.5, 4.5]])
    lower, higher = find_storeys(shown, stations)
    assert lower.has_ceiling and lower.ceiling == pytest.approx(2.7) and lower.floor == pytest.approx(0.0)
    assert lower.stations == (0, 1) and lower.top < higher.floor
    assert higher.has_ceiling and higher.ceiling == pytest.approx(5.6) and higher.stations == (2, 3)


def test_a_storey_whose_ceiling_was_not_seen_does_not_borrow_that_of_the_next() -> None:
    shown = surfels(level(0.0, 1.0, (0.0, 7.0)), level(3.0, 1.0, (0.0, 7.0)), level(5.6, -1.0, (0.0, 7.0)))
    lower, higher = find_storeys(shown, np.array([[1.5, 1.2, 1.5], [1.5, 1.2, 4.5]]))
    assert not lower.has_ceiling and higher.has_ceiling


def test_a_station_outside_is_on_no_storey() -> None:
    shown = surfels(level(0.0, 1.0, (0.0, 7.0)), level(2.7, -1.0, (0.0, 7.0)), level(-2.0, 1.0, (20.0, 27.0)))
    (only,) = find_storeys(shown, np.array([[1.5, 1.2, 1.5], [23.0, 2.0, -0.4]]))
    assert only.stations == (0,) and only.floor == pytest.approx(0.0)


def test_a_storey_under_a_gallery_goes_on_past_its_deck_and_the_next_is_beside_it() -> None:
    shown = surfels(
        level(0.0, 1.0, (0.0, 7.0)), level(2.4, -1.0, (4.0, 7.0)), level(2.6, 1.0, (4.0, 7.0)), level(5.2, -1.0, (0.0, 7.0))
    )
    lower, deck = find_storeys(shown, np.array([[1.5, 1.2, 1.5], [5.5, 2.5, 1.5], [5.5, 2.5, 4.1]]))
    assert lower.past == pytest.approx(2.6) and lower.top == pytest.approx(5.2) and not lower.beside
    assert deck.beside and np.isinf(deck.past) and lower.closed().top < 2.6


def test_a_storeys_floor_is_that_of_its_rooms_not_between_it_and_a_balcony() -> None:
    shown = surfels(
        level(3.0, 1.0, (0.0, 7.0)), level(5.6, -1.0, (0.0, 7.0)), level(2.7, 1.0, (7.3, 9.0)), level(5.6, -1.0, (7.3, 9.0))
    )
    (only,) = find_storeys(shown, np.array([[1.5, 1.2, 4.5], [8.1, 2.5, 4.2]]))
    assert only.floor == pytest.approx(3.0)
