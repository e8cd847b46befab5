"""Scenes as built, stand points, and what can be seen from them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bim_verify.core.model.sample_surface import sample_surface
from bim_verify.core.simulation.clip import body_volume, cut_away, keep_below
from bim_verify.core.simulation.cut import CUT_CLASSES, VOLUME_SHARE, choose_cuts, element_corners, removed_share
from bim_verify.core.simulation.scene import Edit, Prop, Scene, build_scene, face_axes, thinnest_axis
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


def test_a_cut_wall_with_an_opening_is_closed_and_loses_its_part() -> None:
    opening = Prop("o", "box", (0.0, 0.0, 1.2), (1.0, 0.2, 1.0)).corners()[:, ::-1]  # a hole through the whole thickness
    wall = np.concatenate([Prop("w", "box", (0.0, 0.0, 1.2), (4.0, 0.4, 2.4)).corners(), opening])
    whole = 4.0 * 0.4 * 2.4 - 0.2
    assert body_volume(wall) == pytest.approx(whole)
    along = np.array([1.0, 0.0, 0.0])
    for low, high, gone in (
        (-math.inf, -1.0, 0.96), (0.2, math.inf, 0.4 * 2.4 * 1.8 - 0.06), (-0.25, 0.25, 0.5 * 0.4 * 2.4 - 0.1),
    ):
        left = cut_away(wall, along, low, high)
        assert body_volume(left) == pytest.approx(whole - gone)
        cross = np.cross(left[:, 1] - left[:, 0], left[:, 2] - left[:, 0])
        np.testing.assert_allclose(cross.sum(axis=0), 0.0, atol=1e-9)  # closed
    tilted = np.array([0.6, 0.0, 0.8])
    halves = keep_below(wall, tilted, 1.0), keep_below(wall, -tilted, -1.0)
    assert sum(body_volume(h) for h in halves) == pytest.approx(whole)


def test_the_scanner_sees_the_cut_face_and_through_the_part_that_is_gone() -> None:
    model = room()
    wall = next(row for row, e in enumerate(model.elements) if e.ifc_class == "IfcWall")
    corners = element_corners(model, wall)
    along = face_axes(corners)[int(np.argmax(np.ptp(corners.reshape(-1, 3) @ face_axes(corners).T, axis=0)))]
    place = corners.reshape(-1, 3) @ along
    middle = float(place.min() + place.max()) / 2
    edit = Edit("cut", direction=tuple(along), removed=(middle, math.inf))
    scene = build_scene(model, {wall: edit})
    assert 0.45 < removed_share(corners, edit) < 0.55
    stands = scene.corners[scene.owner == wall].reshape(-1, 3) @ along
    assert (stands.min(), stands.max()) == pytest.approx((place.min(), middle), abs=1e-6)
    inside = corners.reshape(-1, 3).mean(axis=0) + (middle + 0.3 - corners.reshape(-1, 3).mean(axis=0) @ along) * along
    hit = scene.cast(inside, -along[None])
    assert scene.owner[hit.triangle[0]] == wall and hit.distance[0] == pytest.approx(0.3)
    assert hit.cos_incidence[0] == pytest.approx(1.0)


def test_cuts_are_chosen_by_seed_among_walls_and_slabs_that_are_not_edited() -> None:
    model = room()
    samples = sample_surface(model, 0.25)
    walls = {row for row, e in enumerate(model.elements) if e.ifc_class.startswith(CUT_CLASSES)}
    found = choose_cuts(model, samples, {}, seed=1, share=1.0)
    assert found and set(found) <= walls and found == choose_cuts(model, samples, {}, seed=1, share=1.0)
    assert all(VOLUME_SHARE[0] <= removed_share(element_corners(model, row), e) <= VOLUME_SHARE[1] for row, e in found.items())
    some = next(iter(found))
    assert some not in choose_cuts(model, samples, {some: Edit("remove")}, seed=1, share=1.0)


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
