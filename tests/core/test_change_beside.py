"""Things that stand a little off their place, within what model and registration explain, have not disappeared."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from bim_verify.core.evidence.as_found import medians
from bim_verify.core.evidence.passed_beside import _nearest_return
from bim_verify.core.evidence.shared_surface import on_others
from bim_verify.core.evidence.station_index import build_index
from bim_verify.core.jobs import change
from bim_verify.core.model.elements import BuildingModel
from bim_verify.core.model.on_element import BLOCK, ElementSurfaces
from bim_verify.core.options import ChangeOptions
from bim_verify.core.simulation.box_building import box, building_model
from bim_verify.core.simulation.scene import Scene

from .verify_data import SCANNER, scan

OPTIONS = ChangeOptions(voxel=0.02, sigma=0.0025, sample_spacing=0.05, memory_gb=1.0)
FINE = dataclasses.replace(SCANNER, angular_step=math.radians(0.25))
STATIONS = np.array([[2.0, 1.0, 1.0], [3.1, 2.6, 1.1], [1.2, 2.8, 0.9]])
ROOM = (
    box("floor", (0.0, 0.0, -0.2), (4.2, 4.0, 0.0)), box("east", (4.0, 0.0, 0.0), (4.2, 4.0, 2.0)),
    box("north", (0.0, 4.0, -0.2), (4.2, 4.2, 2.0)),
)
BARS = [f"bar{k}" for k in range(4)]
BOARD_M = 0.0125


def with_bars(width: float) -> BuildingModel:
    """Square bars, as of a railing."""
    places = [(2.2 + 0.3 * k, 1.9) for k in range(len(BARS))]
    return building_model([
        *ROOM, *(box(name, (x, y, 0.0), (x + width, y + width, 0.9)) for name, (x, y) in zip(BARS, places, strict=True))
    ])


def boarded(thickness: float) -> BuildingModel:
    """A board on the east wall, and a flooring."""
    return building_model([
        *ROOM, box("board", (4.0 - thickness, 1.0, 0.5), (4.0, 2.6, 1.5)),
        box("flooring", (0.3, 0.3, 0.0), (3.7, 3.6, thickness)),
    ])


BOARDED = boarded(BOARD_M)


def scanned(model: BuildingModel, off: dict[str, Any], seed: int = 1) -> Any:
    """``off``: how far elements stand from their places; None: not at all."""
    corners, owner = model.vertices[model.triangles], model.triangle_element
    keep = np.ones(len(corners), np.bool_)
    for row, element in enumerate(model.elements):
        shift = off.get(element.name, (0.0, 0.0, 0.0))
        keep &= (owner != row) | (shift is not None)
        corners[owner == row] += 0.0 if shift is None else shift
    scene = Scene(corners[keep], owner[keep], [e.name for e in model.elements])
    return scan(scene, stations=STATIONS, scanner=FINE, seed=seed)


def states(
    model: BuildingModel, off: dict[str, Any], reference: dict[str, Any] | None = None, **options: Any
) -> dict[str, str]:
    before = None if reference is None else scanned(model, reference, 2)
    found = change(model, [scanned(model, off)], before, dataclasses.replace(OPTIONS, **options))
    return {e.name: e.state for e in found.elements}


@pytest.mark.parametrize("width, off", [(0.010, 0.009), (0.010, 0.014), (0.012, 0.014)])
def test_bars_that_stand_off_by_their_width_have_not_disappeared(width: float, off: float) -> None:
    """Beams pass their planned places, and others return from beside these."""
    found = states(with_bars(width), dict.fromkeys(BARS, (off, 0.0, 0.0)))
    assert {found[bar] for bar in BARS} <= {"CONFIRMED", "UNKNOWN"}, found


def test_bars_that_were_removed_have_disappeared() -> None:
    found = states(with_bars(0.012), dict.fromkeys(BARS))
    assert {found[bar] for bar in BARS} == {"DISAPPEARED"}, found


def test_bars_that_stood_as_far_off_before_are_confirmed_or_left_open() -> None:
    off = dict.fromkeys(BARS, (0.010, 0.0, 0.0))
    found = states(with_bars(0.010), off, off)
    assert {found[bar] for bar in BARS} <= {"CONFIRMED", "UNKNOWN"}, found


WITH_WHAT_THEY_LIE_ON = {name: np.array([1.0, 0.0, 0.0]) for name in ("east", "board")} | {
    name: np.array([0.0, 0.0, -1.0]) for name in ("floor", "flooring")
}


@pytest.mark.parametrize("off", [0.008, 0.010, 0.012])
def test_coverings_that_are_off_with_what_they_lie_on_stand(off: float) -> None:
    """Their faces lie within 5 mm of where what is behind them was planned."""
    found = states(BOARDED, {name: off * way for name, way in WITH_WHAT_THEY_LIE_ON.items()})
    assert {found[name] for name in WITH_WHAT_THEY_LIE_ON} == {"CONFIRMED"}, found


def test_coverings_as_thin_as_the_scanner_s_error_have_not_disappeared_with_what_they_lie_on() -> None:
    found = states(boarded(0.005), {name: 0.010 * way for name, way in WITH_WHAT_THEY_LIE_ON.items()})
    assert {found["board"], found["flooring"]} <= {"CONFIRMED", "UNKNOWN"}, found


@pytest.mark.parametrize("off", [0.0, 0.008])
def test_coverings_that_were_removed_have_disappeared_though_what_they_lay_on_is_off(off: float) -> None:
    moved = {name: off * way for name, way in WITH_WHAT_THEY_LIE_ON.items()}
    found = states(BOARDED, {**moved, "board": None, "flooring": None})
    assert (found["board"], found["flooring"]) == ("DISAPPEARED", "DISAPPEARED"), found


def test_a_covering_of_what_was_seen_nowhere_else_is_left_open() -> None:
    """The floor may lie where it is planned, without its flooring, or lower, with it."""
    model = building_model([*ROOM[1:], box("floor", (0.0, 0.0, -0.2), (4.0, 4.0, 0.0)),
                            box("flooring", (0.0, 0.0, 0.0), (4.0, 4.0, BOARD_M))])
    low = dict.fromkeys(("floor", "flooring"), (0.0, 0.0, -0.012))
    assert states(model, low)["flooring"] in ("CONFIRMED", "UNKNOWN")


def test_a_registration_that_is_off_makes_nothing_disappear() -> None:
    everything = {e.name: (0.008, 0.008, -0.008) for e in BOARDED.elements}
    for registration in (None, 0.010):
        found = states(BOARDED, everything, registration_sigma=registration)
        assert not {"DISAPPEARED", "PARTIAL"} & set(found.values()), found


def test_the_nearest_return_in_space_is_found() -> None:
    random = np.random.default_rng(3)
    points = np.column_stack([random.uniform(1.0, 3.0, 4000), random.uniform(-1.0, 1.0, (4000, 2)).reshape(-1, 2)])
    index = build_index(points, 0.02)
    asked = points[:200] + random.normal(0.0, 0.02, (200, 3))
    found = _nearest_return(asked, index.returns, index.bin_start, index.row_start, 0.05)
    away = np.linalg.norm(asked[:, None] - index.returns[None].astype(np.float64), axis=2)
    right = np.where(away.min(axis=1) < 0.05, away.argmin(axis=1), -1)
    assert found.tolist() == right.tolist()


def test_medians_of_groups() -> None:
    assert medians(np.array([2, 0, 2, 2]), np.array([5.0, 1.0, 3.0, 4.0]), 4).tolist() == [1.0, 0.0, 4.0, 0.0]


def terrain(cells: int) -> BuildingModel:
    """A wall in the box of a hilly ground of many triangles, in any order."""
    x, y = (a.ravel() for a in np.meshgrid(*2 * (np.linspace(0.0, 10.0, cells + 1),), indexing="ij"))
    corner = np.column_stack([x, y, np.sin(x) * np.cos(y)])
    k = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    triangles = np.concatenate([
        np.column_stack([k, k + cells + 1, k + cells + 2]), np.column_stack([k, k + cells + 2, k + 1])
    ])
    triangles = np.random.default_rng(5).permutation(triangles)
    plain = building_model([box("wall", (3.0, 4.0, -1.0), (6.0, 4.2, 1.0)), box("ground", (0.0, 0.0, -1.0), (1.0, 1.0, 0.0))])
    keep = plain.triangle_element == 0
    return dataclasses.replace(
        plain, vertices=np.concatenate([plain.vertices, corner]),
        triangles=np.concatenate([plain.triangles[keep], len(plain.vertices) + triangles]).astype(np.int32),
        triangle_element=np.append(plain.triangle_element[keep], np.full(len(triangles), 1, np.int32)),
        transparent=np.zeros(int(keep.sum()) + len(triangles), np.bool_),
    )


def test_faces_of_a_large_element_are_found_as_if_each_were_tried() -> None:
    model = terrain(24)
    surfaces = ElementSurfaces(model)
    random = np.random.default_rng(7)
    point = random.uniform([2.9, 3.9, -1.0], [6.1, 4.3, 1.0], (600, 3))
    point[:300, 2] = np.sin(point[:300, 0]) * np.cos(point[:300, 1])
    up = np.tile([0.0, 0.0, 1.0], (len(point), 1))
    count = len(model.triangles)
    assert count > 10 * BLOCK
    ground = np.ones(len(point), np.int32)
    first = np.full(len(point), model.triangle_start[1], np.int32)
    found = surfaces.face_at(point, up, ground, first, 0.02)
    one_by_one = np.full(len(point), -1)
    for t in range(count - 1, int(model.triangle_start[1]) - 1, -1):
        alone = dataclasses.replace(model, triangles=model.triangles[[t]], triangle_element=np.zeros(1, np.int32),
                                    transparent=np.zeros(1, np.bool_), elements=model.elements[:1])
        on = ElementSurfaces(alone).face_at(point, up, np.zeros(len(point), np.int32), np.zeros(len(point), np.int32), 0.02)
        one_by_one[on >= 0] = t
    tried_first = surfaces.face_at(point, up, ground, np.full(len(point), count - 1, np.int32), 0.02)
    assert 200 < (found >= 0).sum() < len(point)
    assert found.tolist() == one_by_one.tolist(), "the first of those that hold it"
    assert np.array_equal(tried_first >= 0, one_by_one >= 0)
    row, other, face = on_others(model, surfaces, point, up, np.zeros(len(point), np.int32), 0.02, frozenset())
    assert row.tolist() == np.flatnonzero(one_by_one >= 0).tolist() and set(other.tolist()) == {1}
    assert face.tolist() == found[row].tolist()
    assert surfaces.near(point, up, ground, 0.02)[one_by_one >= 0].all()
