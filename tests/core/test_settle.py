"""Returns that fit an element's faces and are not its own, and an element that slid along its largest faces."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from bim_verify.core.results import ElementVerdict
from bim_verify.core.simulation.scene import Edit, Prop

from . import verify_data
from .test_change_rival import BLOCK, COVER, LIFT_M, SKIRT
from .verify_data import PLAN, REMOVED, built, by_name, scan, shifted, verified

BOARD = {"board": ("IfcCovering", (0.0, 1.0, 0.5), (0.012, 2.2, 1.7))}
"""On the west wall: without it the wall is seen within the tolerance of its place, and its back lies in the wall's face."""


def verdict(
    monkeypatch: pytest.MonkeyPatch, extra: Mapping[str, tuple], edits: Mapping[str, Edit], props: tuple[Prop, ...] = ()  # type: ignore[type-arg]
) -> ElementVerdict:
    """On the one element of ``extra``; all others are where they should be, or out of sight."""
    monkeypatch.setattr(verify_data, "PLAN", {**PLAN, **extra})
    found = by_name(verified(scan(built(edits, props), seed=4), sample_spacing=0.1))
    (name,) = extra
    own = found.pop(name)
    assert {v.status for v in found.values()} <= {"CONFIRMED", "NOTOBSERVED"}
    return own


@pytest.mark.parametrize("props", [SKIRT, ()], ids=["foot hidden", "foot in view"])
def test_a_block_that_was_lifted_deviates_by_as_much(monkeypatch: pytest.MonkeyPatch, props: tuple[Prop, ...]) -> None:
    """Its sides stay in their planes; above the planned top returns come from its sides, not from the top."""
    block = verdict(monkeypatch, BLOCK, {"block": shifted(z=LIFT_M)}, props)
    assert block.status == "DEVIATING", block.reason
    assert block.displacement == pytest.approx(LIFT_M, abs=0.003)


@pytest.mark.parametrize("props", [(), (COVER,)], ids=["bare", "with a cover"])
def test_a_block_that_stands_is_confirmed(monkeypatch: pytest.MonkeyPatch, props: tuple[Prop, ...]) -> None:
    block = verdict(monkeypatch, BLOCK, {}, props)
    assert block.status == "CONFIRMED", block.reason
    assert block.displacement == pytest.approx(0.0, abs=0.003)


@pytest.mark.parametrize(
    "edit, status", [({"board": REMOVED}, "ABSENT"), ({}, "CONFIRMED"), ({"board": shifted(x=0.03)}, "DEVIATING")],
    ids=["removed", "standing", "off the wall"],
)
def test_a_board_is_told_from_the_wall_that_it_touches(
    monkeypatch: pytest.MonkeyPatch, edit: Mapping[str, Edit], status: str
) -> None:
    board = verdict(monkeypatch, BOARD, edit)
    assert board.status == status, board.reason
