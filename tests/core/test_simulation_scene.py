"""Scenes as built, stand points, and what can be seen from them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bim_verify.core.simulation.scene import Edit, Prop, Scene, build_scene, thinnest_axis
from bim_verify.core.simulation.stand_points import choose_stations, find_stand_points, ground_level, visible_from

from .simulation_data import room, row_of


def first_along_x(scene: Scene, origin: tuple[float, float, float], direction: float = 1.0) -> tuple[float, str]:
    seen = scene.cast(np.array(origin), np.array([[direction, 0.0, 0.0]]))
    return float(seen.distance[0]), scene.names[scene.owner[seen.triangle[0]]].rstrip("_")


def test_edits_move_and_remove_elements() -> None:
    model = room()
    edits = {row_of("cupboard"): Edit("remove"), row_of("west"): Edit("shift", -0.12, (1.0, 0.0, 0.0))}
    planned, built = build_scene(model), build_scene(model, edits)
    assert first_along_x(planned, (0.0, 1.0, 1.0)) == (pytest.approx(2.15, abs=1e-9), "cupboard")
    assert first_along_x(built, (0.0, 1.0, 1.0)) == (pytest.approx(2.8, abs=1e-9), "east")
    assert first_along_x(planned, (0.0, 0.0, 1.0), -1.0) == (pytest.approx(2.8, abs=1e-9), "west")
    assert first_along_x(built, (0.0, 0.0, 1.0), -1.0) == (pytest.approx(2.92, abs=1e-9), "west")


def test_props_stand_in_the_way_and_keep_their_names() -> None:
    scene = build_scene(room(), props=[Prop("crate", "box", (1.0, 0.0, 0.5), (0.4, 0.4, 1.0), yaw=0.0)])
    assert first_along_x(scene, (0.0, 0.0, 0.5)) == (pytest.approx(0.8, abs=1e-9), "crate")


@pytest.mark.parametrize("kind", ["box", "person"])
def test_props_are_closed_outward_and_of_their_size(kind: str) -> None:
    corners = Prop("p", kind, (1.0, 2.0, 3.0), (0.4, 0.6, 1.8)).corners()  # type: ignore[arg-type]
    extent = np.ptp(corners.reshape(-1, 3), axis=0)
    assert (extent <= np.array([0.4, 0.6, 1.8]) + 1e-9).all()
    assert extent[2] == pytest.approx(1.8)
    a, b, c = (corners[:, i] - [1.0, 2.0, 3.0] for i in range(3))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6
    box = 0.4 * 0.6 * 1.8
    assert volume == pytest.approx(box) if kind == "box" else 0.3 * box < volume < 0.7 * box


def test_thinnest_axis_of_a_tilted_plate() -> None:
    turn = math.radians(20.0)
    rotation = np.array([[math.cos(turn), 0, math.sin(turn)], [0, 1, 0], [-math.sin(turn), 0, math.cos(turn)]])
    plate = Prop("p", "box", (0.0, 0.0, 0.0), (2.0, 1.0, 0.03)).corners() @ rotation.T
    axis, thickness = thinnest_axis(plate)
    np.testing.assert_allclose(axis, rotation[:, 2], atol=1e-9)
    assert thickness == pytest.approx(0.03)


def test_casting_is_exact_far_beyond_single_precision() -> None:
    far = Prop("p", "box", (900.0, 0.0, 0.0), (0.2, 50.0, 50.0)).corners()
    scene = Scene(far, np.zeros(len(far), np.int32), ["p"])
    assert first_along_x(scene, (0.1234567, 0.0, 0.0))[0] == pytest.approx(899.9 - 0.1234567, abs=1e-9)


def test_stand_points_are_on_the_floor_and_free() -> None:
    model = room()
    scene = build_scene(model)
    stands = find_stand_points(model, scene, count=60, seed=3)
    inside = np.abs(stands.position[:, :2]).max(axis=1) < 2.9
    assert inside.sum() > 20 and (~inside).sum() >= 10
    np.testing.assert_allclose(stands.floor[inside], 0.0, atol=1e-6)
    for place in stands.position[inside]:
        assert 1.15 < place[2] < 1.75
        assert first_along_x(scene, tuple(place))[0] > 0.44
        assert first_along_x(scene, tuple(place), -1.0)[0] > 0.44
    cupboard = (np.abs(stands.position[:, 0] - 2.4) < 0.25) & (np.abs(stands.position[:, 1] - 1.0) < 0.6)
    assert not cupboard.any()


def test_stations_are_chosen_to_see_what_can_be_seen() -> None:
    model = room()
    scene = build_scene(model)
    stands = find_stand_points(model, scene, count=60, seed=3)
    points = np.array([[0.0, -2.3, 1.0], [0.0, 2.3, 1.0], [3.0, 0.0, 1.0]])
    normals = np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])
    chosen = choose_stations(scene, stands, points, normals, np.ones(3), stations=None)
    seen = np.any([visible_from(scene, stands.position[row], points, normals) for row in chosen], axis=0)
    assert seen.all()
    assert len(chosen) == 2, "one inside for two walls, one outside for the third"
    assert len(choose_stations(scene, stands, points, normals, np.ones(3), stations=5)) == 5


def test_ground_is_the_lowest_point_without_doors() -> None:
    assert ground_level(room()) == pytest.approx(-0.8)
