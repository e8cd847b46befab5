"""Rigid motions, and a scan source seen through one."""

from __future__ import annotations

import numpy as np
import pytest

from bim_verify.core.alignment import transform as se3
from bim_verify.core.alignment.transform import TransformedSource
from bim_verify.core.errors import BimVerifyError
from bim_verify.core.scans.campaign import Station
from bim_verify.core.simulation.box_building import ArraySource

MOTION = se3.exp_about(np.array([0.1, -0.2, 2.0, 5.0, -3.0, 1.0]), np.array([1.0, 2.0, 3.0]))


def test_exponential_and_logarithm_are_inverse() -> None:
    center = np.array([3.0, -2.0, 1.0])
    twist = np.array([0.3, -0.1, 1.2, 10.0, 20.0, -5.0])
    assert np.allclose(se3.log_about(se3.exp_about(twist, center), center), twist, atol=1e-12)


def test_a_pure_rotation_leaves_its_center() -> None:
    center = np.array([3.0, -2.0, 1.0])
    moved = se3.apply(se3.exp_about(np.array([0.3, 0.2, -0.9, 0, 0, 0]), center), center[None])
    assert np.allclose(moved, center, atol=1e-12)


def test_inverse() -> None:
    assert np.allclose(se3.inverse(MOTION) @ MOTION, np.eye(4), atol=1e-12)


def test_transformed_source_moves_stations_and_returns_alike() -> None:
    rng = np.random.default_rng(0)
    turn = se3.exp_about(np.array([0.0, 0.0, 0.7, 0, 0, 0]), np.zeros(3))[:3, :3]
    stations = (Station("a", np.array([1.0, 2.0, 3.0]), turn), Station("b", np.array([-4.0, 0.0, 1.0])))
    source = ArraySource(stations, (rng.normal(size=(50, 3)), rng.normal(size=(30, 3))))
    moved = TransformedSource(source, MOTION)
    assert moved.point_count == 80
    assert moved.paths == source.paths
    for before, after in zip(source.blocks(20), moved.blocks(20), strict=True):
        plain = source.stations[before.station].position + before.offsets
        assert np.allclose(moved.stations[after.station].position + after.offsets, se3.apply(MOTION, plain), atol=1e-12)
        sensor = plain[:1] - source.stations[before.station].position
        in_sensor = sensor @ source.stations[before.station].rotation
        assert np.allclose(in_sensor @ moved.stations[after.station].rotation.T, after.offsets[:1], atol=1e-12)


def test_a_scaled_or_mirrored_transform_is_refused() -> None:
    for bad in (np.diag([1.001, 1, 1, 1]), np.diag([-1.0, 1, 1, 1]), np.full((4, 4), np.nan), np.eye(3)):
        with pytest.raises(BimVerifyError):
            TransformedSource(ArraySource((), ()), bad)
