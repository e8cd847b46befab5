"""Levels of accuracy and tolerance arithmetic: the printed reference values."""

from __future__ import annotations

import math

import pytest

from bim_verify.core.sensing.loa import (
    LEVELS,
    UPPER_BOUND_M,
    convert_belief,
    convert_confidence,
    label,
    level_sigma,
    probability_within,
    relative_tolerance,
    worst_voxel_shift,
)

MM = 0.001


def test_the_sigma_of_a_level_is_half_its_upper_bound() -> None:
    assert [round(level_sigma(level) / MM, 6) for level in LEVELS] == [75.0, 25.0, 7.5, 2.5, 0.5]
    assert [UPPER_BOUND_M[level] for level in LEVELS] == [0.15, 0.05, 0.015, 0.005, 0.001]


def test_labels() -> None:
    assert [label(level) for level in LEVELS] == ["LOA10", "LOA20", "LOA30", "LOA40", "LOA50"]
    assert label(None) == "NONE"


def test_relative_tolerance_of_two_objects() -> None:
    assert relative_tolerance(3.0, 4.0) == pytest.approx(5.0, rel=1e-15)
    assert relative_tolerance(3.0, 4.0, "quadratic") == relative_tolerance(4.0, 3.0)
    assert relative_tolerance(3.0, 4.0, "linear") == 7.0


def test_worst_voxel_shift_is_half_the_space_diagonal() -> None:
    assert worst_voxel_shift(0.01) == pytest.approx(math.sqrt(3 * 0.005**2), rel=1e-14)


@pytest.mark.parametrize(
    ("confidence", "exact", "printed"),
    [(0.412, "0.086", 0.087), (0.683, "0.159", 0.159), (0.750, "0.182", 0.182), (0.850, "0.227", 0.228),
     (0.955, "0.312", 0.304)],
)  # fmt: skip
def test_confidence_carried_from_2_5_mm_to_0_5_mm(confidence: float, exact: str, printed: float) -> None:
    """T1 table 8.1; ``printed`` is the source's own value, which rounds z on the way."""
    found = convert_confidence(confidence, 2.5 * MM, 0.5 * MM)
    assert f"{found:.3f}" == exact
    assert found == pytest.approx(printed, abs=0.009)


def test_confidence_carried_to_the_same_sigma_is_the_same() -> None:
    assert convert_confidence(0.683, 2.5 * MM, 2.5 * MM) == pytest.approx(0.683, abs=1e-12)


@pytest.mark.parametrize(("level", "expected"), [(50, "0.9545"), (40, "0.3108"), (30, "0.1061"), (20, "0.0319")])
def test_probability_within_one_millimetre(level: int, expected: str) -> None:
    """T1 table 5.2."""
    assert f"{probability_within(1 * MM, level_sigma(level)):.4f}" == expected


@pytest.mark.parametrize(
    ("sigma_mm", "belief", "expected"),
    [(2.0, 0.85, ("0.1766", "0.7057", "0.8947")), (2.5, 0.73, ("0.1218", "0.5246", "0.7684"))],
)
def test_belief_carried_to_levels(sigma_mm: float, belief: float, expected: tuple[str, str, str]) -> None:
    """T1 table 5.4, whose columns are sigma 0.5, 2.5 and 15 mm."""
    found = [convert_belief(belief, sigma_mm * MM, s * MM) for s in (0.5, 2.5, 15.0)]
    assert tuple(f"{b:.4f}" for b in found) == expected
