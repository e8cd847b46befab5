"""Clouds of mobile scanners: per-point places of the scanner become stations."""

from __future__ import annotations

from pathlib import Path

import laspy
import numpy as np
import pytest

from bim_verify.core.errors import BimVerifyError
from bim_verify.core.jobs import quality
from bim_verify.core.quality.options import QualityOptions
from bim_verify.core.scans.campaign import ReturnBlock, Station
from bim_verify.core.scans.mobile import STRETCH_M
from bim_verify.core.scans.open import open_scans
from bim_verify.core.scans.write_e57 import write_e57
from bim_verify.core.scans.write_ply import write_ply
from bim_verify.core.simulation.box_building import box, building_model
from bim_verify.core.simulation.scene import build_scene

ORIGIN = np.array([1000.0, 2000.0, 30.0])
ROOM = [
    box("floor", (-0.2, -0.2, -0.2), (6.2, 5.2, 0.0)), box("ceiling", (-0.2, -0.2, 2.8), (6.2, 5.2, 3.0)),
    box("south", (0.0, -0.2, 0.0), (6.0, 0.0, 2.8)), box("north", (0.0, 5.0, 0.0), (6.0, 5.2, 2.8)),
    box("west", (-0.2, -0.2, 0.0), (0.0, 5.2, 2.8)), box("east", (6.0, -0.2, 0.0), (6.2, 5.2, 2.8)),
]


def walk() -> tuple[np.ndarray, np.ndarray]:
    """Returns (N, 3) and places (N, 3), model frame: a walk along the room with profiles across and along it."""
    model = building_model(ROOM, origin=tuple(ORIGIN))
    scene = build_scene(model)
    points, places = [], []
    turn = np.radians(np.arange(0.0, 360.0, 1.5))
    for k, x in enumerate(np.arange(0.7, 5.3, 0.02)):
        lean = np.radians(40.0) * np.sin(0.7 * k)  # a profile that wobbles, as a hand-held one does
        ray = np.column_stack([np.sin(lean) * np.cos(turn), np.cos(lean) * np.cos(turn), np.sin(turn)])
        place = np.array([x, 2.5, 1.5]) + ORIGIN - model.origin
        distance = scene.cast(place, ray).distance
        points.append(place + distance[:, None] * ray + model.origin)
        places.append(np.broadcast_to(place + model.origin, ray.shape))
    return np.concatenate(points), np.concatenate(places)


def write(path: Path, point: np.ndarray, place: np.ndarray) -> Path:
    if path.suffix == ".ply":
        names = ("x_origin", "y_origin", "z_origin")
        write_ply(path, {**dict(zip("xyz", point.T, strict=True)), **dict(zip(names, place.T, strict=True))})
        return path
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = np.full(3, 1e-5), np.floor(point.min(axis=0))
    for name in "xyz":
        header.add_extra_dim(laspy.ExtraBytesParams(f"origin_{name}", np.float64))
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = point.T
    for name, values in zip("xyz", place.T, strict=True):
        setattr(cloud, f"origin_{name}", values)
    cloud.write(path)
    return path


@pytest.mark.parametrize("suffix", ["ply", "las", "laz"])
def test_stretches_of_the_path_become_stations(tmp_path: Path, suffix: str) -> None:
    point, place = walk()
    source = open_scans([write(tmp_path / f"walk.{suffix}", point, place)])
    assert 5 <= len(source.stations) <= 7 and all(s.known for s in source.stations)
    spots = np.array([s.position for s in source.stations])
    assert (np.diff(spots[:, 0]) > 0.5 * STRETCH_M).all()
    found = np.concatenate([b.offsets + source.stations[b.station].position for b in source.blocks(5000)])
    assert len(found) == len(point) == source.point_count
    order, own = np.lexsort(np.round(found.T, 3)), np.lexsort(np.round(point.T, 3))
    assert np.abs(np.sort(found[order], axis=0) - np.sort(point[own], axis=0)).max() < 2e-5
    nearest = np.abs(place[:, None, 0] - spots[None, :, 0]).min(axis=1)
    assert nearest.max() <= STRETCH_M


def test_places_that_are_not_finite_are_dropped(tmp_path: Path) -> None:
    point, place = walk()
    place = place.copy()
    place[::3] = np.nan
    source = open_scans([write(tmp_path / "walk.ply", point, place)])
    assert sum(len(b.offsets) for b in source.blocks()) == np.isfinite(place[:, 0]).sum()
    with pytest.raises(BimVerifyError, match="no finite scanner position"):
        open_scans([write(tmp_path / "none.ply", point, np.full_like(place, np.nan))])


def test_quality_of_a_walk_says_what_was_covered(tmp_path: Path) -> None:
    point, place = walk()
    model = building_model(ROOM, origin=tuple(ORIGIN))
    result = quality(model, [write(tmp_path / "walk.ply", point, place)], QualityOptions(sample_spacing=0.1, cache=False))
    covered = {e.name: e.measured.coverage / (1.0 - e.measured.turned_away) for e in result.elements}
    assert covered["north"] > 0.9 and covered["south"] > 0.9 and covered["floor"] > 0.85
    assert len(result.stations) >= 5


def write_with_times(folder: Path, point: np.ndarray, place: np.ndarray, header: str) -> Path:
    """Points with GPS times, and the path beside: ten places a second, one second a metre."""
    path = folder / "walk.las"
    cloud = laspy.LasData(laspy.LasHeader(point_format=6, version="1.4"))
    cloud.header.scales, cloud.header.offsets = np.full(3, 1e-5), np.floor(point.min(axis=0))
    cloud.x, cloud.y, cloud.z = point.T
    cloud.gps_time = 5000.0 + place[:, 0] - place[:, 0].min()
    cloud.write(path)
    low, high = place[:, 0].min() - 0.05, place[:, 0].max() + 0.1
    x = np.arange(low, high, 0.1)
    lines = [f"{5000.0 + v - place[:, 0].min():.6f},{v:.6f},{place[0, 1]:.6f},{place[0, 2]:.6f}" for v in x]
    (folder / "walk.trajectory.csv").write_text("\n".join([*([header] if header else []), *lines]), encoding="utf-8")
    return path


def test_a_path_beside_an_e57_with_times_says_where_each_point_was_measured_from(tmp_path: Path) -> None:
    """The scan has a pose, its path does not: both are in the file's frame."""
    point, place = walk()
    write_with_times(tmp_path, point, place, "")
    turn, shift = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), ORIGIN + np.array([1.0, 2.0, 0.5])
    time = {"timeStamp": 5000.0 + place[:, 0] - place[:, 0].min()}
    block = ReturnBlock(station=0, offsets=point - shift, extra=time)
    write_e57(tmp_path / "walk.e57", [Station("walk", shift, turn)], [block])
    by_las, by_e57 = open_scans([tmp_path / "walk.las"]), open_scans([tmp_path / "walk.e57"])
    assert len(by_e57.stations) == len(by_las.stations) and all(s.known for s in by_e57.stations)
    for a, b in zip(by_e57.stations, by_las.stations, strict=True):
        assert np.abs(a.position - b.position).max() < 1e-5
    found = np.concatenate([b.offsets + by_e57.stations[b.station].position for b in by_e57.blocks(5000)])
    assert np.abs(np.sort(found, axis=0) - np.sort(point, axis=0)).max() < 1e-5
    (tmp_path / "walk.trajectory.csv").unlink()
    assert len(open_scans([tmp_path / "walk.e57"]).stations) == 1


@pytest.mark.parametrize("header", ["", "Time,X,Y,Z"])
def test_a_path_beside_the_cloud_says_where_each_point_was_measured_from(tmp_path: Path, header: str) -> None:
    point, place = walk()
    source = open_scans([write_with_times(tmp_path, point, place, header)])
    stations = {id(s): s.position for s in source.stations}
    assert 5 <= len(stations) <= 7 and all(s.known for s in source.stations)
    assert np.abs(np.array([p[1:] for p in stations.values()]) - place[0, 1:]).max() < 1e-5
    assert sum(len(b.offsets) for b in source.blocks(5000)) == len(point)


def test_points_in_a_gap_of_the_path_are_dropped_and_a_bad_path_is_refused(tmp_path: Path) -> None:
    point, place = walk()
    path = write_with_times(tmp_path, point, place, "")
    beside = tmp_path / "walk.trajectory.csv"
    lines = beside.read_text(encoding="utf-8").splitlines()
    beside.write_text("\n".join(lines[:10] + lines[30:]), encoding="utf-8")
    held = sum(len(b.offsets) for b in open_scans([path]).blocks(5000))
    assert 0.4 * len(point) < held < 0.7 * len(point)
    beside.write_text("time,x,y,z\n1,2,three,4\n", encoding="utf-8")
    with pytest.raises(BimVerifyError, match="line 2"):
        open_scans([path])
