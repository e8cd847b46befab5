"""An identity pose is believed when the returns can have been seen from 0, 0, 0, and refused when they cannot."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from bim_verify.core.errors import BimVerifyError
from bim_verify.core.jobs import reconstruct
from bim_verify.core.jobs.inputs import open_campaign
from bim_verify.core.model.load import load_model
from bim_verify.core.options import InputOptions
from bim_verify.core.scans.campaign import ReturnBlock, Station
from bim_verify.core.scans.open import open_scans
from bim_verify.core.scans.stated_origin import impossible_stations
from bim_verify.core.scans.write_e57 import write_e57

from .factory import make_ifc

ROOM = np.array([2.0, 1.5, 1.2])


def room(stand: NDArray[np.float64], half: NDArray[np.float64] = ROOM) -> NDArray[np.float64]:
    """(N, 3) returns from the inside of a box about 0, 0, 0, seen from a stand in it; scan frame."""
    step = np.radians(0.4)
    elevation, azimuth = (a.ravel() for a in np.meshgrid(np.arange(-1.4, 1.4, step), np.arange(0.003, 6.28, step)))
    ray = np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=1)
    reach = np.where(ray > 0, (half - stand) / ray, (-half - stand) / ray).min(axis=1)
    return stand + ray * reach[:, None]


def write(path: Path, *clouds: NDArray[np.float64]) -> Path:
    """One scan a cloud, all with an identity pose."""
    stations = [Station(f"S{k}", np.zeros(3)) for k in range(len(clouds))]
    write_e57(path, stations, [ReturnBlock(k, cloud) for k, cloud in enumerate(clouds)])
    return path


BESIDE = np.array([6.0, 0.0, 0.0])
MERGED = np.concatenate([room(np.zeros(3)), room(np.array([0.5, 0.4, 0.3])) + BESIDE])


def test_a_true_set_up_at_the_origin_is_believed(tmp_path: Path) -> None:
    assert impossible_stations(open_scans([write(tmp_path / "a.e57", room(np.zeros(3)))])) == {}


def test_a_merged_cloud_is_not(tmp_path: Path) -> None:
    found = impossible_stations(open_scans([write(tmp_path / "a.e57", MERGED)]))
    assert list(found) == [0] and 0.2 < found[0] < 1.0


def test_several_scans_that_all_state_no_pose_are_not(tmp_path: Path) -> None:
    half = len(MERGED) // 2
    assert 0 in impossible_stations(open_scans([write(tmp_path / "a.e57", MERGED[:half], MERGED[half:])]))


def test_the_order_does_not_matter(tmp_path: Path) -> None:
    forth = impossible_stations(open_scans([write(tmp_path / "a.e57", MERGED)]))
    back = impossible_stations(open_scans([write(tmp_path / "b.e57", MERGED[::-1])]))
    assert forth == back


def test_a_job_refuses_it_and_takes_the_true_position(tmp_path: Path) -> None:
    model = load_model(make_ifc(tmp_path / "model.ifc"), cache=False, threads=1)
    path = write(tmp_path / "a.e57", MERGED)
    with pytest.raises(BimVerifyError, match=r"stood at 0, 0, 0.*--origin"):
        open_campaign(model, [path], InputOptions())
    with pytest.raises(BimVerifyError, match=r"cannot have stood at 1.2, -0.4, 0.1, as --origin says"):
        open_campaign(model, [path], InputOptions(origin=(1.2, -0.4, 0.1)))
    stand = np.array([0.5, 0.4, 0.3])
    path = write(tmp_path / "b.e57", room(stand) + BESIDE)
    with pytest.raises(BimVerifyError, match=r"stood at 0, 0, 0.*--origin"):
        open_campaign(model, [path], InputOptions())
    with pytest.raises(BimVerifyError, match=r"stood at 0, 0, 0.*--origin"):
        reconstruct([path])
    source = open_campaign(model, [path], InputOptions(origin=(6.5, 0.4, 0.3)))
    assert source.stations[0].position.tolist() == [6.5, 0.4, 0.3]
    returns = np.concatenate([block.offsets for block in source.blocks()]) + source.stations[0].position
    np.testing.assert_allclose(returns, room(stand) + BESIDE, atol=1e-12)


def test_an_origin_does_not_move_a_true_pose(tmp_path: Path) -> None:
    source = open_scans([write(tmp_path / "a.e57", room(np.zeros(3)))], origin=(1.0, 2.0, 3.0))
    assert not source.stations[0].position.any()
