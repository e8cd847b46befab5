"""``bim-verify facade``: a photo to files, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import ifcopenshell
import numpy as np
import pytest

from bim_verify.cli import main

from ..core.facade_data import photo_of


def test_a_photo_becomes_a_model_a_report_and_data(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    photo = photo_of(tmp_path, 3)
    out, data = tmp_path / "mockup.ifc", tmp_path / "found.json"
    corners = ",".join(f"{v:.1f}" for v in photo.corners.ravel())
    code = main([
        "facade", str(photo.path), "--out", str(out), "--corners", corners, "--width", f"{photo.plan.width}",
        "--report", str(tmp_path / "report"), "--json", str(data), "--quiet",
    ])  # fmt: skip
    assert code == 0
    file = ifcopenshell.open(str(out))
    assert file.header.file_name.name == "mockup.ifc"
    found = json.loads(data.read_text())["facades"][0]
    assert len(found["elements"]) == len(file.by_type("IfcWindow")) + len(file.by_type("IfcDoor"))
    assert found["grammar"][0].startswith("Facade -> split(z)")
    assert found["grammar_error_m"] <= 0.1
    assert len(found["levels_m"]) == len(photo.plan.levels)
    page = (tmp_path / "report" / "index.html").read_text()
    assert page.count("data:image/jpeg;base64,") == 2
    assert "http" not in page.split("</style>")[1]
    assert "Model:" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--corners", "1,2,3"], "four corners"),
        (["--corners", "0,0,10,0,20,0,30,0"], "convex"),
        (["--corners", "0,0,9,0,9,9,0,9"], "smaller than"),
        (["--width", "-3"], "--width"),
        (["--threads", "-1"], "--threads"),
        (["--memory-gb", "0"], "--memory-gb"),
        (["--memory-gb", "0.5"], "larger --memory-gb"),
        (["--crs", "EPSG:25832"], "--footprint"),
        (["--footprint", "0,0 1,1"], "three corners"),
        (["--footprint", "nothing.geojson"], "nothing.geojson"),
    ],
)
def test_bad_input_is_one_sentence(arguments: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    photo = photo_of(tmp_path, 3, size=400)
    before = sorted(tmp_path.iterdir())
    assert main(["facade", str(photo.path), "--out", str(tmp_path / "mockup.ifc"), "--quiet", *arguments]) == 1
    error = capsys.readouterr().err.strip()
    assert said in error
    assert "\n" not in error
    assert sorted(tmp_path.iterdir()) == before


def test_no_image_and_several_without_a_footprint(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = tmp_path / "text.jpg"
    text.write_text("no image")
    out = str(tmp_path / "mockup.ifc")
    assert main(["facade", str(text), "--out", out, "--quiet"]) == 1
    assert "as an image" in capsys.readouterr().err
    assert main(["facade", str(text), str(text), "--out", out, "--quiet"]) == 1
    assert "--footprint" in capsys.readouterr().err
    assert not Path(out).exists()


def test_two_facades_stand_on_their_footprint(tmp_path: Path) -> None:
    photos = [photo_of(tmp_path, seed, size=600) for seed in (3, 9)]
    w = [p.plan.width for p in photos]
    out = tmp_path / "house.ifc"
    corners = [",".join(f"{v:.1f}" for v in p.corners.ravel()) for p in photos]
    code = main([
        "facade", *(str(p.path) for p in photos), "--out", str(out), "--corners", *corners, "--quiet", "--threads", "1",
        "--footprint", f"0,0 {w[0]},0 {w[0]},{w[1]} 0,{w[1]}",
    ])  # fmt: skip
    assert code == 0
    file = ifcopenshell.open(str(out))
    hosts = {v.RelatingBuildingElement.Name for v in file.by_type("IfcRelVoidsElement")}
    assert hosts == {"Wall 1", "Wall 2"}
    assert len({w.Name for w in file.by_type("IfcWall")}) == 4
    assert np.isclose(file.by_type("IfcBuildingStorey")[0].Elevation, 0.0)
