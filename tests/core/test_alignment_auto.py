"""A campaign is found in the model without a pose, or refused where two poses fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bim_verify.core.alignment import transform as se3
from bim_verify.core.alignment.auto import align_auto
from bim_verify.core.alignment.transform import TransformedSource
from bim_verify.core.errors import BimVerifyError
from bim_verify.core.model.sample_surface import sample_surface
from bim_verify.core.simulation.box_building import (
    ArraySource,
    build_inaccurately,
    building_model,
    corridor,
    four_room_stations,
    four_rooms,
    scan,
)

CENTER = np.array([6.0, 4.5, 1.3])


@pytest.fixture(scope="module")
def campaign() -> ArraySource:
    built, _ = build_inaccurately(four_rooms(), moved_share=0.15, largest_move=0.12, deviation=0.0, seed=4)
    return scan(building_model(built), four_room_stations(), step_deg=2.5)


def test_heading_and_place_are_found(campaign: ArraySource) -> None:
    """137 degrees, 20 m, and two degrees off level."""
    motion = se3.exp_about(np.array([0.03, -0.02, np.radians(137.0), 20.0, -4.0, 2.0]), CENTER)
    model = building_model(four_rooms())
    record = align_auto(
        model, sample_surface(model, 0.1), TransformedSource(campaign, motion), sigma=0.002, loa=30
    )
    error = se3.log_about(record.transform @ motion, CENTER)
    assert record.mode == "auto"
    assert np.linalg.norm(error[3:]) < 1e-3
    assert np.linalg.norm(error[:3]) < 1e-4


def test_a_symmetric_building_is_ambiguous() -> None:
    model = building_model(corridor(ends=True))
    source = scan(model, np.array([[5.0, 1.0, 1.5], [20.0, 1.2, 1.4]]), step_deg=2.5)
    with pytest.raises(BimVerifyError, match="Two poses fit about equally well"):
        align_auto(model, sample_surface(model, 0.15), source, sigma=0.002, loa=30)


def test_another_building_is_not_found(campaign: ArraySource) -> None:
    model = building_model(corridor(ends=True))
    with pytest.raises(BimVerifyError):
        align_auto(model, sample_surface(model, 0.15), campaign, sigma=0.002, loa=30)


def test_unknown_scanner_positions_are_refused(campaign: ArraySource) -> None:
    model = building_model(four_rooms())
    blind = ArraySource(tuple(replace(s, known=False) for s in campaign.stations), campaign.offsets)
    with pytest.raises(BimVerifyError, match="names no scanner position"):
        align_auto(model, sample_surface(model, 0.1), blind, sigma=0.002, loa=30)
