"""An element that slid along its largest faces: what returns from these fits the planned place as well."""

from __future__ import annotations

import pytest

from bim_verify.core.jobs import change
from bim_verify.core.options import ChangeOptions
from bim_verify.core.simulation.scene import Prop

from . import verify_data
from .verify_data import PLAN, built, house, scan, shifted

OPTIONS = ChangeOptions(voxel=0.02, sigma=0.0013, sample_spacing=0.1, memory_gb=1.0)
BLOCK = {"block": ("IfcFooting", (10.6, 0.9, 0.0), (11.6, 1.4, 0.9))}
"""Low, and away from the stations: most that is seen of it are its sides."""
LIFT_M = 0.06
COVER = Prop("cover", "box", (11.1, 1.15, 0.9 + LIFT_M / 2), (1.0, 0.5, LIFT_M))
SKIRT = (
    Prop("skirt", "box", (11.1, 1.45, 0.05), (1.2, 0.02, 0.1)),
    Prop("skirt", "box", (10.55, 1.15, 0.05), (0.02, 0.6, 0.1)),
)
"""Hides the foot of the block."""


@pytest.fixture(autouse=True)
def with_block(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(verify_data, "PLAN", {**PLAN, **BLOCK})


def test_a_block_that_was_lifted_is_not_where_it_was_planned_though_its_sides_are_in_their_planes() -> None:
    """Its top is found, no beam returns from where the top was planned, and the gap under it is out of sight."""
    result = change(house(), [scan(built({"block": shifted(z=LIFT_M)}, SKIRT), seed=4)], None, OPTIONS)
    block = result.elements[-1]
    assert block.state == "PARTIAL" and block.moved, block.reason
    assert block.shift == pytest.approx(LIFT_M, abs=0.01)
    assert {e.state for e in result.elements[:-1]} <= {"CONFIRMED", "UNKNOWN"}


def test_a_cover_on_a_block_that_stands_is_not_the_block() -> None:
    """Beams return from the foot, which it would have left."""
    block = change(house(), [scan(built({}, (COVER,)), seed=4)], None, OPTIONS).elements[-1]
    assert block.state == "CONFIRMED", block.reason
