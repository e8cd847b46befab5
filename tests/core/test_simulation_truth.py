"""The truth of every simulated return in the E57, and scans of scenes that are no model."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pye57
import pytest

from bim_verify.core.errors import BimVerifyError
from bim_verify.core.scans.open import open_scans
from bim_verify.core.scans.write_e57 import write_e57
from bim_verify.core.simulation.box_building import ArraySource
from bim_verify.core.simulation.return_truth import MIXED, OWNER, TRUE_RANGE, read_truth
from bim_verify.core.simulation.scan_scene import SceneStation, scan_scene
from bim_verify.core.simulation.scanner import PRESETS
from bim_verify.core.simulation.scene import Prop, Scene

SCANNER = dataclasses.replace(PRESETS["fast"], angular_step=math.radians(2.0))
ORIGIN = np.array([1000.0, 2000.0, 30.0])


def things() -> Scene:
    """A box before a wall."""
    boxes = (Prop("", "box", (4.0, 0.0, 1.5), (0.2, 6.0, 3.0)), Prop("", "box", (2.0, 0.0, 1.5), (0.4, 0.4, 0.4)))
    shapes = [b.corners() for b in boxes]
    owner = np.repeat(np.arange(2, dtype=np.int32), [len(s) for s in shapes])
    return Scene(np.concatenate(shapes), owner, ["wall", "box"])


def test_every_return_knows_what_it_met(tmp_path: Path) -> None:
    path = tmp_path / "scan.e57"
    written = scan_scene(
        things(), [SceneStation("here", np.array([0.0, 0.0, 1.5]))], SCANNER, path, origin=ORIGIN, truth=tmp_path / "t.json"
    )
    truth = read_truth(path, 0)
    source = open_scans([path])
    (station,) = source.stations
    offsets = np.concatenate([b.offsets for b in source.blocks()])
    assert len(truth[OWNER]) == len(offsets) == written.returns
    assert np.allclose(station.position, ORIGIN + np.array([0.0, 0.0, 1.5]))
    box = truth[OWNER] == 1
    assert 20 < box.sum() < len(box)
    assert (np.abs(offsets[box][:, :2]).max(axis=1) < 2.5).all()
    plain = truth[MIXED] == 0
    assert np.abs(np.linalg.norm(offsets, axis=1) - truth[TRUE_RANGE])[plain].max() < 8 * SCANNER.sigma_range + 0.002
    assert json.loads((tmp_path / "t.json").read_text())["owners"] == ["wall", "box"]


def test_other_readers_skip_the_truth(tmp_path: Path) -> None:
    path = tmp_path / "scan.e57"
    written = scan_scene(things(), [SceneStation("here", np.array([0.0, 0.0, 1.5]))], SCANNER, path)
    data = pye57.E57(str(path)).read_scan(0, ignore_missing_fields=True, intensity=True)
    assert len(data["cartesianX"]) == written.returns


def test_a_scan_without_truth_says_so(tmp_path: Path) -> None:
    source = ArraySource(open_stations(), (np.array([[1.0, 0.0, 0.0]]),))
    write_e57(tmp_path / "plain.e57", source.stations, source.blocks())
    with pytest.raises(BimVerifyError, match="no truth"):
        read_truth(tmp_path / "plain.e57", 0)


def open_stations():  # type: ignore[no-untyped-def]
    from bim_verify.core.scans.campaign import Station

    return (Station("S", np.zeros(3)),)


def test_a_scene_out_of_sight_is_an_error_and_writes_nothing(tmp_path: Path) -> None:
    with pytest.raises(BimVerifyError, match="sees anything"):
        scan_scene(things(), [SceneStation("far", np.array([500.0, 0.0, 0.0]))], SCANNER, tmp_path / "scan.e57")
    assert not list(tmp_path.iterdir())
