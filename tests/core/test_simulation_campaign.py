"""Campaigns: what is written is what was simulated, and the truth is true."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest

from bim_verify.core.errors import BimVerifyError
from bim_verify.core.model.sample_surface import sample_surface
from bim_verify.core.scans.open import open_scans
from bim_verify.core.simulation.campaign import Campaign, choose_edits, make_campaign, set_up, write_campaign
from bim_verify.core.simulation.scanner import Scanner
from bim_verify.core.simulation.scene import Edit, Prop

from .simulation_data import ORIGIN, room, row_of

SCANNER = Scanner("test", math.radians(1.0), sigma_range=0.0015, sigma_signal=0.0, sigma_angle=0.0)
SHIFT = 0.05


def campaign(**changes: object) -> Campaign:
    """A shifted wall, a cupboard that is not there, and a crate that is."""
    return dataclasses.replace(
        Campaign(
            model=room(),
            scanner=SCANNER,
            set_ups=(
                set_up("first", np.array([0.0, 0.0, 1.5]), 1, 0),
                set_up("second", np.array([-1.0, 1.0, 1.3]), 1, 1),
            ),
            edits={row_of("east"): Edit("shift", SHIFT, (1.0, 0.0, 0.0)), row_of("cupboard"): Edit("remove")},
            props=(Prop("crate", "box", (-2.0, -1.5, 0.35), (0.6, 0.6, 0.7)),),
            seed=1,
        ),
        **changes,  # type: ignore[arg-type]
    )


def points_of(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """All returns in the model frame, and the station of each."""
    scan = open_scans([path])
    parts, stations = [], []
    for block in scan.blocks(attributes=True):
        parts.append(block.offsets + scan.stations[block.station].position)
        stations.append(np.full(len(block.offsets), block.station))
    return np.concatenate(parts), np.concatenate(stations)


def test_the_scan_file_holds_the_room_in_the_model_frame(tmp_path: Path) -> None:
    written = write_campaign(campaign(), tmp_path)
    points, station = points_of(written.scan_path)
    assert len(points) == written.returns
    assert set(station) == {0, 1}
    local = points - ORIGIN
    at_east = (local[:, 0] > 2.7) & (np.abs(local[:, 1]) < 2.2) & (local[:, 2] > 0.2) & (local[:, 2] < 2.5)
    depth = local[at_east, 0]
    assert np.median(depth) == pytest.approx(2.8 + SHIFT, abs=2e-4)
    assert np.std(depth) < 0.002
    at_west = (local[:, 0] < -2.7) & (np.abs(local[:, 1]) < 2.2) & (local[:, 2] > 0.8) & (local[:, 2] < 2.5)
    assert np.median(local[at_west, 0]) == pytest.approx(-2.8, abs=2e-4)


def test_the_grid_the_poses_and_the_date_are_kept(tmp_path: Path) -> None:
    written = write_campaign(campaign(acquired="2024-06-25T08:30:00"), tmp_path)
    assert all(s.acquired.startswith("2024-06-25T08:30:00") for s in open_scans([written.scan_path]).stations)
    scan = open_scans([written.scan_path])
    for station, planned in zip(scan.stations, campaign().set_ups, strict=True):
        np.testing.assert_allclose(station.position, planned.position + ORIGIN, atol=1e-9)
        assert station.grid is not None and (station.grid.rows, station.grid.columns) == (150, 360)
    for block in scan.blocks(attributes=True):
        direction = block.offsets @ scan.stations[block.station].rotation
        row, column = SCANNER.cell(direction)
        assert block.row is not None and block.column is not None
        assert (row == block.row).mean() > 0.999 and (column == block.column).mean() > 0.999


def test_truth_says_what_was_done_and_what_can_be_proven(tmp_path: Path) -> None:
    write_campaign(campaign(), tmp_path)
    truth = json.loads((tmp_path / "truth.json").read_text())
    model = room()
    record = {e.name: truth["elements"][e.global_id] for e in model.elements}
    assert set(record["east"]) == {"cls", "edit", "offset", "direction", "visible", "witnessed", "hits", "area"}
    east = record["east"]
    assert (east["edit"], east["offset"], east["direction"]) == ("shift", SHIFT, [1, 0, 0])
    assert record["cupboard"]["edit"] == "remove" and record["cupboard"]["hits"] == 0
    assert record["cupboard"]["witnessed"] > 0.25, "beams went through where it should stand"
    assert record["buried"]["visible"] == record["buried"]["witnessed"] == record["buried"]["hits"] == 0
    assert record["west"]["edit"] == "none" and record["west"]["hits"] > 1000
    inner_face = 5.0 * 2.7 / (2 * (5.0 * 2.7 + 0.2 * 2.7 + 0.2 * 5.0))
    hidden_ends = 2 * 0.1 * 2.7 / (2 * (5.0 * 2.7 + 0.2 * 2.7 + 0.2 * 5.0))
    assert record["west"]["area"] == pytest.approx(2 * (5.0 * 2.7 + 0.2 * 2.7 + 0.2 * 5.0))
    assert inner_face - 2 * hidden_ends - 0.06 < record["west"]["visible"] < inner_face
    assert record["west"]["witnessed"] <= record["west"]["visible"]
    assert truth["new_hits"]["crate"] > 300
    assert truth["points"] == sum(r["hits"] for r in truth["elements"].values()) + truth["new_hits"]["crate"]
    np.testing.assert_allclose(truth["stations"][0], ORIGIN + np.array([0.0, 0.0, 1.5]))


def test_a_wall_built_closer_to_the_scanner_still_counts_as_witnessed(tmp_path: Path) -> None:
    near = campaign(edits={row_of("west"): Edit("shift", 0.12, (1.0, 0.0, 0.0))})
    plain = campaign(edits={})
    element = room().elements[row_of("west")].global_id
    moved = write_campaign(near, tmp_path / "near").truth["elements"][element]["witnessed"]
    stayed = write_campaign(plain, tmp_path / "plain").truth["elements"][element]["witnessed"]
    assert moved == pytest.approx(stayed, abs=0.05)


def test_recorded_poses_are_wrong_by_the_stated_noise_and_the_truth_keeps_the_true_ones(tmp_path: Path) -> None:
    sigma_t, sigma_rot = 0.01, 0.002
    poses = [set_up("s", np.zeros(3), seed, 0, (sigma_t, sigma_rot)) for seed in range(400)]
    shift = np.array([p.recorded_position - p.position for p in poses])
    turn = np.array([p.recorded_rotation @ p.rotation.T for p in poses])
    angle = np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]], axis=1)
    assert np.std(shift) == pytest.approx(sigma_t, rel=0.06)
    assert np.std(angle) == pytest.approx(sigma_rot, rel=0.06)

    off = set_up("first", np.array([0.0, 0.0, 1.5]), 1, 0, (sigma_t, 0.0))
    written = write_campaign(campaign(set_ups=(off,), edits={}, props=()), tmp_path)
    np.testing.assert_allclose(written.truth["stations"][0], off.position + ORIGIN)
    points, _ = points_of(written.scan_path)
    local = points - ORIGIN
    west = (local[:, 0] < -2.7) & (np.abs(local[:, 1]) < 2.0) & (local[:, 2] > 0.5) & (local[:, 2] < 2.3)
    error = off.recorded_position[0] - off.position[0]
    assert np.median(local[west, 0]) + 2.8 == pytest.approx(error, abs=3e-4)


def test_the_same_seed_writes_the_same_bytes(tmp_path: Path) -> None:
    options = {"scanner": SCANNER, "clutter": 2, "people": 1, "remove_share": 0.2, "shift_share": 0.3}
    for folder in ("a", "b"):
        write_campaign(make_campaign(room(), seed=5, **options), tmp_path / folder)  # type: ignore[arg-type]
    assert (tmp_path / "a/scan.e57").read_bytes() == (tmp_path / "b/scan.e57").read_bytes()
    assert (tmp_path / "a/truth.json").read_bytes() == (tmp_path / "b/truth.json").read_bytes()
    other = make_campaign(room(), seed=6, **options)  # type: ignore[arg-type]
    first = make_campaign(room(), seed=5, **options)  # type: ignore[arg-type]
    assert other.edits != first.edits or other.props != first.props


def test_made_campaigns_have_what_was_asked_for() -> None:
    made = make_campaign(
        room(), seed=2, stations=3, remove_share=1 / 7, shift_share=3 / 7, shifts_m=(0.02,), clutter=3, people=1,
        scanner=SCANNER, pose_noise=(0.002, 1e-4),
    )
    kinds = [edit.kind for edit in made.edits.values()]
    assert kinds.count("remove") == 1 and kinds.count("shift") == 3
    assert row_of("buried") not in made.edits, "nobody could tell"
    for edit in made.edits.values():
        if edit.kind == "shift":
            assert abs(edit.offset) == 0.02 and np.linalg.norm(edit.direction) == pytest.approx(1.0)
    assert len(made.set_ups) == 3
    assert [p.kind for p in made.props].count("box") >= 2 and [p.kind for p in made.props].count("person") == 1
    built_floor = made.edits[row_of("floor")].offset if row_of("floor") in made.edits else 0.0
    for prop in made.props:
        assert prop.center[2] - prop.size[2] / 2 == pytest.approx(built_floor + 0.002, abs=1e-3)


def test_shifts_go_along_the_thinnest_axis_and_both_ways() -> None:
    model = room()
    samples = sample_surface(model, 0.25)
    signs: set[float] = set()
    for seed in range(6):
        edits = choose_edits(model, samples, seed=seed, remove_share=0.0, shift_share=1.0, shifts_m=(0.01,))
        east = edits[row_of("east")]
        np.testing.assert_allclose(east.direction, [1.0, 0.0, 0.0], atol=1e-12)
        np.testing.assert_allclose(edits[row_of("floor")].direction, [0.0, 0.0, 1.0], atol=1e-12)
        signs.add(math.copysign(1.0, east.offset))
    assert signs == {-1.0, 1.0}


def test_a_station_that_sees_nothing_is_an_error_and_writes_nothing(tmp_path: Path) -> None:
    lost = campaign(set_ups=(set_up("lost", np.array([5000.0, 0.0, 0.0]), 1, 0),))
    with pytest.raises(BimVerifyError, match="No station sees anything"):
        write_campaign(lost, tmp_path)
    assert list(tmp_path.iterdir()) == []
