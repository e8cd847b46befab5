"""From the scan of a furnished flat to an IFC file: what stands, what is measured, what is assumed."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import ifcopenshell
import ifcopenshell.util.element
import ifcopenshell.validate
import numpy as np
import pytest
from shapely import Point, Polygon, box

from bim_verify.cli import main
from bim_verify.core.model.load import load_model
from bim_verify.core.reconstruction.compare import Comparison, compare
from bim_verify.core.reconstruction.openings import Opening
from bim_verify.core.reconstruction.reconstruct import round_corners
from bim_verify.core.reconstruction.rooms import Room
from bim_verify.core.reconstruction.shapes import read_shapes
from bim_verify.core.reconstruction.storey import is_external
from bim_verify.core.reconstruction.walls import SEEN_OUTSIDE, Piece, WallLine
from bim_verify.core.simulation.campaign import Campaign, scan_to_files, set_up
from bim_verify.core.simulation.scanner import PRESETS
from bim_verify.core.simulation.storey_plans import flat
from bim_verify.core.simulation.storeys import write_building

from .templates import check_templates


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """(file of the reconstruction, file of the truth) of a flat turned by 20 degrees, scanned from inside."""
    folder = tmp_path_factory.mktemp("flat")
    truth, furnished, scan, found = (folder / name for name in ("truth.ifc", "flat.ifc", "flat.e57", "found.ifc"))
    write_building(truth, [flat()], turn_deg=20.0, furniture=False)
    positions = write_building(furnished, [flat()], turn_deg=20.0)
    model = load_model(furnished, cache=False)
    scanner = replace(PRESETS["fast"], angular_step=float(np.radians(0.3)), sigma_range=0.002, sigma_signal=0.0)
    set_ups = tuple(set_up(f"S{k}", p - model.origin, 3, k) for k, p in enumerate(positions))
    scan_to_files(Campaign(model, scanner, set_ups, {}, (), 3, glass="clear"), scan, None)
    table = str(folder / "dimensions.csv")
    assert main(["reconstruct", str(scan), "--out", str(found), "--dimensions", table, "--quiet"]) == 0
    return found, truth


@pytest.fixture(scope="module")
def comparison(built: tuple[Path, Path]) -> Comparison:
    return compare(read_shapes(built[0]), read_shapes(built[1]))


def test_walls_doors_and_rooms_are_found_at_their_place(comparison: Comparison) -> None:
    for kind in ("walls", "doors", "spaces"):
        found = comparison.classes[kind]
        assert len(found.matches) == found.reference, kind
    assert comparison.classes["walls"].largest("axis") < 0.010
    openings = comparison.classes["openings"]
    assert openings.f1 > 0.85
    assert openings.largest("seen_edge") <= openings.largest("edge")
    assert openings.median("seen_edge") < 0.030


def test_the_file_is_valid_and_says_where_each_thickness_comes_from(built: tuple[Path, Path]) -> None:
    file = ifcopenshell.open(str(built[0]))
    logger = ifcopenshell.validate.json_logger()
    ifcopenshell.validate.validate(file, logger)
    assert not logger.statements
    sets = [ifcopenshell.util.element.get_psets(wall)["BimVerify_Reconstruction"] for wall in file.by_type("IfcWall")]
    check_templates(file, "BimVerify_Reconstruction")
    sources = {properties["ThicknessSource"] for properties in sets}
    assert "MEASURED" in sources and sources <= {"MEASURED", "REVEAL", "ASSUMED"}
    said = [ifcopenshell.util.element.get_pset(w, "Pset_WallCommon", "IsExternal") for w in file.by_type("IfcWall")]
    # the sides of the flat with a window; its four partitions have rooms on both sides; of a side without one nothing is said
    assert said.count(False) == 4
    assert said.count(True) == len(flat().outer_openings) and said.count(None) == 4 - len(flat().outer_openings)


@pytest.mark.parametrize(("right", "lost", "station", "expected"), [
    (1, 0.9, (0.0, -3.0), False), (-1, 0.0, (0.0, -3.0), None), (-1, 0.9, (0.0, 1.0), True),
    (SEEN_OUTSIDE, 0.0, (0.0, -3.0), True), (SEEN_OUTSIDE, 0.0, (0.0, 1.0), None),
])  # fmt: skip
def test_a_wall_is_an_outer_one_only_where_the_outside_was_seen(
    right: int, lost: float, station: tuple[float, float], expected: bool | None
) -> None:
    room = Room(box(-2.0, 0.0, 2.0, 3.0), (), (), 0.0, 2.5)
    piece = Piece(np.array([1.0, 0.0]), 0.0, None, -2.0, 2.0, 0, right)
    line = WallLine(np.array([1.0, 0.0]), 0.0, 0.2, "ASSUMED", -2.0, 2.0, [piece])
    window = Opening(-0.5, 0.5, 0.9, 2.1, "window", False, 1.0, lost=lost)
    assert is_external(line, (window,), [room], np.array([[*station, 1.5]])) is expected


def test_a_room_with_a_round_wall_is_told_from_one_with_slanted_corners() -> None:
    arc = [(5 + 2.5 * np.cos(a), 2.5 + 2.5 * np.sin(a)) for a in np.radians(np.arange(-75.0, 80.0, 15.0))]
    assert round_corners(Polygon([(0, 0), (5, 0), *arc, (5, 5), (0, 5)])) >= 10
    assert round_corners(Polygon([(0, 0), (5, 0), (6, 0.4), (6, 4), (0, 5)])) < 3
    assert round_corners(box(0, 0, 4, 3)) == 0
    assert round_corners(Point(0, 0).buffer(3.0)) > 10


def test_openings_say_how_surely_their_edges_are_known(built: tuple[Path, Path]) -> None:
    file = ifcopenshell.open(str(built[0]))
    for product in (*file.by_type("IfcOpeningElement"), *file.by_type("IfcDoor"), *file.by_type("IfcWindow")):
        properties = ifcopenshell.util.element.get_psets(product)["BimVerify_Reconstruction"]
        names = {"start": "StartEdgeSigma", "end": "EndEdgeSigma", "sill": "SillSigma", "head": "HeadSigma"}
        hidden = [] if properties["HiddenEdges"] == "none" else properties["HiddenEdges"].split(", ")
        assert set(hidden) <= set(names)
        assert all(0.0 < properties[name] < 0.02 for edge, name in names.items() if edge not in hidden)


def test_the_table_of_dimensions_has_every_room(built: tuple[Path, Path]) -> None:
    with (built[0].parent / "dimensions.csv").open(encoding="utf-8-sig", newline="") as stream:
        rows = list(csv.DictReader(stream))
    rooms = [r for r in rows if "room" in r["Where"]]
    assert {r["Where"][-6:] for r in rooms} == {f"room {k}" for k in range(1, 5)}
    kinds = {r["What"].split()[0] for r in rooms}
    tests = {"plumb", "orthogonality", "parallelism", "flatness"}
    assert kinds == tests | {"width", "height", "vertex", "edge", "lean", "slope", "unevenness"}
    written = ifcopenshell.open(str(built[0]))
    assert {r["GlobalId"] for r in rooms} == {s.GlobalId for s in written.by_type("IfcSpace")}
    holes = {o.GlobalId: o for o in written.by_type("IfcOpeningElement")}
    for row in (r for r in rows if "room" not in r["Where"]):
        assert holes[row["GlobalId"]].VoidsElements[0].RelatingBuildingElement.Name.lower() == row["Between"]
    widths = [float(r["AsBuilt_mm"]) for r in rooms if r["What"] == "width"]
    heights = [r for r in rooms if r["What"] == "height"]
    assert len(heights) == 4 and all(abs(float(r["AsBuilt_mm"]) - 1000 * flat().height) < 3.0 for r in heights)
    openings = [r for r in rows if "room" not in r["Where"]]
    assert {r["What"] for r in openings} == {"width", "height"} and all(float(r["Sigma_mm"]) > 0 for r in openings)
    for planned in (2560.0, 3525.0):  # the bath from west to east, the bedroom from south to north
        assert min(abs(w - planned) for w in widths) < 3.0


def test_a_model_equals_itself(built: tuple[Path, Path]) -> None:
    same = compare(read_shapes(built[1]), read_shapes(built[1]))
    assert same.quality == pytest.approx(0.0, abs=1e-7)  # an angle from its cosine carries the root of the round-off


def test_two_files_are_compared_by_the_command(
    built: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found, truth = map(str, built)
    data, folder = tmp_path / "c.json", tmp_path / "report"
    assert main(["compare", found, truth, "--json", str(data), "--report", str(folder)]) == 0
    assert "walls: 8 of 8 found" in capsys.readouterr().out
    said = json.loads(data.read_text(encoding="ascii"))
    walls = said["classes"]["walls"]
    assert walls["precision"] == walls["recall"] == 1.0 and len(walls["pairs"]) == 8
    assert {"middle_m", "angle_deg", "length_m", "width_m", "quality"} <= set(walls["pairs"][0])
    assert 0.0 < said["quality"] < 0.2 and said["limits"]["middle_m"] == 0.5
    page = (folder / "index.html").read_text(encoding="utf-8")
    assert "Pairs: walls" in page and "Precision" in page
    assert main(["compare", found, found, "--json", found]) == 1
    empty = tmp_path / "empty.ifc"
    ifcopenshell.file(schema="IFC4").write(str(empty))
    capsys.readouterr()
    assert main(["compare", found, str(empty), "--report", str(tmp_path / "none")]) == 1
    assert capsys.readouterr().err.count("\n") == 1 and not (tmp_path / "none").exists()


def test_a_scan_of_nothing_is_refused_in_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = tmp_path / "few.xyz", tmp_path / "out.ifc"
    np.savetxt(path, np.random.default_rng(0).random((20, 3)))
    assert main(["reconstruct", str(path), "--origin", "0,0,9", "--out", str(out), "--quiet"]) == 1
    assert not out.exists()
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
