"""The demo house, its campaign, and the stations file."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import ifcopenshell
import ifcopenshell.util.element
import ifcopenshell.validate
import numpy as np
import pytest

from bim_verify.core.errors import BimVerifyError
from bim_verify.core.model.elements import BuildingModel
from bim_verify.core.model.load import load_model
from bim_verify.core.simulation import demo
from bim_verify.core.simulation.house import write_demo_house
from bim_verify.core.simulation.scanner import PRESETS
from bim_verify.core.simulation.scene import glass_triangles
from bim_verify.core.simulation.stations_file import (
    PlannedStation,
    StationPlan,
    read_stations,
    simulate,
    write_stations,
)


@pytest.fixture(scope="module", autouse=True)
def cache_of_these_tests(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Each house is tessellated once, in a cache of its own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("BIM_VERIFY_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="module")
def house(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("house") / "house.ifc"
    write_demo_house(path)
    return path


@pytest.fixture(scope="module")
def model(house: Path) -> BuildingModel:
    return load_model(house)


@pytest.mark.parametrize("schema", ["IFC2X3", "IFC4", "IFC4X3"])
def test_the_house_is_valid_ifc(schema: str, tmp_path: Path) -> None:
    write_demo_house(tmp_path / "house.ifc", schema=schema)
    logger = ifcopenshell.validate.json_logger()
    ifcopenshell.validate.validate(ifcopenshell.open(tmp_path / "house.ifc"), logger)
    assert logger.statements == []


def test_the_house_is_the_same_file_every_time(house: Path, tmp_path: Path) -> None:
    write_demo_house(tmp_path / "house.ifc")
    assert (tmp_path / "house.ifc").read_bytes() == house.read_bytes()


def test_another_schema_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BimVerifyError, match="IFC2X3, IFC4, IFC4X3"):
        write_demo_house(tmp_path / "house.ifc", schema="IFC5")
    assert list(tmp_path.iterdir()) == []


def test_the_house_has_what_a_house_has(house: Path, model: BuildingModel) -> None:
    count = Counter(e.ifc_class for e in model.elements)
    assert count["IfcWall"] == 14 and count["IfcWindow"] >= 10 and count["IfcDoor"] == 10
    assert count["IfcColumn"] == 6 and count["IfcBuildingElementProxy"] == 2 and count["IfcStairFlight"] == 1
    assert not model.skipped and model.closed.all()
    assert {e.storey for e in model.elements} == {"Ground floor", "Upper floor"}
    np.testing.assert_allclose(np.ptp(model.bounds, axis=0), [19.0, 19.8, 9.144], atol=1e-3)
    file = ifcopenshell.open(house)
    for opening in file.by_type("IfcRelFillsElement"):
        assert opening.RelatedBuildingElement.is_a() in ("IfcWindow", "IfcDoor")
    assert len(file.by_type("IfcRelFillsElement")) == count["IfcWindow"] + count["IfcDoor"]
    wall = next(w for w in file.by_type("IfcWall") if w.Name == "South wall")
    psets = ifcopenshell.util.element.get_psets(wall)
    assert psets["Pset_WallCommon"]["IsExternal"] is True
    assert ifcopenshell.util.element.get_type(wall).Name == "Exterior wall 300"


def test_windows_and_doors_sit_in_holes(model: BuildingModel) -> None:
    """No wall is left where a window or door stands: its middle lies in no other element."""
    start = model.triangle_start
    corners = model.vertices[model.triangles]
    for row, element in enumerate(model.elements):
        if element.ifc_class not in ("IfcWindow", "IfcDoor"):
            continue
        own = corners[start[row] : start[row + 1]].reshape(-1, 3)
        low, high = own.min(axis=0), own.max(axis=0)
        middle = (low + high) / 2
        for other, host in enumerate(model.elements):
            if host.ifc_class == "IfcWall":
                solid = corners[start[other] : start[other + 1]] - middle
                inside = _winding(solid)
                assert abs(inside) < 0.01, (element.name, host.name)


def _winding(corners: np.ndarray) -> float:
    """Winding number of a closed surface about the zero point (van Oosterom and Strackee 1983)."""
    a, b, c = (corners[:, i] for i in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    top = np.einsum("ij,ij->i", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("ij,ij->i", p, q) for p, q in ((a, b), (b, c), (c, a)))
    bottom = la * lb * lc + ab * lc + bc * la + ca * lb
    return float(np.arctan2(top, bottom).sum() / (2 * np.pi))


def test_panes_of_the_demo_house_are_glass_and_frames_are_not(model: BuildingModel) -> None:
    pane = glass_triangles(model)
    classes = np.array([e.ifc_class for e in model.elements])[model.triangle_element]
    assert set(classes[pane]) == {"IfcWindow", "IfcDoor"}
    start = model.triangle_start
    for row, element in enumerate(model.elements):
        if element.ifc_class == "IfcWindow":
            panes = pane[start[row] : start[row + 1]].sum() / 12
            assert panes in (1, 2), element.name
    opaque = next(i for i, e in enumerate(model.elements) if e.name == "Entrance door")
    assert not pane[start[opaque] : start[opaque + 1]].any()


def test_the_demo_campaign_names_elements_that_exist_and_stands_free(model: BuildingModel) -> None:
    campaign = demo.demo_campaign(model, seed=1)
    assert Counter(e.kind for e in campaign.edits.values()) == {"remove": len(demo.MISSING), "shift": len(demo.MOVED)}
    for setup in campaign.set_ups:
        around = np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0], [0, -1.0, 0], [0, 0, -1.0]])
        assert campaign.scene.cast(setup.position, around).distance.min() > 0.5, setup.name
        assert 1.3 < campaign.scene.cast(setup.position, around[4:]).distance[0] < 1.8, setup.name


def test_the_demo_writes_a_house_a_scan_and_the_truth(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(demo, "STEP_DEG", 1.5)
    files = demo.make_demo(tmp_path, seed=3)
    truth = json.loads(files.truth.read_text())
    assert truth["points"] == files.returns > 50_000
    edits = Counter(t["edit"] for t in truth["elements"].values())
    assert edits["remove"] == len(demo.MISSING) and edits["shift"] == len(demo.MOVED)
    assert set(truth["new_hits"]) == {p.name for p in demo.NEW}
    unseen = [t["cls"] for t in truth["elements"].values() if t["witnessed"] < 0.01 and t["hits"] < 20]
    assert unseen.count("IfcFooting") == 4


def test_stations_files_come_back_as_written(tmp_path: Path) -> None:
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    plan = StationPlan(
        (PlannedStation("a", np.array([1.0, 2.0, 3.5])), PlannedStation("b", np.zeros(3), turn)), PRESETS["fine"]
    )
    write_stations(tmp_path / "stations.json", plan)
    found = read_stations(tmp_path / "stations.json")
    assert found.scanner == plan.scanner
    assert [s.name for s in found.stations] == ["a", "b"]
    np.testing.assert_array_equal(found.stations[0].position, [1.0, 2.0, 3.5])
    assert found.stations[0].rotation is None
    np.testing.assert_array_equal(found.stations[1].rotation, turn)


def test_stations_files_take_short_forms_and_units(tmp_path: Path) -> None:
    path = tmp_path / "stations.json"
    path.write_text(json.dumps({
        "scanner": {"preset": "medium", "angular_step_deg": 0.5, "sigma_range_mm": 3},
        "stations": [[1, 2, 3], {"position": [0, 0, 0], "heading_deg": 90}],
    }))
    plan = read_stations(path)
    assert plan.scanner is not None
    assert plan.scanner.angular_step == pytest.approx(np.radians(0.5)) and plan.scanner.sigma_range == 0.003
    rotation = plan.stations[1].rotation
    assert rotation is not None
    np.testing.assert_allclose(rotation @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "no JSON"),
        ("[" * 100_000, "no JSON"),
        ("[]", "no list of stations"),
        ('{"stations": []}', "no list of stations"),
        ('{"stations": [1]}', "Station 1"),
        ('{"stations": [[1, 2]]}', "no position"),
        ('{"stations": [[1, 2, NaN]]}', "no position"),
        ('{"stations": [[1, 2, 1e300]]}', "no position"),
        ('{"stations": [{"position": [0, 0, 0], "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 2]]}]}', "rotation"),
        ('{"stations": [{"position": [0, 0, 0], "heading_deg": "north"}]}', "heading_deg"),
        ('{"stations": [[0, 0, 0]], "scanner": "best"}', "preset"),
        ('{"stations": [[0, 0, 0]], "scanner": 3}', "neither"),
        ('{"stations": [[0, 0, 0]], "scanner": {"colour": 1}}', "unknown property"),
        ('{"stations": [[0, 0, 0]], "scanner": {"angular_step_deg": 1e-9}}', "angular_step_deg"),
        ('{"stations": [[0, 0, 0]], "scanner": {"range_min": 90}}', "see nothing"),
    ],
)
def test_bad_stations_files_are_refused_in_one_sentence(content: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "stations.json"
    path.write_text(content)
    with pytest.raises(BimVerifyError, match=message) as caught:
        read_stations(path)
    assert "stations.json" in str(caught.value) and "\n" not in str(caught.value)


def test_simulate_scans_from_a_stations_file(house: Path, tmp_path: Path) -> None:
    path = tmp_path / "stations.json"
    path.write_text(json.dumps({"scanner": {"angular_step_deg": 2.0}, "stations": [[3.1, 3.1, 1.5]]}))
    written = simulate(house, path, tmp_path / "scan.e57", tmp_path / "truth.json")
    truth = json.loads((tmp_path / "truth.json").read_text())
    assert written.returns == truth["points"] > 10_000
    assert {t["edit"] for t in truth["elements"].values()} == {"none"}
    without = simulate(house, path, tmp_path / "other.e57")
    assert without.truth_path is None and without.truth == {}
    assert (tmp_path / "other.e57").read_bytes() == (tmp_path / "scan.e57").read_bytes()
    edited = simulate(house, path, tmp_path / "edited.e57", tmp_path / "edited.json", remove_share=0.1, clutter=2)
    assert 8 <= Counter(t["edit"] for t in edited.truth["elements"].values())["remove"] <= 10
    assert len(edited.truth["new"]) == 2


def test_simulate_refuses_an_unknown_preset(house: Path, tmp_path: Path) -> None:
    (tmp_path / "stations.json").write_text('{"stations": [[3.1, 3.1, 1.5]]}')
    with pytest.raises(BimVerifyError, match="fast, medium, fine"):
        simulate(house, tmp_path / "stations.json", tmp_path / "scan.e57", scanner="best")
