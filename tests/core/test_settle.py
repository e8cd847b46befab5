"""An element that slid along its largest faces, and those that did not."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from bim_verify.core.results import ElementVerdict
from bim_verify.core.simulation.scene import Edit, Prop

from . import verify_data
from .test_change_rival import BLOCK, LIFT_M, SKIRT
from .verify_data import PLAN, built, by_name, scan, shifted, verified

BOARD = {"board": ("IfcCovering", (0.0, 1.0, 0.5), (0.012, 2.2, 1.7))}
"""On the west wall; its back lies in the wall's face."""


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


def test_a_block_that_was_lifted_deviates_by_as_much(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its sides stay in their planes; above the planned top returns come from its sides, not from the top."""
    block = verdict(monkeypatch, BLOCK, {"block": shifted(z=LIFT_M)}, SKIRT)
    assert block.status == "DEVIATING", block.reason
    assert block.displacement == pytest.approx(LIFT_M, abs=0.003)


def test_a_lifted_block_deviates_where_its_foot_is_in_view(monkeypatch: pytest.MonkeyPatch) -> None:
    assert verdict(monkeypatch, BLOCK, {"block": shifted(z=LIFT_M)}).status == "DEVIATING"


def test_a_block_that_stands_is_confirmed(monkeypatch: pytest.MonkeyPatch) -> None:
    block = verdict(monkeypatch, BLOCK, {})
    assert block.status == "CONFIRMED", block.reason
    assert block.displacement == pytest.approx(0.0, abs=0.003)


@pytest.mark.parametrize(
    "edit, status", [({}, "CONFIRMED"), ({"board": shifted(x=0.03)}, "DEVIATING")], ids=["standing", "off the wall"]
)
def test_a_board_on_a_wall_is_where_it_is_found(
    monkeypatch: pytest.MonkeyPatch, edit: Mapping[str, Edit], status: str
) -> None:
    board = verdict(monkeypatch, BOARD, edit)
    assert board.status == status, board.reason


def test_thin_bars_within_the_tolerance_of_their_place_are_not_absent(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bars of 16 mm that stand 9 mm off: many beams pass along their edges."""
    bars = {f"bar {k}": ("IfcMember", (3.0 + 0.3 * k, 0.6, 0.0), (3.016 + 0.3 * k, 0.616, 0.9)) for k in range(4)}
    monkeypatch.setattr(verify_data, "PLAN", {**PLAN, **bars})
    found = by_name(verified(scan(built({name: shifted(x=0.009) for name in bars}), seed=4), sample_spacing=0.05))
    assert {found[name].status for name in bars} <= {"CONFIRMED", "PARTIAL", "DEVIATING"}
