"""Numbers as a modeller reads them."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from bim_verify.bim_verify_addon import text


@pytest.mark.parametrize("value", [0.0, -0.0, -1e-6, 1e-6])
def test_next_to_nothing_has_no_minus(value: float) -> None:
    assert text.millimetres(value) == "0.0 mm"
    assert text.signed_millimetres(value) == "+0.0 mm"
    assert text.percent(value) == "0 %"


def test_signs_and_what_is_not_known() -> None:
    assert text.millimetres(0.0123) == "12.3 mm"
    assert [text.signed_millimetres(v) for v in (0.0015, -0.0015)] == ["+1.5 mm", "-1.5 mm"]
    assert text.percent(0.5) == "50 %"
    assert {say(math.nan) for say in (text.millimetres, text.signed_millimetres, text.percent)} == {"–"}


def test_rows_that_are_too_long_for_two_columns_are_written_out() -> None:
    said: list[str] = []
    layout = SimpleNamespace(label=lambda text: said.append(text))
    layout.column = layout.split = lambda **_: layout
    context = SimpleNamespace(
        region=SimpleNamespace(width=252), preferences=SimpleNamespace(system=SimpleNamespace(ui_scale=1.0))
    )
    long = "49 of 400 with a measured surface"
    text.table(layout, context, [("Registration sigma", "0.9 mm"), ("Seen by", ""), ("Samples", long)])
    assert said[:2] == ["Registration sigma", "0.9 mm"]
    assert " ".join(said[2:]) == f"Samples: {long}"
    assert all(len(line) <= text.characters(context) for line in said)
