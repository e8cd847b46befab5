"""Scans in the frame of the map are found out and brought into the model's own; no other scan is moved."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from bim_verify.core.errors import BimVerifyError
from bim_verify.core.model.elements import BuildingModel, MapConversion
from bim_verify.core.options import ScanFrame
from bim_verify.core.scans.campaign import ScanSource, Station
from bim_verify.core.scans.frame import to_model_frame
from bim_verify.core.simulation.box_building import ArraySource

from .simulation_data import ORIGIN, room

CONVERSION = MapConversion(np.array([450_000.0, 5_300_000.0, 520.0]), np.radians(33.0), 1.0)
HERE = ORIGIN + np.array([0.5, 0.2, 1.5])
OFFSETS = np.array([[2.0, 0.0, 0.0], [0.0, 3.0, -1.0]])


def model(conversion: MapConversion | None = CONVERSION) -> BuildingModel:
    return dataclasses.replace(room(), map_conversion=conversion)


def source(position: np.ndarray, turn: np.ndarray | None = None) -> ArraySource:
    turn = np.eye(3) if turn is None else turn
    return ArraySource((Station("S", position, turn),), (OFFSETS @ turn.T,))


def points(scan: ScanSource) -> np.ndarray:
    return np.concatenate([b.offsets + scan.stations[b.station].position for b in scan.blocks()])


def in_map(conversion: MapConversion = CONVERSION) -> ArraySource:
    c, s = np.cos(conversion.angle), np.sin(conversion.angle)
    return source(conversion.to_map(HERE[None])[0], np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]]))


@pytest.mark.parametrize("frame", ["auto", "model"])
def test_a_scan_in_the_models_frame_stays(frame: ScanFrame) -> None:
    scan = source(HERE)
    assert to_model_frame(model(), scan, frame) is scan


@pytest.mark.parametrize("frame", ["auto", "map"])
def test_a_scan_in_the_maps_frame_is_brought_over(frame: ScanFrame) -> None:
    found = to_model_frame(model(), in_map(), frame)
    np.testing.assert_allclose(found.stations[0].position, HERE, atol=1e-6)
    np.testing.assert_allclose(found.stations[0].rotation, np.eye(3), atol=1e-9)
    np.testing.assert_allclose(points(found), HERE + OFFSETS, atol=1e-6)


def test_a_scan_that_is_near_in_neither_frame_stays() -> None:
    scan = source(np.array([-30_000.0, 70_000.0, 0.0]))
    assert to_model_frame(model(), scan, "auto") is scan


def test_a_map_offset_so_small_that_both_fit_moves_nothing() -> None:
    scan = source(HERE)
    near = MapConversion(np.array([20.0, 10.0, 0.0]), 0.0, 1.0)
    assert to_model_frame(model(near), scan, "auto") is scan


def test_without_a_map_conversion() -> None:
    scan = source(HERE)
    assert to_model_frame(model(None), scan, "auto") is scan
    with pytest.raises(BimVerifyError, match=r"room\.ifc has no map conversion"):
        to_model_frame(model(None), scan, "map")


def test_a_scale_moves_the_scan_but_never_stretches_it() -> None:
    scaled = dataclasses.replace(CONVERSION, scale=0.9996)
    middle = room().bounds.mean(axis=0) + ORIGIN
    c, s = np.cos(scaled.angle), np.sin(scaled.angle)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    there = scaled.to_map(middle[None])[0] + turn @ (HERE - middle)
    found = to_model_frame(model(scaled), source(there, turn), "auto")
    np.testing.assert_allclose(found.stations[0].position, HERE, atol=1e-6)
    np.testing.assert_allclose(points(found), HERE + OFFSETS, atol=1e-6)
