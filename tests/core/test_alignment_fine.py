"""A campaign comes from a coarse pose to where the unmoved elements fit, or is refused with the reason."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bim_verify.core.alignment import transform as se3
from bim_verify.core.alignment.fine import align_fine
from bim_verify.core.alignment.transform import TransformedSource
from bim_verify.core.errors import BimVerifyError
from bim_verify.core.model.elements import BuildingModel
from bim_verify.core.model.sample_surface import sample_surface
from bim_verify.core.model.samples import SurfaceSamples
from bim_verify.core.results import AlignmentRecord
from bim_verify.core.simulation.box_building import (
    ArraySource,
    Box,
    box,
    build_inaccurately,
    building_model,
    corridor,
    four_room_stations,
    four_rooms,
    scan,
)

SIGMA = 0.002
STEP_DEG = 2.5
CENTER = np.array([6.0, 4.5, 1.3])
COARSE = se3.exp_about(np.concatenate([np.radians(3.0) * np.array([0.6, 0.0, -0.8]), [0.3, -0.3, 0.26]]), CENTER)

Planned = tuple[BuildingModel, SurfaceSamples]


@pytest.fixture(scope="module")
def planned() -> Planned:
    model = building_model(four_rooms())
    return model, sample_surface(model, 0.1)


def pose_error(record: AlignmentRecord, motion: np.ndarray) -> tuple[float, float]:
    """Translation [m] and rotation [rad] at the centre of the building."""
    error = se3.log_about(record.transform @ motion, CENTER)
    return float(np.linalg.norm(error[3:])), float(np.linalg.norm(error[:3]))


def seen(built: list[Box], seed: int = 0) -> ArraySource:
    return scan(building_model(built), four_room_stations(), step_deg=STEP_DEG, noise=SIGMA, seed=seed)


def test_moved_elements_do_not_pull(planned: Planned) -> None:
    built, moved = build_inaccurately(four_rooms(), moved_share=0.15, largest_move=0.12, deviation=0.0, seed=0)
    assert len(moved) == 7
    record = align_fine(*planned, TransformedSource(seen(built), COARSE), sigma=SIGMA, loa=30)
    shift, turn = pose_error(record, COARSE)
    assert shift < 1e-3
    assert turn < 1e-4
    assert record.mode == "fine"
    assert record.covariance is not None
    assert np.linalg.eigvalsh(record.covariance).min() > 0
    assert record.inlier_ratio is not None
    assert 0.5 < record.inlier_ratio <= 1.0
    assert record.rms is not None
    assert 0.2 * SIGMA < record.rms < 2 * SIGMA
    assert "is fixed to" in record.weakest_direction


def test_large_moved_slabs_do_not_drag_the_height(planned: Planned) -> None:
    drop = {"floor 0": -0.12, "floor 3": -0.05}
    built = [b.moved(np.array([0.0, 0.0, drop.get(b.name, 0.0)])) for b in four_rooms()]
    record = align_fine(*planned, seen(built), start=se3.translation(np.array([0.1, -0.1, 0.15])), sigma=SIGMA, loa=30)
    shift, turn = pose_error(record, np.eye(4))
    assert shift < 1e-3
    assert turn < 1e-4


def test_removed_elements_and_clutter_do_not_pull(planned: Planned) -> None:
    built = [b for b in four_rooms() if b.name not in ("ceiling 1", "south wall 1", "table 2")]
    built += [box("crate", (1.0, 0.4, 0.0), (1.8, 1.2, 0.8)), box("panel", (9.0, 4.17, 0.3), (9.8, 4.21, 1.9))]
    record = align_fine(*planned, TransformedSource(seen(built), COARSE), sigma=SIGMA, loa=30)
    shift, turn = pose_error(record, COARSE)
    assert shift < 1e-3
    assert turn < 1e-4


def test_the_start_pose_and_a_far_origin_are_honoured(planned: Planned) -> None:
    model = building_model(four_rooms(), origin=(500_000.0, 4_000_000.0, 100.0))
    far = se3.translation(model.origin)
    built, _ = build_inaccurately(four_rooms(), moved_share=0.15, largest_move=0.12, deviation=0.0, seed=2)
    source = seen(built)
    near = align_fine(*planned, source, sigma=SIGMA, loa=30)
    record = align_fine(model, planned[1], source, start=far, sigma=SIGMA, loa=30)
    assert np.allclose(near.transform, se3.inverse(far) @ record.transform, atol=1e-8)
    assert record.center is not None
    assert near.center is not None
    assert np.allclose(record.center - model.origin, near.center, atol=1e-6)


def test_unknown_scanner_positions_still_align(planned: Planned) -> None:
    source = seen(four_rooms())
    points = [s.position + o for s, o in zip(source.stations, source.offsets, strict=True)]
    placeholder = replace(source.stations[0], position=np.zeros(3), known=False)
    merged = ArraySource((placeholder,), (np.concatenate(points),))
    record = align_fine(*planned, merged, start=se3.translation(np.array([0.05, 0.05, -0.05])), sigma=SIGMA, loa=30)
    assert pose_error(record, np.eye(4))[0] < 1e-3


def refused(boxes: list[Box], stations: list[list[float]]) -> str:
    model = building_model(boxes)
    source = scan(model, np.array(stations), step_deg=1.5, noise=SIGMA)
    with pytest.raises(BimVerifyError) as caught:
        align_fine(model, sample_surface(model, 0.15), source, sigma=SIGMA, loa=30)
    return str(caught.value)


def test_a_single_plane_is_refused_and_all_its_directions_named() -> None:
    message = refused([box("floor", (0, 0, -0.2), (14, 14, 0))], [[4, 4, 1.5], [9, 9, 1.4]])
    assert "translation along (1.00, 0.00, 0.00)" in message
    assert "translation along (0.00, 1.00, 0.00)" in message
    assert "rotation about (0.00, 0.00, 1.00)" in message


def test_a_corridor_without_ends_is_refused_and_its_axis_named() -> None:
    message = refused(corridor(ends=False), [[5, 1, 1.5], [20, 1.2, 1.4]])
    assert "translation along (1.00, 0.00, 0.00)" in message
    assert "rotation" not in message


def test_scans_far_off_are_refused(planned: Planned) -> None:
    away = TransformedSource(seen(four_rooms()), se3.translation(np.array([1000.0, 0.0, 0.0])))
    with pytest.raises(BimVerifyError, match="do not lie on the model"):
        align_fine(*planned, away, sigma=SIGMA, loa=30)


def test_a_wrong_place_in_the_building_is_refused(planned: Planned) -> None:
    wrong = TransformedSource(seen(four_rooms()), se3.translation(np.array([3.0, 2.0, 0.0])))
    with pytest.raises(BimVerifyError, match=r"contradict the model|Too few returns"):
        align_fine(*planned, wrong, sigma=SIGMA, loa=30)
