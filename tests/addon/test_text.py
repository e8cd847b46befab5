"""Numbers as a modeller reads them."""

from __future__ import annotations

import math

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
