"""The simulated scanner against scenes whose answer is known."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from bim_verify.core.simulation.scanner import PRESETS, ROWS_PER_BAND, Scanner, scan_bands, scan_station
from bim_verify.core.simulation.scene import Prop, Scene, Unevenness

COARSE = Scanner("coarse", math.radians(0.5), sigma_range=0.002, sigma_signal=0.0)
EXACT = dataclasses.replace(COARSE, sigma_range=0.0, sigma_angle=0.0, weakest_power=0.0)
FINE = dataclasses.replace(
    EXACT, angular_step=math.radians(0.06), elevation_min=math.radians(-13.0), elevation_max=math.radians(13.0),
    range_resolution=0.5,
)
CENTRE = np.zeros(3)


def wall(x: float, half: float = 40.0) -> np.ndarray:
    """(2, 3, 3) an upright square across the x axis."""
    a, b, c, d = [x, -half, -half], [x, half, -half], [x, half, half], [x, -half, half]
    return np.array([[a, c, b], [a, d, c]])


def scene_of(*shapes: np.ndarray, **options: object) -> Scene:
    owner = np.concatenate([np.full(len(s), i, np.int32) for i, s in enumerate(shapes)])
    return Scene(np.concatenate(shapes), owner, [f"thing {i}" for i in range(len(shapes))], **options)


def test_returns_of_a_plane_lie_on_it_and_in_the_directions_of_their_cells() -> None:
    returns = scan_station(scene_of(wall(5.0)), CENTRE, np.eye(3), EXACT, seed=1)
    assert len(returns) > 10_000
    inner = np.abs(returns.offset[:, 1:]).max(axis=1) < 20.0  # beams beside the rim are averaged over their section
    np.testing.assert_allclose(returns.offset[inner, 0], 5.0, atol=1e-9)
    row, column = EXACT.cell(returns.offset)
    np.testing.assert_array_equal(row, returns.row)
    np.testing.assert_array_equal(column, returns.column)


def test_a_turned_scanner_reports_the_same_room_in_its_own_frame() -> None:
    turn = math.radians(30.0)
    rotation = np.array([[math.cos(turn), -math.sin(turn), 0], [math.sin(turn), math.cos(turn), 0], [0, 0, 1]])
    position = np.array([1.0, 2.0, 0.5])
    room = Prop("room", "box", (0.0, 0.0, 0.0), (8.0, 9.0, 7.0)).corners()
    returns = scan_station(scene_of(room), position, rotation, EXACT, seed=1)
    world = np.abs(returns.offset @ rotation.T + position)
    inside = ~returns.mixed
    to_wall = np.min(np.abs(world - [4.0, 4.5, 3.5]), axis=1)
    assert to_wall[inside].max() < 0.02, "beams at the room's edges see both walls"
    assert np.median(to_wall) < 1e-6
    assert len(returns) == EXACT.grid.rows * EXACT.grid.columns, "a closed room answers in every direction"


def test_the_cone_below_the_scanner_is_blind() -> None:
    room = Prop("room", "box", (0.0, 0.0, 0.0), (6.0, 6.0, 6.0)).corners()
    returns = scan_station(scene_of(room), CENTRE, np.eye(3), EXACT, seed=1)
    elevation = np.arcsin(returns.offset[:, 2] / np.linalg.norm(returns.offset, axis=1))
    assert elevation.min() > EXACT.elevation_min
    assert elevation.max() > math.radians(89.0)


def test_range_noise_has_the_stated_sigma() -> None:
    returns = scan_station(scene_of(wall(5.0)), CENTRE, np.eye(3), COARSE, seed=4)
    error = np.linalg.norm(returns.offset, axis=1) - returns.true_range
    assert np.std(error[~returns.mixed]) == pytest.approx(0.002, rel=0.03)
    assert abs(error.mean()) < 4 * 0.002 / math.sqrt(len(error))
    np.testing.assert_allclose(returns.sigma, 0.002)


def test_signal_noise_grows_with_range_and_incidence_and_falls_with_reflectance() -> None:
    scanner = dataclasses.replace(COARSE, sigma_range=0.001, sigma_signal=0.001)
    reflectance = np.array([0.5, 0.5, 0.5, 0.25])
    power = scanner.power(np.array([10.0, 20.0, 10.0, 10.0]), np.array([1.0, 1.0, 0.5, 1.0]), reflectance)
    np.testing.assert_allclose(power, [1.0, 0.25, 0.5, 0.5])
    np.testing.assert_allclose(scanner.sigma(power), 0.001 * np.sqrt([2.0, 5.0, 3.0, 3.0]))


def test_angular_noise_has_the_stated_sigma_across_the_ray() -> None:
    scanner = dataclasses.replace(EXACT, sigma_angle=1e-4)
    room = Prop("room", "box", (0.0, 0.0, 0.0), (9.0, 9.0, 9.0)).corners()
    returns = scan_station(scene_of(room), CENTRE, np.eye(3), scanner, seed=2)
    middle = (scanner.grid.rows - 20) > returns.row  # away from the zenith
    nominal = scanner.directions(0, scanner.grid.rows)[returns.row, returns.column][middle]
    measured = returns.offset[middle] / np.linalg.norm(returns.offset[middle], axis=1, keepdims=True)
    across = np.linalg.norm(measured - nominal, axis=1)
    assert math.sqrt(np.mean(across**2) / 2) == pytest.approx(1e-4, rel=0.02)


def test_mixed_pixels_lie_between_the_surfaces() -> None:
    near = wall(5.0, half=1.0)
    returns = scan_station(scene_of(near, wall(5.2, half=4.0)), CENTRE, np.eye(3), FINE, seed=3)
    looked_at = np.abs(returns.offset[:, 1]) < 3.0
    mixed = returns.offset[returns.mixed & looked_at]
    assert len(mixed) > 200
    assert (mixed[:, 0] >= 5.0 - 1e-6).all() and (mixed[:, 0] <= 5.2 + 1e-6).all()
    assert ((mixed[:, 0] > 5.02) & (mixed[:, 0] < 5.18)).mean() > 0.3
    at_edge = np.abs(np.abs(mixed[:, 1:]).max(axis=1) / mixed[:, 0] - 0.2)
    assert at_edge.max() < 2e-3, "only where the beam straddles the near wall's edge"
    plain = returns.offset[~returns.mixed & looked_at]
    assert np.minimum(np.abs(plain[:, 0] - 5.0), np.abs(plain[:, 0] - 5.2)).max() < 1e-3


def test_surfaces_further_apart_than_the_range_resolution_do_not_mix() -> None:
    returns = scan_station(scene_of(wall(5.0, half=1.0), wall(7.0)), CENTRE, np.eye(3), FINE, seed=3)
    depth = returns.offset[np.abs(returns.offset[:, 1]) < 3.0, 0]
    assert np.minimum(np.abs(depth - 5.0), np.abs(depth - 7.0)).max() < 1e-3


def test_a_beam_partly_in_the_sky_returns_less_light() -> None:
    returns = scan_station(scene_of(wall(5.0, half=1.0)), CENTRE, np.eye(3), FINE, seed=3)
    rim = np.abs(np.abs(returns.offset[:, 1:]).max(axis=1) - 1.0) < 5e-4
    full = np.abs(returns.offset[:, 1:]).max(axis=1) < 0.9
    assert returns.intensity[rim].mean() < 0.8 * returns.intensity[full].mean()


def test_far_dark_and_grazing_surfaces_do_not_answer() -> None:
    scanner = dataclasses.replace(EXACT, weakest_power=0.02)
    bright = scan_station(scene_of(wall(5.0), reflectance=np.array([0.8])), CENTRE, np.eye(3), scanner, seed=1)
    dark = scan_station(scene_of(wall(5.0), reflectance=np.array([0.05])), CENTRE, np.eye(3), scanner, seed=1)
    half_lost = (0.02 * 0.5 / 0.05 * (5.0 / 10.0) ** 2) ** (1 / 3)  # P = rho / 0.5 * cos * (10 cos / 5)^2 = 0.02

    def answered(low: float, high: float) -> float:
        shares = [np.count_nonzero((5.0 / r.true_range > low) & (5.0 / r.true_range <= high)) for r in (dark, bright)]
        return shares[0] / shares[1]

    assert answered(half_lost - 0.02, half_lost + 0.02) == pytest.approx(0.5, abs=0.1)
    assert answered(0.9, 1.0) > 0.99
    assert answered(0.1, 0.2) < 0.01
    short = scan_station(scene_of(wall(5.0)), CENTRE, np.eye(3), dataclasses.replace(EXACT, range_max=8.0), seed=1)
    assert short.true_range.max() <= 8.0


def test_panes_are_seen_through_lost_or_met() -> None:
    pane, behind = wall(4.0), wall(6.0)
    glass = np.array([True, True, False, False])
    returns = scan_station(scene_of(pane, behind, glass=glass), CENTRE, np.eye(3), EXACT, seed=5)
    plain = scan_station(scene_of(behind), CENTRE, np.eye(3), EXACT, seed=5)
    assert 0.6 < (returns.owner == 1).sum() / len(plain) < 0.8
    assert 0.02 < (returns.owner == 0).sum() / len(plain) < 0.1
    head_on = returns.offset[:, 0] / np.linalg.norm(returns.offset, axis=1) > math.cos(math.radians(1.5))
    assert (returns.owner[head_on] == 0).all(), "met head-on, a pane mirrors the beam back"


def test_an_owner_that_loses_beams_answers_less_often() -> None:
    half = scan_station(scene_of(wall(5.0), lost_share=np.array([0.5])), CENTRE, np.eye(3), EXACT, seed=6)
    full = scan_station(scene_of(wall(5.0)), CENTRE, np.eye(3), EXACT, seed=6)
    assert len(half) / len(full) == pytest.approx(0.5, abs=0.02)


def test_unevenness_has_the_stated_size() -> None:
    bumpy = scene_of(wall(5.0), unevenness=Unevenness(0.002, 0.3, seed=1))
    returns = scan_station(bumpy, CENTRE, np.eye(3), EXACT, seed=7)
    steep = np.abs(returns.offset[:, 1:]).max(axis=1) < 5.0
    assert np.std(returns.offset[steep, 0] - 5.0) == pytest.approx(0.002, rel=0.15)


def test_the_same_seed_gives_the_same_returns_and_another_does_not() -> None:
    scene = scene_of(wall(5.0, half=1.0), wall(5.1))
    first, second = (scan_station(scene, CENTRE, np.eye(3), COARSE, seed=8) for _ in range(2))
    for field in dataclasses.fields(first):
        np.testing.assert_array_equal(getattr(first, field.name), getattr(second, field.name))
    other = scan_station(scene, CENTRE, np.eye(3), COARSE, seed=9)
    assert len(other) != len(first) or not np.array_equal(other.offset, first.offset)


def test_bands_are_ordered_and_bounded() -> None:
    bands = list(scan_bands(scene_of(wall(5.0)), CENTRE, np.eye(3), COARSE, seed=1))
    rows = np.concatenate([band.row for band in bands])
    assert (np.diff(rows) >= 0).all()
    assert max(np.ptp(band.row) for band in bands if len(band)) < ROWS_PER_BAND


def test_nothing_to_see_gives_no_returns() -> None:
    nothing = Scene(np.zeros((0, 3, 3)), np.zeros(0, np.int32), [])
    assert len(scan_station(nothing, CENTRE, np.eye(3), COARSE, seed=1)) == 0


@pytest.mark.parametrize("name", sorted(PRESETS))
def test_presets_cover_the_circle(name: str) -> None:
    grid = PRESETS[name].grid
    assert grid.columns * PRESETS[name].angular_step == pytest.approx(2 * math.pi, rel=1e-3)
    assert grid.rows * PRESETS[name].angular_step == pytest.approx(math.radians(150.0), rel=1e-3)
