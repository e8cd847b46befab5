"""Faces of two elements that lie in each other hide nothing: rays meet only one of the two."""

from __future__ import annotations

import numpy as np
import pytest

from bim_verify.core.model.elements import BuildingModel
from bim_verify.core.model.raycast import RayScene
from bim_verify.core.model.sample_surface import sample_surface
from bim_verify.core.simulation.box_building import box, building_model


@pytest.fixture(scope="module", params=[False, True], ids=["wall first", "wall last"])
def room(request: pytest.FixtureRequest) -> BuildingModel:
    """A wall with a cupboard and a board that touch it, and a wall across the room."""
    boxes = [
        box("wall", (5.0, -0.2, 0.0), (5.2, 4.2, 2.6)), box("across", (-0.2, -0.2, 0.0), (0.0, 4.2, 2.6)),
        box("cupboard", (4.4, 1.0, 0.2), (5.0, 2.0, 1.9)), box("board", (4.98, 2.5, 0.5), (5.0, 3.5, 1.5)),
    ]
    return building_model(boxes[::-1] if request.param else boxes)


def exposed_share(model: BuildingModel, name: str, normal: tuple[float, float, float]) -> float:
    samples = sample_surface(model, 0.1)
    row = next(k for k, element in enumerate(model.elements) if element.name == name)
    of = (samples.element == row) & (samples.normal @ np.array(normal) > 0.99)
    assert of.any()
    return float(samples.exposed[of].mean())


@pytest.mark.parametrize("name", ["cupboard", "board"])
def test_the_front_of_what_touches_a_wall_is_exposed_and_its_back_is_not(room: BuildingModel, name: str) -> None:
    assert exposed_share(room, name, (-1.0, 0.0, 0.0)) == 1.0
    assert exposed_share(room, name, (1.0, 0.0, 0.0)) == 0.0


def test_the_wall_across_the_room_sees_what_touches_the_other(room: BuildingModel) -> None:
    assert exposed_share(room, "across", (1.0, 0.0, 0.0)) == 1.0


def test_the_wall_is_exposed_where_nothing_touches_it(room: BuildingModel) -> None:
    covered = (1.0 * 1.7 + 1.0 * 1.0) / (4.4 * 2.6)
    assert exposed_share(room, "wall", (-1.0, 0.0, 0.0)) == pytest.approx(1.0 - covered, abs=0.03)


def test_an_element_is_left_from_the_inside_only(room: BuildingModel) -> None:
    scene = RayScene(room)
    wall = next(k for k, element in enumerate(room.elements) if element.name == "wall")
    origin = np.array([[4.5, 1.5, 1.0], [5.1, 1.5, 1.0], [4.5, 1.5, 1.0]])
    direction = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    np.testing.assert_array_equal(scene.leaves(np.full(3, wall), origin, direction), [False, True, False])
