"""Bars and rods that are slimmer than the tolerance of their place: beside it, farther away, and gone."""

from __future__ import annotations

import dataclasses
import math

import pytest

from bim_verify.core.results import ElementVerdict
from bim_verify.core.simulation.scene import Edit

from . import verify_data
from .verify_data import PLAN, REMOVED, SCANNER, built, by_name, scan, shifted, verified

WIDE_M = 0.012
BARS = {
    f"bar {k}": ("IfcMember", (3.0 + 0.3 * k, 0.6, 0.0), (3.0 + WIDE_M + 0.3 * k, 0.6 + WIDE_M, 0.9)) for k in range(6)
}
"""Balusters: the next one stands 0.3 m away."""
FINE = dataclasses.replace(SCANNER, angular_step=math.radians(0.3))


def bars(monkeypatch: pytest.MonkeyPatch, edit: Edit | None, only: str | None = None) -> list[ElementVerdict]:
    monkeypatch.setattr(verify_data, "PLAN", {**PLAN, **BARS})
    edits = {name: edit for name in BARS if edit is not None and only in (None, name)}
    found = by_name(verified(scan(built(edits), seed=4, scanner=FINE), sample_spacing=0.05))
    assert {v.status for n, v in found.items() if n not in BARS} <= {"CONFIRMED", "NOTOBSERVED"}
    return [found[name] for name in BARS]


@pytest.mark.parametrize("off_m", [0.009, 0.013], ids=["9 mm", "13 mm"])
def test_what_stands_beside_its_own_outline_within_the_tolerance_is_not_absent(
    monkeypatch: pytest.MonkeyPatch, off_m: float
) -> None:
    found = bars(monkeypatch, shifted(x=off_m))
    assert "ABSENT" not in {v.status for v in found}
    told = [v.displacement for v in found if v.displacement is not None]
    assert all(length < off_m + 0.004 for length in told)


@pytest.mark.parametrize("off_m", [0.025, 0.06], ids=["25 mm", "60 mm"])
def test_what_stands_off_is_found_there_and_not_at_the_next_baluster(monkeypatch: pytest.MonkeyPatch, off_m: float) -> None:
    found = bars(monkeypatch, shifted(x=off_m))
    assert {v.status for v in found} == {"DEVIATING"}
    assert [v.displacement for v in found] == pytest.approx([off_m] * len(found), abs=0.004)


def test_what_is_gone_is_absent(monkeypatch: pytest.MonkeyPatch) -> None:
    assert {v.status for v in bars(monkeypatch, REMOVED)} == {"ABSENT"}


def test_one_that_is_gone_from_a_row_is_absent(monkeypatch: pytest.MonkeyPatch) -> None:
    """The next one stands at its own plan, and is not taken for it."""
    found = bars(monkeypatch, REMOVED, only="bar 2")
    assert [v.status for v in found] == ["CONFIRMED", "CONFIRMED", "ABSENT", "CONFIRMED", "CONFIRMED", "CONFIRMED"]
