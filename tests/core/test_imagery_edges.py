"""What a line in a photo can say of an edge: who bears it, and whether it can be told from its neighbours."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from bim_verify.core.imagery.cameras_file import KnownCamera
from bim_verify.core.imagery.coregistration import state_of
from bim_verify.core.imagery.crowded_edges import RESOLUTION_PX, crowding
from bim_verify.core.imagery.detect_lines import ImageLines
from bim_verify.core.imagery.edge_bearers import element_design, free_edges, meeting_of
from bim_verify.core.imagery.line_pose import pose_difference
from bim_verify.core.imagery.mistaken_lines import MISTAKEN, SEARCH_WIDTH, spread_without_each
from bim_verify.core.imagery.model_edges import sharp_edges
from bim_verify.core.imagery.register_image import register_image
from bim_verify.core.imagery.visible_edges import EdgeViewer
from bim_verify.core.simulation.box_building import box, building_model
from bim_verify.core.simulation.photo_block import as_built, edge_lines

from .photo_data import camera, room

SIGMA = 0.0025


def test_a_line_where_two_faces_meet_moves_with_both() -> None:
    wall, floor = np.array([0.0, 0.02, 0.0]), np.array([0.5, 0.0, -0.03])
    found = meeting_of(np.array([[4, 7]]), np.array([[[0.0, 1, 0], [0, 0, 1]]]))
    moved = found.carry[0, 0] @ wall + found.carry[0, 1] @ floor
    assert np.allclose(moved, [0.0, 0.02, -0.03])
    slant = np.array([0.0, math.sin(1.1), math.cos(1.1)])
    found = meeting_of(np.array([[4, 7]]), np.array([[[0.0, 1, 0], slant]]))
    moved = found.carry[0, 0] @ wall + found.carry[0, 1] @ floor
    assert moved[1] == pytest.approx(0.02) and slant @ moved == pytest.approx(slant @ floor)


def test_where_an_element_ends_at_a_face_the_face_or_its_own_edge_shows() -> None:
    wall, door = np.random.default_rng(4).normal(0, 1, (2, 200_000))
    shows = np.maximum(wall, door)
    normal = np.array([[[0.0, 1, 0], [1, 0, 0]]] * 2)
    found = meeting_of(np.array([[0, 1], [0, 2]]), normal, np.array([5, 6]), np.array([[False, True]] * 2))
    design = element_design(found, np.array([[0.0, 1, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0]]))
    cov = design @ design.T
    assert cov[0, 0] == pytest.approx((shows**2).mean(), rel=0.02) and cov[1, 1] == pytest.approx(1.0)
    left = shows - 0.5 * (wall + door)
    assert cov[0, 0] - 0.5 == pytest.approx((left**2).mean(), rel=0.02)
    assert cov[0, 2] == pytest.approx(0.25) and cov[1, 3] == pytest.approx(0.0)
    again = element_design(found.rows(np.array([0, 0])), np.array([[0.0, 1, 0], [1, 0, 0]] * 2))
    assert np.allclose(again[:2], again[2:])


def test_an_edge_of_one_element_moves_as_it_does() -> None:
    to_point = np.arange(12.0).reshape(4, 3)
    design = element_design(free_edges(np.array([3, 3])), to_point)
    assert np.allclose(design, to_point)


def test_the_camera_sees_which_elements_bear_an_edge() -> None:
    model = building_model([
        box("floor", (-3, -1, -0.2), (3, 6, 0.0)), box("wall", (-3, 4, 0.0), (3, 4.3, 3.0)),
        box("block", (-0.5, 3, 0.0), (0.5, 3.5, 1.0)),
    ])
    view = replace(camera(), rotation=np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), position=np.array([0.1, 0.0, 1.3]))
    seen = EdgeViewer(model, sharp_edges(model)).look(view)
    names = {
        tuple(np.round(a + b, 3)[1:]): {model.elements[int(e)].name for e in who}
        for a, b, who in zip(seen.start, seen.end, seen.bearers.element, strict=True)
    }
    assert names[(8.0, 0.0)] == {"floor", "wall"}
    assert names[(6.0, 0.0)] == {"floor", "block"}
    assert names[(6.0, 2.0)] == {"block"}


def test_edges_nearer_than_the_blur_are_uncertain_by_their_distance() -> None:
    edges = np.array([[0.0, 0, 100, 0], [0, 1, 100, 1], [0, 40, 100, 40], [50, -50, 50, 50.0], [200, 0, 300, 0]])
    found = crowding(edges)
    likely = math.exp(-0.25 / RESOLUTION_PX**2)
    assert found[:2] == pytest.approx([likely, likely])
    assert np.array_equal(found[2:], [0.0, 0.0, 0.0])
    assert np.array_equal(crowding(edges[::-1])[::-1], found)


def mistaken(lines: ImageLines, rng: np.random.Generator) -> ImageLines:
    """One in ten lies on something else, up to the search's tolerance away."""
    along = (lines.end - lines.start) / lines.length[:, None]
    reach = SEARCH_WIDTH * camera().interior.width
    off = np.where(rng.uniform(size=len(lines)) < MISTAKEN, rng.uniform(-reach, reach, len(lines)), 0.0)
    aside = off[:, None] * np.column_stack([-along[:, 1], along[:, 0]])
    return replace(lines, start=lines.start + aside, end=lines.end + aside)


def test_the_stated_covariance_holds_for_buildings_that_stand_off_by_whole_elements() -> None:
    model = room()
    viewer, lens = EdgeViewer(model, sharp_edges(model)), camera()
    squares = []
    for seed in range(12):
        rng = np.random.default_rng((seed, 3))
        built = as_built(model, rng.normal(0, SIGMA, (len(model.elements), 3)))
        lines = mistaken(edge_lines(EdgeViewer(built, sharp_edges(built)), lens, 0.3, rng), rng)
        coarse = KnownCamera(lens.moved(rng.normal(0, math.radians(0.3), 3), rng.normal(0, 0.05, 3)), 0.05, math.radians(0.3))
        found = register_image(viewer, lines, coarse, model_sigma=SIGMA, seed=seed)
        assert state_of(found) in ("REFINED", "PARTLY") and found.covariance is not None
        away = pose_difference(found.camera, lens)
        squares.append(float(away @ np.linalg.solve(found.covariance, away)))
    assert 2.5 < np.mean(squares) < 9.0, squares


def test_lines_that_lie_on_edges_by_chance_place_no_photo() -> None:
    model = room()
    viewer = EdgeViewer(model, sharp_edges(model))
    lines = edge_lines(viewer, camera(), 0.3, np.random.default_rng(1))
    rng = np.random.default_rng(2)
    count, lens = 400, camera().interior
    middle = rng.uniform(0, 1, (count, 2)) * [lens.width, lens.height]
    turn, half = rng.uniform(0, math.pi, count), rng.uniform(15, 40, count)
    reach = half[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    noise = type(lines)(
        middle - reach, middle + reach, np.full(count, 0.2), 0.3 / half, np.full(count, 50.0), half / half.max()
    )
    found = register_image(viewer, noise, KnownCamera(camera()), model_sigma=SIGMA)
    assert state_of(found) in ("FAILED", "AMBIGUOUS") and found.note


def test_two_places_nearer_than_three_centimetres_are_rivals_if_their_covariances_do_not_allow_both() -> None:
    model = room()
    viewer, here = EdgeViewer(model, sharp_edges(model)), camera()
    there = here.moved(np.zeros(3), np.array([0.02, 0.0, 0.0]))
    rng = np.random.default_rng(5)
    seen = [edge_lines(viewer, place, 0.3, rng) for place in (here, there)]
    one = register_image(viewer, seen[0], KnownCamera(here), model_sigma=SIGMA)
    assert state_of(one) == "REFINED"
    both = ImageLines(*(np.concatenate([getattr(s, f) for s in seen]) for f in ImageLines.__dataclass_fields__))
    found = register_image(viewer, both, KnownCamera(here), model_sigma=SIGMA)
    assert state_of(found) == "AMBIGUOUS" and "Another pose" in found.note


def test_the_spread_without_each_match_is_that_of_adjustments_without_it() -> None:
    rng = np.random.default_rng(6)
    count = 7
    design, information = rng.normal(size=(2 * count, 6)), np.diag(rng.uniform(0.1, 1.0, 6))
    root = rng.normal(size=(2 * count, 2 * count))
    noise = root @ root.T + np.eye(2 * count)
    observed, prior = rng.normal(size=2 * count), rng.normal(size=6)

    def solve(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        weight = np.linalg.inv(noise[np.ix_(rows, rows)])
        covariance = np.linalg.inv(design[rows].T @ weight @ design[rows] + information)
        return covariance @ (design[rows].T @ weight @ observed[rows] + information @ prior), covariance

    every = np.arange(2 * count)
    pose, covariance = solve(every)
    expected = np.zeros((6, 6))
    for match in range(count):
        without, wider = solve(np.delete(every, [2 * match, 2 * match + 1]))
        expected += MISTAKEN * (np.outer(without - pose, without - pose) + wider - covariance)
    found = spread_without_each(covariance, design, np.linalg.inv(noise), design @ pose - observed)
    assert found == pytest.approx(expected, abs=1e-9)
