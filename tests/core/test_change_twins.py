"""Elements modelled twice: none of two with one body has disappeared while that body stands."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from bim_verify.core.change.twins import bodies, twins_of
from bim_verify.core.evidence.shared_surface import SharedSurface
from bim_verify.core.jobs import change
from bim_verify.core.options import ChangeOptions
from bim_verify.core.simulation.box_building import box, building_model
from bim_verify.core.simulation.scene import Scene

from .verify_data import SCANNER, scan

OPTIONS = ChangeOptions(voxel=0.02, sigma=0.0025, sample_spacing=0.05, memory_gb=1.0)
FINE = dataclasses.replace(SCANNER, angular_step=math.radians(0.25))
STATIONS = np.array([[2.0, 1.0, 1.0], [3.1, 2.6, 1.1], [1.2, 2.8, 0.9]])
PLACE, HIGH = (2.2, 1.9, 0.0), (2.29, 1.99, 1.4)
MODEL = building_model([
    box("floor", (0.0, 0.0, -0.2), (4.2, 4.0, 0.0)), box("east", (4.0, 0.0, 0.0), (4.2, 4.0, 2.0)),
    box("north", (0.0, 4.0, -0.2), (4.2, 4.2, 2.0)), box("post", PLACE, HIGH), box("twin", PLACE, HIGH),
])  # fmt: skip


def found(off: dict[str, Any], visit: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> dict[str, str]:
    """States of the posts; ``off``: how far elements stand from their places (None: they were removed), and the ``visit``."""
    corners, owner = MODEL.vertices[MODEL.triangles] + np.array(visit), MODEL.triangle_element
    keep = np.ones(len(corners), np.bool_)
    for row, element in enumerate(MODEL.elements):
        shift = off.get(element.name, (0.0, 0.0, 0.0))
        keep &= (owner != row) | (shift is not None)
        corners[owner == row] += 0.0 if shift is None else shift
    scene = Scene(corners[keep], owner[keep], [e.name for e in MODEL.elements])
    result = change(MODEL, [scan(scene, stations=STATIONS, scanner=FINE)], None, OPTIONS)
    return {e.name: e.state for e in result.elements if e.name in ("post", "twin")}


@pytest.mark.parametrize("visit", [(0.0, 0.0, 0.0), (0.009, -0.007, 0.004), (0.011, 0.009, -0.005), (-0.012, 0.009, 0.0)])
@pytest.mark.parametrize("gone", [(), ("twin",)])
def test_of_twins_nothing_is_said_while_one_stands_whatever_the_place_of_the_visit(
    gone: tuple[str, ...], visit: tuple[float, float, float]
) -> None:
    assert found(dict.fromkeys(gone), visit) == {"post": "UNKNOWN", "twin": "UNKNOWN"}


def test_of_twins_neither_has_moved_while_one_stands() -> None:
    assert found({"twin": (0.115, 0.0, 0.0)}) == {"post": "UNKNOWN", "twin": "UNKNOWN"}


@pytest.mark.parametrize("visit", [(0.0, 0.0, 0.0), (0.009, -0.007, 0.004)])
def test_twins_that_were_both_removed_have_disappeared(visit: tuple[float, float, float]) -> None:
    assert found({"post": None, "twin": None}, visit) == {"post": "DISAPPEARED", "twin": "DISAPPEARED"}


def test_twins_that_both_left_their_place_have_disappeared() -> None:
    off = (0.3, 0.0, 0.0)
    assert found({"post": off, "twin": off}) == {"post": "DISAPPEARED", "twin": "DISAPPEARED"}


def test_twins_share_all_of_their_surface_both_ways() -> None:
    """The second element lies in the first one's surface, which is larger; the third and the fourth are twins."""
    pairs = np.array([(0, 1, 0.5), (1, 0, 0.5), (2, 3, 0.99), (3, 2, 1.0), (3, 0, 0.1)])
    element, partner = pairs[:, 0].astype(np.int64), pairs[:, 1].astype(np.int64)
    shared = SharedSurface(np.arange(len(pairs)), element, partner, pairs[:, 2])
    body = bodies(shared, np.array([1.0, 0.5, 1.0, 1.0]))
    assert twins_of(body) == [[2, 3]]
    assert shared.between(body).element.tolist() == [0, 1, 3]
