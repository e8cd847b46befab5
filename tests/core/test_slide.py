"""Slides along faces that stay in their planes, and how little evidence is too little."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from bim_verify.core.evidence.decide import Place, enough_seen
from bim_verify.core.evidence.displacement import NOTHING
from bim_verify.core.evidence.slide import _left_strip
from bim_verify.core.evidence.thresholds import Thresholds

from .verify_data import built, by_name, scan, shifted, verified


def test_a_plate_that_slid_along_its_visible_faces_is_found_by_its_ends() -> None:
    plate = by_name(verified(scan(built({"plate": shifted(x=0.08)}))))["plate"]
    assert plate.status == "DEVIATING" and plate.displacement_vector is not None
    assert plate.displacement_sigma is not None
    x, y, z = plate.displacement_vector
    assert abs(x - 0.08) < 3 * plate.displacement_sigma < 0.03
    assert abs(y) < 0.003 and abs(z) < 0.003


def test_a_plate_in_its_place_does_not_slide() -> None:
    plate = by_name(verified(scan(built({}))))["plate"]
    assert plate.status == "CONFIRMED" and plate.displacement is not None and plate.displacement < 0.003


def test_the_end_is_where_rays_stop_passing() -> None:
    distance = np.linspace(0.0, 0.5, 101)
    found = _left_strip(distance, distance < 0.0725)
    assert found is not None
    width, sigma, rays = found
    assert width == pytest.approx(0.0725, abs=0.003) and rays == 15 and sigma < 0.002


@pytest.mark.parametrize("passed", [np.zeros(101, bool), np.ones(101, bool), np.arange(101) % 2 == 0, np.arange(101) > 80])
def test_no_end_is_found_where_nothing_all_or_anything_else_passes(passed: np.ndarray) -> None:
    assert _left_strip(np.linspace(0.0, 0.5, 101), passed) is None


def test_a_few_rays_on_a_small_part_are_no_evidence() -> None:
    place = Place(np.zeros(3), 0.1, 0.0, 0.0, exposed=1.0, sightings=40, rays=15, stations=(0,), fit=NOTHING)
    assert not enough_seen(place, 0.03, Thresholds())
    assert enough_seen(place, 0.3, Thresholds())
    assert enough_seen(dataclasses.replace(place, rays=200), 0.03, Thresholds())
    assert not enough_seen(dataclasses.replace(place, sightings=3), 0.9, Thresholds())
