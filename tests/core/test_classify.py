"""Every return to its element: right, complete, the same whatever the order; as E57 and LAS that other readers open."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import laspy
import numba
import numpy as np
import pye57
import pytest

from bim_verify.cli import main
from bim_verify.core.classification.assign import Assigner, Window
from bim_verify.core.classification.codes import CODES, OTHER, las_code
from bim_verify.core.classification.results import Classification
from bim_verify.core.classification.write import write_classified
from bim_verify.core.errors import BimVerifyError
from bim_verify.core.jobs import classify
from bim_verify.core.model.elements import BuildingModel
from bim_verify.core.model.load import load_model
from bim_verify.core.options import ClassifyOptions
from bim_verify.core.scans.e57_header import read_headers
from bim_verify.core.scans.e57_pages import E57Pages
from bim_verify.core.scans.e57_records import read_records
from bim_verify.core.scans.open import open_scans
from bim_verify.core.scans.write_e57 import extension_uri
from bim_verify.core.simulation.box_building import ArraySource
from bim_verify.core.simulation.campaign import Campaign, scan_to_files, set_up
from bim_verify.core.simulation.return_truth import MIXED, OWNER, read_truth
from bim_verify.core.simulation.scanner import PRESETS
from bim_verify.core.simulation.scene import Edit, Prop

from .model_files import ModelFile, at
from .scan_data import read_all
from .verify_data import PLAN, built, scan, shifted
from .verify_data import house as planned

SCANNER = replace(PRESETS["fast"], angular_step=np.radians(1.0), sigma_range=0.001, sigma_signal=0.0)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """(model, scan): a turned room far away, a partition with an opening without a door, a box that is not in the model."""
    folder = tmp_path_factory.mktemp("room")
    made, base = ModelFile(), at(1000.0, 2000.0, 30.0, 30.0)
    walls = {"south": (0, -0.2, 6, 0.2), "north": (0, 4, 6, 0.2), "west": (-0.2, -0.2, 0.2, 4.4), "east": (6, -0.2, 0.2, 4.4)}
    for name, (x, y, dx, dy) in walls.items():
        made.product("IfcWall", name, made.box(dx, dy, 2.6), base @ at(x=x, y=y))
    made.product("IfcSlab", "floor", made.box(6.0, 4.0, 0.2), base @ at(z=-0.2))
    partition = made.product("IfcWall", "partition", made.box(0.15, 4.0, 2.6), base @ at(x=4.0))
    made.opening(partition, made.box(0.35, 0.9, 2.1), base @ at(x=3.9, y=1.0))
    model_path = made.write(folder / "room.ifc")
    model = load_model(model_path, cache=False)
    places = [base @ np.array([*p, 1.0]) for p in ((1.5, 1.5, 1.4), (3.0, 3.0, 1.6))]
    middle = base @ np.array([2.5, 1.0, 0.4, 1.0])
    box = Prop("box", "box", tuple(float(v) for v in middle[:3] - model.origin), (0.4, 0.4, 0.5))
    set_ups = tuple(set_up(f"S{k}", p[:3] - model.origin, 1, k) for k, p in enumerate(places))
    scan_to_files(Campaign(model, SCANNER, set_ups, {}, (box,), 1), folder / "scan.e57", None)
    return model_path, folder / "scan.e57"


@pytest.fixture(scope="module")
def found(files: tuple[Path, Path]) -> Classification:
    return classify(files[0], [files[1]], ClassifyOptions(sigma=0.001, cache=False))


def truth_of(found: Classification, path: Path) -> tuple[np.ndarray, np.ndarray]:
    """(N,) owner, -1 for what is not in the model, and whether the return mixes surfaces."""
    parts = [read_truth(path, k) for k in range(len(found.stations))]
    owner = np.concatenate([p[OWNER] for p in parts]).astype(np.int64)
    return np.where(owner < len(found.model.elements), owner, -1), np.concatenate([p[MIXED] for p in parts]) != 0


def test_returns_are_on_the_element_that_they_met(files: tuple[Path, Path], found: Classification) -> None:
    want, mixed = truth_of(found, files[1])
    clean = ~mixed
    assert len(want) == len(found.element) > 30_000
    assert (found.element == want)[clean].mean() > 0.995
    thing = clean & (want < 0)
    assert thing.sum() > 100
    assert (found.element[thing] < 0).mean() > 0.97
    assert np.abs(found.deviation[clean & (want >= 0) & (found.element == want)]).mean() < 0.003
    through = [e.name for e in found.model.elements].index("east")
    assert found.counts[through].sum() > 200  # seen through the opening only


def test_threads_and_blocks_change_nothing(files: tuple[Path, Path], found: Classification) -> None:
    again = classify(files[0], [files[1]], ClassifyOptions(sigma=0.001, cache=False, threads=1))
    np.testing.assert_array_equal(again.element, found.element)
    np.testing.assert_array_equal(again.deviation, found.deviation)
    assigner = Assigner(found.model, Window.of(0.0075, 0.001, 0.002))
    block = next(iter(found.source.blocks()))
    place = found.stations[0].position - found.model.origin
    backwards = assigner.assign(place, block.offsets[::-1]).element[::-1]
    np.testing.assert_array_equal(backwards, found.element[: len(backwards)])
    assert numba.get_num_threads() >= 1


def test_e57_has_a_scan_for_each_element(files: tuple[Path, Path], found: Classification, tmp_path: Path) -> None:
    out = tmp_path / "classified.e57"
    write_classified(out, found, 3.0)
    file = pye57.E57(str(out))
    total, names = 0, {}
    for k in range(file.scan_count):
        node = file.get_header(k).node
        names[node["guid"].value()] = node["name"].value()
        points = file.read_scan_raw(k)
        total += len(points["cartesianX"])
    assert total == len(found.element)
    present = {e.global_id: e.name for e, n in zip(found.model.elements, found.counts, strict=False) if n.sum()}
    assert present.items() <= names.items()
    assert "unassigned" in names.values()
    stations = file.image_file.root()["bv:stations"]
    assert [stations[k]["name"].value() for k in range(len(found.stations))] == ["S0", "S1"]
    x = stations[1]["translation"]["x"].value()
    assert x == pytest.approx(found.stations[1].position[0], abs=1e-6)
    groups = file.get_header(0).node["bv:groups"]
    kept = {groups[k]["station"].value(): groups[k]["count"].value() for k in range(groups.childCount())}
    first = next(n for n in found.counts if n.sum())
    assert kept == {k: n for k, n in enumerate(first.tolist()) if n}
    both = read_all(open_scans([out], origin=(0.0, 0.0, 0.0)))
    original = read_all(found.source)
    key = np.where(found.element < 0, len(found.model.elements), found.element) * len(found.stations) + original.station
    np.testing.assert_allclose(both.xyz, original.xyz[np.argsort(key, kind="stable")], atol=1.1e-5)
    file.close()


def test_fields_say_station_and_deviation_of_each_return(found: Classification, tmp_path: Path) -> None:
    out = tmp_path / "fields.e57"
    write_classified(out, found, 3.0, fields=True)
    with E57Pages(out) as pages:
        records = read_headers(pages)[0].records
        names = [f"{{{extension_uri('bv')}}}{name}" for name in ("station", "deviation")]
        blocks = [{n: np.array(block[n]) for n in names} for block in read_records(pages, records, names, 100_000)]
    station, deviation = (np.concatenate([b[n] for b in blocks]) for n in names)
    row = int(np.flatnonzero(found.counts.sum(axis=1))[0])
    assert np.bincount(station, minlength=2).tolist() == found.counts[row].tolist()
    assert deviation.mean() == pytest.approx(found.mean[row], abs=1e-6)


def test_a_scan_per_station_keeps_pose_and_grid(found: Classification, tmp_path: Path) -> None:
    out = tmp_path / "per_station.e57"
    write_classified(out, found, 3.0, per_station=True)
    source = open_scans([out])
    assert len(source.stations) == 2  # those of the same pose are one station again
    for one, other in zip(sorted(source.stations, key=lambda s: s.position[0]),
                          sorted(found.stations, key=lambda s: s.position[0]), strict=True):
        np.testing.assert_allclose(one.position, other.position, atol=1e-9)
    whole = read_all(source)
    assert len(whole.xyz) == len(found.element)
    assert whole.row is not None
    again = classify(found.model, source, ClassifyOptions(sigma=0.001))
    np.testing.assert_array_equal(again.counts.sum(axis=1), found.counts.sum(axis=1))


def test_a_small_memory_gives_the_same_file(found: Classification, tmp_path: Path) -> None:
    write_classified(tmp_path / "a.e57", found, 3.0)
    write_classified(tmp_path / "b.e57", found, 1e-4)
    one, other = (read_all(open_scans([tmp_path / n], origin=(0.0, 0.0, 0.0))) for n in ("a.e57", "b.e57"))
    np.testing.assert_array_equal(one.xyz, other.xyz)


@pytest.mark.parametrize("name", ["c.las", "c.laz"])
def test_las_has_codes_elements_and_stations(found: Classification, tmp_path: Path, name: str) -> None:
    write_classified(tmp_path / name, found, 3.0)
    las = laspy.read(tmp_path / name)
    assert len(las.points) == len(found.element)
    element = np.asarray(las["element"]).astype(int) - 1
    for row, e in enumerate(found.model.elements):
        assert (element == row).sum() == found.counts[row].sum()
        assert (np.asarray(las.classification)[element == row] == las_code(e.ifc_class)).all()
    assert (np.asarray(las.classification)[element < 0] == 1).all()
    assert np.bincount(las.point_source_id)[1:].tolist() == found.counts.sum(axis=0).tolist()
    legend = json.loads(las.evlrs[0].record_data_bytes())
    assert [e["global_id"] for e in legend["elements"]] == [e.global_id for e in found.model.elements]
    station = np.asarray(las.point_source_id) == 1
    reach = np.linalg.norm(np.asarray(las.xyz)[station] - legend["stations"][0]["position"], axis=1)
    assert reach.max() < 8.0


def test_a_stray_return_is_too_far_for_las_and_leaves_no_file(found: Classification, tmp_path: Path) -> None:
    stray = np.array([[1e9, 0.0, 0.0]])
    source = ArraySource(found.stations, (stray, *(np.zeros((0, 3)) for _ in found.stations[1:])))
    counts = np.zeros_like(found.counts)
    counts[-1, 0] = 1
    alone = replace(
        found, source=source, element=np.array([-1], np.int32), deviation=np.array([np.nan], np.float32), counts=counts
    )
    with pytest.raises(BimVerifyError, match=r"1 returns lie farther than 215 km.*E57"):
        write_classified(tmp_path / "far.las", alone, 3.0)
    assert not list(tmp_path.iterdir())


def test_points_that_are_no_returns_and_files_given_twice_are_told(
    files: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, data = tmp_path / "scan.xyz", tmp_path / "c.json"
    returns = read_all(open_scans([files[1]])).xyz
    station = open_scans([files[1]]).stations[0].position
    rows = [*returns[:500].tolist(), station.tolist()]
    text.write_text("\n".join(" ".join(f"{v:.4f}" for v in row) for row in rows), encoding="ascii")
    origin = ",".join(f"{v:.4f}" for v in station)
    assert main(["classify", str(files[0]), str(text), str(text), "--origin", origin, "--out", str(tmp_path / "c.las"),
                 "--json", str(data), "--no-cache"]) == 0
    said = capsys.readouterr().out
    assert "2 points of the scans are no returns" in said and "2 at the scanner itself" in said and "more than once" in said
    assert json.loads(data.read_text())["dropped"] == {"invalid": 0, "zero": 2, "not_finite": 0}


def test_codes_know_the_classes_of_buildings() -> None:
    assert las_code("IfcWallStandardCase") == 64
    assert las_code("IfcBuildingElementProxy") == 79
    assert las_code("IfcStairFlight") == 72
    assert las_code("IfcMechanicalFastener") == OTHER
    assert len({code for code, _ in CODES}) == len(CODES)


def test_a_moved_element_is_found_where_it_stands_and_an_absent_one_nowhere() -> None:
    model: BuildingModel = planned()
    rows = list(PLAN)
    scene = built({"partition": shifted(x=0.08), "cupboard": Edit("remove")})
    source: ArraySource = scan(scene)
    plain = classify(model, source, ClassifyOptions(sigma=0.0013))
    found = classify(model, source, ClassifyOptions(sigma=0.0013, as_built=True))
    partition, cupboard = rows.index("partition"), rows.index("cupboard")
    assert plain.counts[partition].sum() < 0.2 * found.counts[partition].sum()
    assert found.moved[model.elements[partition].global_id][0] == pytest.approx(0.08, abs=0.003)
    assert model.elements[cupboard].global_id in found.absent
    assert found.counts[cupboard].sum() == 0
    assert abs(found.mean[partition]) < 0.002


def test_the_command(files: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model, scan_path = map(str, files)
    out, data = tmp_path / "out.e57", tmp_path / "out.json"
    assert main(["classify", model, scan_path, "--out", str(out), "--json", str(data), "--report", str(tmp_path / "r"),
                 "--no-cache"]) == 0
    page = (tmp_path / "r" / "index.html").read_text(encoding="utf-8")
    assert "By station" in page and "on no element" in page
    said = json.loads(data.read_text())
    assert said["returns"] == sum(e["returns"] for e in said["elements"]) + said["unassigned"]
    assert pye57.E57(str(out)).scan_count == sum(e["returns"] > 0 for e in said["elements"]) + 1
    capsys.readouterr()
    for bad, why in (
        (["--out", str(tmp_path / "x.ply")], ".e57"),
        (["--out", scan_path], "input"),
        (["--out", str(tmp_path / "x.las"), "--per-station"], "--per-station"),
        (["--out", str(tmp_path / "x.e57"), "--sigma-mm", "-1"], "--sigma-mm"),
    ):
        assert main(["classify", model, scan_path, *bad]) == 1
        error = capsys.readouterr().err
        assert why in error
        assert error.count("\n") == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out.e57", "out.json", "r"]


def test_scans_elsewhere_are_refused(found: Classification) -> None:
    away = tuple(replace(s, position=s.position + 100.0) for s in found.stations)
    source = ArraySource(away, tuple(np.array([[1.0, 0.0, 0.0]]) for _ in away))
    with pytest.raises(BimVerifyError, match="register"):
        classify(found.model, source)
