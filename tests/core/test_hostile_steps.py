"""Hostile names through the steps that follow a verification or need no model: update, reconstruct, displacement, photos."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import ifcopenshell
import ifcopenshell.util.element
import numpy as np
import pytest
from PIL import Image

from bim_verify.cli import main
from bim_verify.core.imagery.cameras_file import camera_to_plain
from bim_verify.core.model.load import load_model
from bim_verify.core.scans.campaign import ReturnBlock
from bim_verify.core.scans.write_e57 import write_e57
from bim_verify.core.simulation.photo import photograph
from bim_verify.core.update.update import PSET_NAME

from .factory import make_ifc
from .model_files import ModelFile, at
from .photo_data import ROOM, camera
from .test_hostile_outputs import NAMES, harmless
from .test_update import SHIFT, found_displaced
from .test_wall_displacement import DESIGN, scanned, uniform, wall

HOSTILE = "<img src=x onerror=alert(1)> ..&amp;=1"
STATIONS = ("<script>alert(1)</script>", "../../x")


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder that commands run in; what a name could reach lies above it."""
    folder = tmp_path / "a" / "work"
    folder.mkdir(parents=True)
    monkeypatch.chdir(folder)
    return folder


def only(folder: Path, *names: str) -> None:
    """Nothing but these was made in the folder, nor in the two above it."""
    assert {p.name for p in folder.iterdir()} == set(names)
    assert [p.name for p in folder.parent.iterdir()] == [folder.name]
    assert "a" in {p.name for p in folder.parent.parent.iterdir()}
    assert not (folder.parent.parent / "x").exists()


def test_update_moves_elements_whatever_they_are_called(here: Path, tmp_path: Path) -> None:
    file = ifcopenshell.open(str(make_ifc(tmp_path / "h.ifc", names=NAMES)))
    for element in file.by_type("IfcElement"):
        found_displaced(file, element, SHIFT)
    file.write(str(tmp_path / "v.ifc"))
    assert main(["update", str(tmp_path / "v.ifc"), "--out", "u.ifc", "--json", "u.json", "--quiet"]) == 0
    only(here, "u.ifc", "u.json")
    written = ifcopenshell.open("u.ifc")
    assert {e.Name for e in written.by_type("IfcElement") if PSET_NAME in ifcopenshell.util.element.get_psets(e)} == set(NAMES)
    json.loads(Path("u.json").read_text())


def test_reconstruct_of_a_scan_with_hostile_names(here: Path, tmp_path: Path) -> None:
    scan, reference = tmp_path / f"{HOSTILE}.xyz", make_ifc(tmp_path / f"{HOSTILE}.ifc", names=NAMES)
    sides = [(0, 0.0), (0, 5.0), (1, 0.0), (1, 4.0), (2, 0.0), (2, 2.6)]
    random = np.random.default_rng(0)
    points = random.uniform(0.0, [5.0, 4.0, 2.6], (len(sides), 8_000, 3))
    for row, (axis, value) in enumerate(sides):
        points[row, :, axis] = value
    np.savetxt(scan, points.reshape(-1, 3) + random.normal(0, 0.001, (points.shape[0] * 8_000, 3)), fmt="%.5f")
    arguments = ["reconstruct", str(scan), "--origin", "2,2,1.5", "--compare", str(reference), "--out", "r.ifc"]
    assert main([*arguments, "--report", "r", "--json", "r.json", "--quiet"]) == 0
    only(here, "r.ifc", "r", "r.json")
    harmless(Path("r/index.html").read_text(encoding="utf-8"))
    assert len(ifcopenshell.open("r.ifc").by_type("IfcWall")) == 4


def test_displacement_of_scans_with_hostile_names(here: Path, tmp_path: Path) -> None:
    made = ModelFile()
    element = made.product("IfcWall", "../../x", made.box(4.6, 0.14, 6.1), at(-2.3, -0.14, 0.0))
    model, scans = made.write(tmp_path / "w.ifc"), []
    for name, scene, seed in (("1", wall(), 1), ("2", wall(uniform(DESIGN, vertical=-0.02)), 20)):
        source = scanned(scene, seed)
        stations = tuple(replace(s, name=n) for s, n in zip(source.stations, STATIONS, strict=False))
        scans.append(str(tmp_path / f"{HOSTILE}{name}.e57"))
        write_e57(scans[-1], stations, [ReturnBlock(k, o) for k, o in enumerate(source.offsets)])
    wanted = ["--model", str(model), "--element", element.GlobalId, "--out-ifc", "m.ifc", "--report", "r", "--json", "d.json"]
    assert main(["displacement", *scans, "--out", "d.csv", *wanted, "--quiet"]) == 0
    only(here, "d.csv", "m.ifc", "r", "d.json")
    assert {p.name for p in Path("r").iterdir()} == {"index.html"}
    harmless(Path("r/index.html").read_text(encoding="utf-8"))


def test_photos_with_hostile_names(here: Path, tmp_path: Path) -> None:
    made, photo = ModelFile(), tmp_path / f"{HOSTILE}.png"
    for row, (_, low, high) in enumerate(ROOM):
        size = [b - a for a, b in zip(low, high, strict=True)]
        made.product("IfcBuildingElementProxy", NAMES[row % len(NAMES)], made.box(*size), at(*low))
    house = made.write(tmp_path / "h.ifc")
    model, taken = load_model(house, cache=False, threads=1), camera(photo.name)
    Image.fromarray(photograph(model, replace(taken, position=taken.position - model.origin))).save(photo)
    (tmp_path / "cameras.json").write_text(json.dumps({"cameras": [camera_to_plain(taken)]}))
    arguments = ["coregister", str(house), str(photo), "--cameras", str(tmp_path / "cameras.json"), "--out", "c.json"]
    assert main([*arguments, "--report", "r", "--json", "f.json", "--quiet"]) == 0
    only(here, "c.json", "r", "f.json")
    assert {p.name for p in Path("r").iterdir()} == {"index.html"}
    harmless(Path("r/index.html").read_text(encoding="utf-8"))
