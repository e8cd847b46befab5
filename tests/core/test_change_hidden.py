"""What hides an element's place is no evidence that the element left it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from bim_verify.core.change.results import ElementChange
from bim_verify.core.evidence.left_place import PlaceLeft
from bim_verify.core.jobs import change
from bim_verify.core.model.elements import BuildingModel
from bim_verify.core.model.raycast import RayScene
from bim_verify.core.options import ChangeOptions
from bim_verify.core.simulation.box_building import box, building_model
from bim_verify.core.simulation.scene import Edit, Prop

from .verify_data import PLAN, STATIONS, built, house, scan, shifted

OPTIONS = ChangeOptions(voxel=0.04, sigma=0.0013, sample_spacing=0.1, memory_gb=1.0)
FIRST_ROOM = STATIONS[:3]
BOARD = Prop("board", "box", (0.009, 1.6, 1.1), (0.018, 1.2, 1.2))
"""On the west wall's face."""


def with_board() -> BuildingModel:
    """The house, with the board planned."""
    plan, corners = house(), BOARD.corners()
    return dataclasses.replace(
        plan,
        elements=(*plan.elements, dataclasses.replace(plan.elements[0], global_id="board", name="board", step_id=99)),
        vertices=np.concatenate([plan.vertices, corners.reshape(-1, 3)]),
        triangles=np.concatenate([plan.triangles, len(plan.vertices) + np.arange(36, dtype=np.int32).reshape(-1, 3)]),
        triangle_element=np.append(plan.triangle_element, np.full(12, len(PLAN), np.int32)),
        closed=np.append(plan.closed, True),
        transparent=np.append(plan.transparent, np.zeros(12, np.bool_)),
    )


def found(name: str, edits: dict[str, Edit], props: tuple[Prop, ...] = (), voxel: float = 0.04) -> ElementChange:
    model = with_board() if name == "board" else house()
    source = [scan(built(edits, props), seed=5, stations=FIRST_ROOM)]
    result = change(model, source, None, dataclasses.replace(OPTIONS, voxel=voxel))
    return next(e for e in result.elements if e.name == name)


@pytest.mark.parametrize(
    "before, thickness, voxel", [(0.05, 0.018, 0.04), (0.0835, 0.0835, 0.04), (0.0225, 0.0225, 0.02)],
    ids=["with a gap", "solid", "within the window"],
)
def test_a_board_behind_a_lining_has_not_disappeared(before: float, thickness: float, voxel: float) -> None:
    face = 0.018 + before
    lining = Prop("lining", "box", (face - thickness / 2, 1.6, 1.1), (thickness, 1.2, 1.2))
    board = found("board", {}, (BOARD, lining), voxel)
    assert board.state == "UNKNOWN" and "hidden" in board.reason, board.reason


@pytest.mark.parametrize(
    "name, edit, state",
    [
        ("partition", shifted(x=0.08), "PARTIAL"),
        ("partition", shifted(x=-0.08), "PARTIAL"),
        ("cupboard", shifted(y=-0.12), "PARTIAL"),
        ("plate", shifted(z=0.2), "DISAPPEARED"),
    ],
    ids=["away", "nearer", "free-standing", "thin"],
)
def test_moves_seen_from_one_side_are_found(name: str, edit: Edit, state: str) -> None:
    element = found(name, {name: edit})
    assert element.state == state, element.reason
    assert element.shift == pytest.approx(edit.offset, abs=0.005)


def test_beams_that_tell_whether_a_place_was_left() -> None:
    assert not PlaceLeft(at=0, through=0, stopped=500, stopped_anyway=0).passed
    assert PlaceLeft(at=0, through=2, stopped=0, stopped_anyway=0).passed
    assert not PlaceLeft(at=100, through=10, stopped=0, stopped_anyway=0).passed, "edges and recesses"
    assert PlaceLeft(0, 0, 30, 5).should_be_seen(0.5) and not PlaceLeft(0, 0, 5, 30).should_be_seen(0.5)
    assert not PlaceLeft(0, 0, 0, 0).should_be_seen(0.5)


def test_every_element_of_a_large_model_can_be_looked_at_alone() -> None:
    count = 2500
    model = building_model([box(f"{k}", (2.0 * k, 0.0, 0.0), (2.0 * k + 1.0, 1.0, 1.0)) for k in range(count)])
    middle = np.column_stack([2.0 * np.arange(count) + 0.5, np.full(count, 0.5), np.full(count, 0.5)])
    up = np.tile([0.0, 0.0, 1.0], (count, 1))
    assert RayScene(model).leaves(np.arange(count), middle, up).all()
