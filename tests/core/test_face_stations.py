"""Stations whose poses are off: what they disagree by is estimated, and a face is as uncertain as those who saw it."""

from __future__ import annotations

import csv
from pathlib import Path

import ifcopenshell
import numpy as np
import pytest
from ifcopenshell.util.element import get_pset
from shapely import box

from bim_verify.cli import main
from bim_verify.core.planes.conformity import flatness
from bim_verify.core.planes.fit import fit_plane
from bim_verify.core.planes.noise import PointNoise
from bim_verify.core.planes.stations import Poses, levelled
from bim_verify.core.reconstruction.fitted import FaceReturns, Survey, agreement, fitted_face, room_faces

from .room_files import write_room

NOISE = PointNoise(0.002, 0.0, 1e-9)
PLACES = np.array([[1.0, 1.0, 1.5], [4.0, 2.5, 1.4], [2.5, 1.2, 1.6], [3.8, 0.9, 1.3]])
SIZE = np.array([5.0, 4.0, 2.5])


def seen(
    rng: np.random.Generator, axis: int, at: float, shift: np.ndarray, turn: np.ndarray, stations: list[int], count: int = 1500
) -> FaceReturns:
    """A face of a room from stations that are off by ``shift`` and ``turn`` (S, 3)."""
    points, rows = [], []
    for s in stations:
        own = rng.random((count, 3)) * SIZE
        own[:, axis] = at
        ray = own - PLACES[s]
        own += ray / np.linalg.norm(ray, axis=1, keepdims=True) * rng.normal(0.0, 0.002, (count, 1))
        points.append(own + shift[s] + np.cross(turn[s], own - PLACES[s]))
        rows.append(np.full(count, s))
    place, station = np.concatenate(points), np.concatenate(rows)
    return FaceReturns(place, station, "finished wall", fit_plane(place, PLACES[station], NOISE).facing(PLACES[stations[0]]))


def room(rng: np.random.Generator, sigma: float, turn: float) -> list[FaceReturns]:
    shifts, turns = sigma * rng.standard_normal((4, 3)), turn * rng.standard_normal((4, 3))
    return [seen(rng, axis, at, shifts, turns, [0, 1, 2, 3]) for axis in range(3) for at in (0.0, SIZE[axis])]


def test_how_well_stations_agree_is_found() -> None:
    rng = np.random.default_rng(3)
    found = [agreement(room(rng, 0.003, 2e-4), 4, None) for _ in range(6)]
    # nine differences of each draw: widened by 1.16
    assert 0.0025 < np.sqrt(np.mean([p.sigma**2 for p in found])) < 0.0045
    assert 1.5e-4 < np.sqrt(np.mean([p.turn**2 for p in found])) < 3.2e-4
    exact = agreement(room(rng, 0.0, 0.0), 4, None)
    assert exact.sigma < 2e-4 and exact.turn < 3e-5
    assert agreement([], 4, None).sigma > 0.002  # nothing tells: a usual one
    assert agreement([], 1, None) == Poses()
    assert agreement([], 4, 0.005).sigma == 0.005


def test_a_face_is_as_uncertain_as_the_poses_of_those_who_saw_it() -> None:
    rng, nothing = np.random.default_rng(5), np.zeros((4, 3))
    poses = Poses(0.003, 1e-9)
    one = fitted_face(seen(rng, 0, 0.0, nothing, nothing, [0]), Survey(PLACES, NOISE, poses))
    four = fitted_face(seen(rng, 0, 0.0, nothing, nothing, [0, 1, 2, 3]), Survey(PLACES, NOISE, poses))
    assert one.plane.position_sigma == pytest.approx(0.003, rel=0.02)
    assert four.plane.position_sigma == pytest.approx(0.0015, rel=0.02)


def test_intervals_hold_where_stations_are_off() -> None:
    rng, sigma, turn = np.random.default_rng(8), 0.002, 1.5e-4
    held, corner = 0, np.array([[0.0, 0.3, 0.2]])
    for _ in range(200):
        shifts, turns = sigma * rng.standard_normal((4, 3)), turn * rng.standard_normal((4, 3))
        face = seen(rng, 0, 0.0, shifts, turns, [0, 1, 2], 300)
        points, errors = levelled(face.plane, face.points, face.station, PLACES[:3], Poses(sigma, turn))
        plane = fit_plane(points, PLACES[face.station], NOISE)
        plane = plane.replaced(covariance=plane.covariance + errors.of_plane(plane, points, face.station))
        held += abs(float(plane.distance(corner)[0])) < 1.96 * float(plane.sigma_at(corner)[0])
    assert 180 <= held <= 199


def test_a_step_between_stations_is_no_unevenness() -> None:
    rng, nothing = np.random.default_rng(6), np.zeros((4, 3))
    shift = np.array([[0.006, 0.0, 0.0], [-0.006, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    face = seen(rng, 0, 0.0, shift, nothing, [0, 1], 40_000)
    kept = (face.station == 0) | (face.points[:, 1] > 2.0)  # the second one saw half of it
    face = FaceReturns(face.points[kept], face.station[kept], face.kind, face.plane)
    plain = flatness(fit_plane(face.points, PLACES[face.station], NOISE), face.points)
    assert min(t.p_value for t in plain) < 1e-6
    found = fitted_face(face, Survey(PLACES, NOISE, Poses(0.006, 1e-6)))
    assert min(t.p_value for t in found.flatness) > 0.05
    assert found.unevenness is not None and found.unevenness.sigma < 0.0004
    low, high = found.unevenness.interval_95
    assert 0.0 <= low <= found.unevenness.sigma <= high


def test_a_bump_in_one_room_is_not_the_other_ones() -> None:
    rng, nothing = np.random.default_rng(7), np.zeros((4, 3))
    face = seen(rng, 0, 0.0, nothing, nothing, [0, 2], 9000)
    away = (face.points[:, 1] - 1.0) ** 2 + (face.points[:, 2] - 1.2) ** 2
    face.points[:, 0] += 0.015 * np.exp(-away / 0.1)
    survey = Survey(PLACES, NOISE, Poses())
    whole = fitted_face(face, survey)
    bumpy, flat = (
        room_faces(box(0.0, *rectangle), [[], [(face, whole)]], survey) for rectangle in ((0.0, 3.0, 1.95), (2.05, 3.0, 4.0))
    )
    assert [f.wall for f in (*bumpy, *flat)] == [1, 1]
    assert min(t.p_value for t in bumpy[0].face.flatness) < 1e-3 < 0.05 < min(t.p_value for t in flat[0].face.flatness)
    assert flat[0].face.plane.count < whole.plane.count
    assert sorted(end[1] for end in flat[0].ends) == pytest.approx([2.05, 4.0], abs=0.05)


def test_the_command_takes_a_stated_registration(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_room(tmp_path)
    arguments = ["reconstruct", str(tmp_path / "room.e57"), "--out", str(tmp_path / "made.ifc"), "--quiet"]
    assert main([*arguments, "--dimensions", str(tmp_path / "made.txt")]) == 1
    assert "must end with .csv" in capsys.readouterr().err and not (tmp_path / "made.ifc").exists()
    assert main([*arguments, "--registration-sigma-mm", "-1"]) == 1
    table, folder = tmp_path / "made.csv", tmp_path / "report"
    capsys.readouterr()
    stated = ["--registration-sigma-mm", "5", "--dimensions", str(table), "--report", str(folder)]
    assert main([*arguments, *stated]) == 0
    said = capsys.readouterr().out
    assert "off by 5.0 mm" in said and f"Report: {folder / 'index.html'}" in said
    with table.open(encoding="utf-8-sig", newline="") as stream:
        rows = list(csv.DictReader(stream))
    made = ifcopenshell.open(str(tmp_path / "made.ifc"))
    slabs = [get_pset(slab, "BimVerify_Reconstruction")["PositionSigma"] for slab in made.by_type("IfcSlab")]
    assert slabs and all(sigma > 0.005 for sigma in slabs)
    openings = [r for r in rows if ", wall" in r["Where"]]
    assert openings and all(float(r["Sigma_mm"]) > 5.0 * np.sqrt(2.0) for r in openings)
    tests = [r for r in rows if r["Limit_mm"]]
    assert tests and all((r["Result"] == "exceeded") == (r["Exceeds"] == "TRUE") for r in tests)
    assert {r["Result"] for r in tests} & {"kept", "open"} and not any(r["Result"] for r in rows if not r["Limit_mm"])
    uneven = [r for r in rows if r["What"] == "unevenness"]
    assert uneven and all(float(r["Low95_mm"]) >= 0.0 for r in uneven)
