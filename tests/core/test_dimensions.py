"""Dimensions of a model's room and window as built: from the IFC file and a scan to CSV, JSON and the report."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import ifcopenshell.api
import numpy as np
import pytest
from shapely import box

from bim_verify.cli import main
from bim_verify.core.dimensions.opening_edges import HoleOnFace
from bim_verify.core.dimensions.openings import opening_shares
from bim_verify.core.dimensions.regions import Region, read_regions
from bim_verify.core.dimensions.table import HEADER, conformity, dimensions_to_json, width, write_dimensions
from bim_verify.core.jobs import dimensions, verify
from bim_verify.core.model.load import load_model
from bim_verify.core.options import VerifyOptions
from bim_verify.core.planes.conformity import Conformity, flatness
from bim_verify.core.planes.derived import Estimate
from bim_verify.core.planes.fit import fit_plane
from bim_verify.core.planes.noise import PointNoise
from bim_verify.core.reconstruction.opening_edges import EdgePlace
from bim_verify.core.simulation.campaign import Campaign, scan_to_files, set_up
from bim_verify.core.simulation.scanner import PRESETS

from .model_files import ModelFile, at
from .room_files import DEEP, HIGH, OUT_M, WIDE, write_room


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[dict[str, Any]], Path]:
    """(dimensions of the JSON file, folder of the results) of a room 1000 km away, in feet and turned."""
    folder = tmp_path_factory.mktemp("dimensions")
    write_room(folder)
    arguments = [
        "verify", str(folder / "room.ifc"), str(folder / "room.e57"), "--out", str(folder / "out.ifc"), "--sigma-mm", "1.0",
        "--spacing-mm", "50", "--dimensions", str(folder / "dimensions.csv"), "--json", str(folder / "out.json"),
        "--report", str(folder / "report"), "--quiet",
    ]  # fmt: skip
    assert main(arguments) == 0
    return json.loads((folder / "out.json").read_text(encoding="ascii"))["dimensions"], folder


def of(rows: list[dict[str, Any]], what: str, *between: str) -> Iterator[dict[str, Any]]:
    return (r for r in rows if r["what"] == what and sorted(r["between"]) == sorted(between))


def test_the_room_is_as_wide_as_it_was_built_and_the_plan_is_told_apart(told: tuple[list[dict[str, Any]], Path]) -> None:
    rows, _ = told
    (across,) = of(rows, "width", "south", "north")
    (along,) = of(rows, "width", "west", "east")
    (height,) = of(rows, "height", "floor", "slab")
    for row, planned, built in ((across, DEEP, DEEP + OUT_M), (along, WIDE, WIDE), (height, HIGH, HIGH)):
        assert row["where"] == "=1+1"
        assert row["planned"] == pytest.approx(planned, abs=1e-6)
        assert abs(row["value"] - built) < 3 * row["sigma"] < 0.006
        assert row["interval_95"][0] < row["value"] < row["interval_95"][1]
    assert across["p_value"] < 1e-6
    assert along["p_value"] > 0.01 and height["p_value"] > 0.01


def test_a_window_has_its_clear_width_and_height(told: tuple[list[dict[str, Any]], Path]) -> None:
    rows, _ = told
    own = [r for r in rows if r["where"] == "Opening"]
    assert {r["what"] for r in own} == {"width", "width at the face", "height"}
    for row in own:
        assert row["between"] == ["south"]
        assert row["planned"] == pytest.approx({"width": 1.2, "height": 1.1}[row["what"].split()[0]], abs=1e-6)
        assert abs(row["value"] - row["planned"]) < 3 * row["sigma"] + 0.001


def test_walls_are_tested_for_plumb_square_parallel_and_flat(told: tuple[list[dict[str, Any]], Path]) -> None:
    rows, _ = told
    tests = [r for r in rows if r["limit"] is not None]
    assert {r["what"].split()[0] for r in tests} == {"plumb", "orthogonality", "parallelism", "flatness"}
    assert sum(r["what"] == "plumb" for r in tests) == 4
    assert sum(r["what"] == "orthogonality" for r in tests) == 4
    assert sum(r["what"] == "parallelism" for r in tests) == 2
    assert not any(r["exceeds"] for r in tests)
    assert all(0.0 <= r["p_limit"] <= 1.0 and 0.0 <= r["p_value"] <= 1.0 for r in tests)


def test_corners_stand_where_the_walls_were_built(told: tuple[list[dict[str, Any]], Path]) -> None:
    rows, _ = told
    vertices = [r for r in rows if r["what"].startswith("vertex")]
    assert len(vertices) == 8 * 3 and all(r["loa"] for r in vertices)
    moved = [r for r in vertices if "north" in r["between"]]
    for row in vertices:
        assert row["covariance"]["xyz".index(row["what"][-1])] == pytest.approx(row["sigma"] ** 2)
        built = row["planned"] if row not in moved else None
        assert built is None or abs(row["value"] - built) < 3.5 * row["sigma"]
    off = [np.hypot(*(x["value"] - x["planned"] for x in pair)) for pair in zip(moved[0::3], moved[1::3], strict=True)]
    assert off == pytest.approx([OUT_M] * 4, abs=0.003)  # the corners of the wall that stands off, in plan
    (height,) = of(rows, "edge length", "south", "west")
    (along,) = of(rows, "edge length", "floor", "west")
    assert abs(height["value"] - HIGH) < 3.5 * height["sigma"] < 0.006
    assert abs(along["value"] - DEEP - OUT_M) < 3.5 * along["sigma"] < 0.006
    for what in ("edge lean x", "edge lean y", "edge slope", "lean", "slope x", "slope y"):
        own = [r for r in rows if r["what"] == what]
        assert own and all(abs(r["value"]) < 4 * r["sigma"] + 1e-6 for r in own), what
    assert sum(r["what"] == "unevenness" for r in rows) == 6


def test_csv_and_report_say_the_same(told: tuple[list[dict[str, Any]], Path]) -> None:
    rows, folder = told
    with (folder / "dimensions.csv").open(encoding="utf-8-sig", newline="") as stream:
        table = list(csv.DictReader(stream))
    assert len(table) == len(rows)
    assert table[0]["Where"] == "'=1+1"  # no formula for a spreadsheet
    assert float(table[0]["AsBuilt_mm"]) == pytest.approx(1000 * rows[0]["value"], abs=0.006)
    page = (folder / "report" / "index.html").read_text(encoding="utf-8")
    assert "Dimensions as built" in page and page.count("orthogonality") == 4


def test_a_wall_with_a_bump_is_not_flat() -> None:
    rng = np.random.default_rng(4)
    points = rng.random((60_000, 3)) * (4.0, 0.0, 2.5)
    away = (points[:, 0] - 2.0) ** 2 + (points[:, 2] - 1.2) ** 2
    points[:, 1] = 0.02 * np.exp(-away / 0.3) + rng.normal(0.0, 0.001, len(points))
    plane = fit_plane(points, points + np.array([0.0, 1.0, 0.0]), PointNoise(0.001, 0.0, 0.0))
    tests = {t.name: t for t in flatness(plane, points)}
    assert "flatness 0.1 m" not in tests  # cells of 0.1 m cannot tell
    assert tests["flatness 1 m"].exceeds
    assert not {t.name: t for t in flatness(plane, points, shared_sigma=0.01)}["flatness 1 m"].exceeds


def test_regions_of_a_file_and_what_lies_in_them(told: tuple[list[dict[str, Any]], Path]) -> None:
    _, folder = told
    spaces, openings = read_regions(folder / "room.ifc", np.zeros(3))
    assert [s.name for s in spaces] == ["=1+1"] and len(openings) == 1 and openings[0].host
    assert spaces[0].outline.area == pytest.approx(WIDE * DEEP, rel=1e-6)
    region = Region("", "", box(0, 0, 2, 1), 0.0, 2.0)
    places = np.array([[1.0, 0.5, 1.0], [1.0, 1.05, 1.0], [1.0, 0.5, 2.05]])
    assert region.holds(places).tolist() == [True, False, False]
    assert region.holds(places, 0.1).tolist() == [True, True, True]


def test_a_table_without_a_plan_leaves_it_open(tmp_path: Path) -> None:
    rows = [
        width("Room", "", "width", ("wall 1", "wall 2"), Estimate(3.0, 0.001)),
        conformity("Room", "", ("wall 1",), Conformity("plumb", 0.004, 0.001, 0.001, 0.008, 0.99)),
    ]
    write_dimensions(tmp_path / "d.csv", rows)
    with (tmp_path / "d.csv").open(encoding="utf-8-sig", newline="") as stream:
        first, second = csv.DictReader(stream)
    assert tuple(first) == HEADER
    assert first["Planned_mm"] == first["PValue"] == first["Exceeds"] == ""
    assert (first["Low95_mm"], first["High95_mm"]) == ("2998.04", "3001.96")
    assert second["Exceeds"] == "FALSE" and second["Limit_mm"] == "8.00"


def test_a_door_ends_at_the_floor_and_what_is_covered_says_so(tmp_path: Path) -> None:
    made, thick = ModelFile("IFC4", "m"), 0.25
    made.product("IfcSlab", "floor", made.box(3.5, 3.5, 0.2), at(-0.25, -0.25, -0.2))
    sizes = {
        "south": ((3.5, thick), (-0.25, -thick)), "north": ((3.5, thick), (-0.25, 3.0)), "west": ((thick, 3.0), (-thick, 0.0)),
    }
    walls = {n: made.product("IfcWall", n, made.box(*size, 2.5), at(*place)) for n, (size, place) in sizes.items()}
    made.opening(walls["south"], made.box(0.9, thick + 0.2, 2.1), at(1.0, -thick - 0.1, 0.0)).Name = "bare"
    covered = made.opening(walls["north"], made.box(0.9, thick + 0.2, 2.1), at(1.0, 2.9, 0.0))
    covered.Name = "covered"
    door = made.product("IfcDoor", "door", made.box(0.9, 0.25, 2.1), at(1.0, 3.0, 0.0))
    ifcopenshell.api.feature.add_filling(made.file, opening=covered, element=door)
    model = load_model(made.write(tmp_path / "doors.ifc"), cache=False)
    places = ((1.2, 1.4, 1.5), (1.9, 1.0, 1.3))
    set_ups = tuple(set_up(f"S{k}", np.array(p) - model.origin, 5, k) for k, p in enumerate(places))
    scanner = replace(PRESETS["fast"], angular_step=float(np.radians(0.5)), sigma_range=0.001, sigma_signal=0.0)
    scan_to_files(Campaign(model, scanner, set_ups, {}, (), 5), tmp_path / "doors.e57", None)
    result = verify(model, [tmp_path / "doors.e57"], VerifyOptions(sigma=0.001))
    rows = dimensions(result)
    own = {(r.where, r.what): r for r in rows if r.opening}
    height = own["bare", "height"]
    assert set(height.between) == {"floor", "south"} and height.planned == pytest.approx(2.1, abs=1e-6)
    assert height.value is not None and height.sigma is not None and abs(height.value - 2.1) < 3 * height.sigma < 0.01
    assert own["bare", "width"].value is not None
    assert own["covered", "width"].value is None and "covered by door" in own["covered", "width"].reason
    edges = own["bare", "width at the face"]
    assert edges.planned == pytest.approx(0.9, abs=1e-6) and edges.value is not None and edges.sigma is not None
    assert abs(edges.value - 0.9) < 1.96 * edges.sigma < 0.03
    (tmp_path / "doors.e57").unlink()
    left = {(r.where, r.what): r for r in dimensions(result) if r.opening}
    assert left["bare", "width"] == own["bare", "width"] and ("bare", "width at the face") not in left
    assert "scans are no longer there" in left["covered", "width"].reason
    assert "widths of 1 of 2 openings (1 between edges" in opening_shares(rows) and "heights of 1 of 2" in opening_shares(rows)
    write_dimensions(tmp_path / "d.csv", rows)
    assert "covered by door" in (tmp_path / "d.csv").read_text(encoding="utf-8-sig")
    assert any(d["value"] is None and d["interval_95"] is None for d in dimensions_to_json(rows))


def test_an_opening_whose_sides_are_covered_is_measured_in_its_frame(tmp_path: Path) -> None:
    made, thick = ModelFile("IFC4", "m"), 0.25
    made.product("IfcSlab", "floor", made.box(3.5, 3.5, 0.2), at(-0.25, -0.25, -0.2))
    walls = {"west": made.product("IfcWall", "west", made.box(thick, 3.0, 2.5), at(-thick, 0.0))}
    framed = made.opening(walls["west"], made.box(thick + 0.2, 0.9, 2.1), at(-thick - 0.1, 1.0, 0.0))
    framed.Name = "framed"
    for k, (wide, y, low) in enumerate(((0.08, 1.0, 0.0), (0.08, 1.82, 0.0), (0.74, 1.08, 2.02))):
        bar = made.product("IfcDoor", f"bar {k}", made.box(thick, wide, 0.08 if low else 2.1), at(-thick, y, low))
        ifcopenshell.api.feature.add_filling(made.file, opening=framed, element=bar)
    model = load_model(made.write(tmp_path / "frame.ifc"), cache=False)
    set_ups = (set_up("S1", np.array([1.2, 1.4, 1.5]) - model.origin, 5, 0),)
    scanner = replace(PRESETS["fast"], angular_step=float(np.radians(0.5)), sigma_range=0.001, sigma_signal=0.0)
    scan_to_files(Campaign(model, scanner, set_ups, {}, (), 5), tmp_path / "frame.e57", None)
    rows = dimensions(verify(model, [tmp_path / "frame.e57"], VerifyOptions(sigma=0.001)))
    own = {(r.where, r.what): r for r in rows if r.opening}
    for what, planned in (("width", 0.74), ("height", 2.02)):
        inner = own["framed", f"{what} in the frame"]
        assert inner.planned == pytest.approx(planned, abs=1e-6) and inner.value is not None and inner.sigma is not None
        assert abs(inner.value - planned) < 3 * inner.sigma < 0.01
    assert ("framed", "width at the face") not in own  # the frame is flush with the wall: its edge is not the opening's
    assert "widths of 1 of 1 openings (0 between edges on the wall's face, 1 within a frame)" in opening_shares(rows)


def test_a_pose_is_common_to_the_edges_that_its_station_saw() -> None:
    """1000 draws of edges seen by one station, by two, and by two that saw one edge each."""
    rng, pose, spread, held = np.random.default_rng(4), 0.003, 0.001, []
    for _ in range(1000):
        off = rng.normal(0.0, pose, 2)

        def place(at: float, station: int, off: np.ndarray = off) -> tuple[int, EdgePlace]:
            return station, EdgePlace(at + off[station] + rng.normal(0.0, spread), spread, True)

        for start, end in (((0,), (0,)), ((0, 1), (0, 1)), ((0,), (1,))):
            hole = HoleOnFace({"start": [place(0.0, s) for s in start], "end": [place(1.2, s) for s in end]}, pose)
            found = hole.distance("start", "end")
            assert found is not None
            held.append((abs(found.value - 1.2) <= 1.96 * found.sigma, found.sigma))
    inside, sigma = np.array(held).reshape(-1, 3, 2).transpose(2, 1, 0)
    assert ((inside.mean(axis=1) > 0.93) & (inside.mean(axis=1) < 0.985)).all()
    assert sigma[0].max() == pytest.approx(np.sqrt(2.0) * spread)
    assert sigma[2].max() == pytest.approx(np.sqrt(2.0) * np.hypot(spread, pose))
    assert hole.distance("sill", "head") is None
