"""A whole visit that lies off its place, and one of another building."""

from __future__ import annotations

import dataclasses
from functools import cache
from typing import Any

import numpy as np
import pytest

from bim_verify.core.change.common_shift import Fits, common_shift
from bim_verify.core.change.look import ElementSight, EpochSight
from bim_verify.core.change.misplaced import found_ratio, misplaced, strange
from bim_verify.core.change.results import ChangeResult, CommonShift
from bim_verify.core.jobs import change
from bim_verify.core.options import ChangeOptions
from bim_verify.core.report.change_files import change_to_json
from bim_verify.core.report.change_page import render_change_page
from bim_verify.core.simulation.box_building import box, building_model

from .verify_data import REMOVED, built, house, scan

OPTIONS = ChangeOptions(voxel=0.04, sigma=0.0013, sample_spacing=0.1, memory_gb=1.0)


@cache
def then() -> Any:
    return scan(built({}), seed=3)


@cache
def now() -> Any:
    return scan(built({"column": REMOVED}), seed=4)


def moved(source: Any, offset: tuple[float, float, float]) -> Any:
    """The same returns, their stations recorded ``offset`` [m] away."""
    stations = tuple(dataclasses.replace(s, position=s.position + np.array(offset)) for s in source.stations)
    return dataclasses.replace(source, stations=stations)


@cache
def compared(offset: tuple[float, float, float], **given: Any) -> ChangeResult:
    return change(house(), [moved(now(), offset)], then(), dataclasses.replace(OPTIONS, **given))


def test_a_visit_in_its_place_is_not_warned_about() -> None:
    result = compared((0.0, 0.0, 0.0))
    for offset in (result.epoch.offset, result.offset_from_reference):
        assert offset is not None and offset.length < 0.001 and offset.elements > 5
    assert not any(" lies " in w or "another building" in w for w in result.warnings)
    assert {e.name: e.state for e in result.elements}["column"] == "DISAPPEARED"


def test_a_shift_of_all_stations_is_told_and_counted() -> None:
    result = compared((0.009, -0.007, 0.004))
    for offset in (result.epoch.offset, result.offset_from_reference):
        assert offset is not None and offset.significant and offset.turn is None
        np.testing.assert_allclose(offset.shift, (0.009, -0.007, 0.004), atol=0.001)
    assert result.epoch.registration_sigma == pytest.approx(0.0121 / np.sqrt(3), rel=0.1)
    assert "from the model" in result.places() and "from the reference" in result.places()
    assert result.places() in render_change_page(result)
    data = change_to_json(result)
    assert data["epochs"][0]["offset"]["shift"] == pytest.approx([0.009, -0.007, 0.004], abs=0.001)
    assert data["offset_from_reference"]["significant"] is True
    assert {e.name: e.state for e in result.elements}["column"] == "DISAPPEARED"
    assert sum(e.state == "DISAPPEARED" for e in result.elements) == 1


def test_a_visit_far_off_its_place_calls_nothing_gone() -> None:
    result = compared((0.08, 0.06, 0.0))
    assert result.epoch.offset is not None
    assert result.epoch.offset.length == pytest.approx(0.1, abs=0.003)
    (said,) = [w for w in result.warnings if w.startswith("The epoch lies ")]  # once, though the reference shows it too
    assert "from the model" in said and "--align fine" in said and "--registration-sigma-mm" in said
    assert not any("another building" in w for w in result.warnings)
    assert {e.state for e in result.elements} <= {"CONFIRMED", "UNKNOWN"}
    assert sum(e.disappeared_volume for e in result.elements) == 0.0


def test_what_the_user_states_of_the_registration_counts() -> None:
    stated = compared((0.009, -0.007, 0.004), registration_sigma=0.001)
    assert stated.epoch.registration_sigma == 0.001
    assert any("only the 1 mm that you stated" in w for w in stated.warnings)


def test_each_epoch_is_aligned_for_itself() -> None:
    result = change(
        house(), [moved(now(), (0.08, 0.06, 0.0))], moved(then(), (-0.05, 0.0, 0.02)),
        dataclasses.replace(OPTIONS, align="fine"),
    )
    assert result.reference is not None
    for epoch, offset in ((result.epoch, (-0.08, -0.06, 0.0)), (result.reference, (0.05, 0.0, -0.02))):
        assert epoch.alignment.mode == "fine"
        np.testing.assert_allclose(epoch.alignment.transform[:3, 3], offset, atol=0.003)
        assert epoch.offset is not None and epoch.offset.length < 0.003
    assert not any(" lies " in w for w in result.warnings)
    states = {e.name: e.state for e in result.elements}
    assert states["column"] == "DISAPPEARED" and sum(s == "CONFIRMED" for s in states.values()) >= 10
    assert change_to_json(result)["epochs"][0]["alignment"]["mode"] == "fine"
    assert "moved onto the model for itself (fine)" in render_change_page(result)


SHARED = CommonShift((0.003, 0.0, 0.0), None, 0.0005, 9, (True, True, False), True, 0.003 / np.sqrt(3.0))


@pytest.mark.parametrize(
    ("edge", "stated", "significant", "warns"),
    [
        (0.01, None, True, False), (0.004, None, True, True), (0.004, None, False, False),
        (0.01, 0.001, True, True), (0.01, 0.002, True, False), (0.01, 0.0, True, True),
    ],
)
def test_a_warning_follows_half_a_voxel_or_what_was_stated(
    edge: float, stated: float | None, significant: bool, warns: bool
) -> None:
    offset = dataclasses.replace(SHARED, significant=significant)
    options = dataclasses.replace(OPTIONS, registration_sigma=stated)
    assert bool(list(misplaced("epoch", "model", offset, edge, options))) == warns


def sight(found: int, gone: int, doubt: int, offset: CommonShift | None) -> EpochSight:
    one = ElementSight("STANDS", 1.0, 0.0, 1.0, None, "")
    unseen = dataclasses.replace(one, seen="UNSEEN")
    elements = (
        *[one] * found, *[dataclasses.replace(one, seen="GONE")] * gone,
        *[dataclasses.replace(unseen, in_doubt=True)] * doubt, *[unseen] * 30,
    )
    return EpochSight(elements, 0.001, False, 0.01, False, fits(np.zeros((1, 3)), np.zeros((1, 3))), offset)


def test_little_of_what_is_in_view_is_warned_about() -> None:
    assert found_ratio(sight(7, 3, 2, None)) == pytest.approx(7 / 12) and found_ratio(sight(0, 0, 0, None)) is None
    for found, offset, warns in ((9, SHARED, False), (5, SHARED, True), (7, SHARED, False), (7, None, True), (8, None, False)):
        assert bool(list(strange("epoch", sight(found, 10 - found, 0, offset)))) == warns
    assert "another building" in next(iter(strange("epoch", sight(2, 8, 0, None))))
    assert not list(strange("epoch", sight(0, 0, 0, None)))


def test_a_scan_of_another_building_is_warned_about() -> None:
    random = np.random.default_rng(11)
    corner = random.uniform((0.5, 0.3, 0.0), (11.0, 3.2, 2.0), (24, 3))
    other = building_model([box(str(k), tuple(c), tuple(c + random.uniform(0.2, 0.8, 3))) for k, c in enumerate(corner)])
    result = change(other, [then()], None, OPTIONS)
    assert result.epoch.found_ratio is not None and result.epoch.found_ratio < 0.6
    assert any("another building" in w for w in result.warnings)


def fits(shift: np.ndarray, middle: np.ndarray) -> Fits:
    count = len(shift)
    return Fits(middle, shift, np.tile(1e-8 * np.eye(3), (count, 1, 1)), np.tile(np.eye(3), (count, 1, 1)))


def test_elements_that_moved_for_themselves_do_not_pull() -> None:
    random = np.random.default_rng(5)
    middle, shift = random.uniform(-10.0, 10.0, (20, 3)), np.tile([0.004, 0.0, -0.003], (20, 1))
    shift[:5] += random.uniform(0.05, 0.2, (5, 3))
    found = common_shift(fits(shift, middle))
    assert found is not None and found.elements == 15
    np.testing.assert_allclose(found.shift, (0.004, 0.0, -0.003), atol=1e-5)


def test_a_turn_is_told_from_where_elements_stand() -> None:
    middle = np.random.default_rng(6).uniform(-10.0, 10.0, (20, 3))
    turn = np.array([0.0, 0.0, 0.002])
    found = common_shift(fits(np.cross(turn, middle - middle.mean(axis=0)) + np.array([0.01, 0.0, 0.0]), middle))
    assert found is not None and found.turn is not None and found.significant
    np.testing.assert_allclose(found.turn, turn, atol=1e-6)
    np.testing.assert_allclose(found.shift, (0.01, 0.0, 0.0), atol=1e-6)
    assert found.degrees == pytest.approx(np.degrees(0.002), rel=1e-3)


def test_too_few_elements_or_such_that_disagree_tell_nothing() -> None:
    random = np.random.default_rng(7)
    assert common_shift(fits(np.full((2, 3), 0.05), random.uniform(-5.0, 5.0, (2, 3)))) is None
    assert common_shift(fits(random.uniform(-0.3, 0.3, (12, 3)), random.uniform(-5.0, 5.0, (12, 3)))) is None


def test_between_two_epochs_only_what_both_know_counts() -> None:
    middle = np.random.default_rng(8).uniform(-5.0, 5.0, (6, 3))
    now_, then_ = fits(np.full((6, 3), 0.012), middle), fits(np.full((6, 3), 0.004), middle)
    known = then_.known.copy()
    known[:, 2, 2] = 0.0
    found = common_shift(now_.since(dataclasses.replace(then_, known=known)))
    assert found is not None
    np.testing.assert_allclose(found.shift, (0.008, 0.008, 0.0), atol=1e-6)
    assert found.in_words() == "11.3 mm (8.0, 8.0, ?)"
