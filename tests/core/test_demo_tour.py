"""The demo's tour: each command runs on the demo's files as it would be typed."""

from __future__ import annotations

import csv
import json
import shlex
from pathlib import Path

import ifcopenshell
import numpy as np
import pytest

from bim_verify.cli import _parser
from bim_verify.core.commands import COMMANDS
from bim_verify.core.commands.demo_tour import STOPS, tour
from bim_verify.core.imagery.block_points import read_block
from bim_verify.core.jobs import verify
from bim_verify.core.model.load import load_model
from bim_verify.core.model.write_psets import write_verified_ifc
from bim_verify.core.options import VerifyOptions
from bim_verify.core.progress import Progress
from bim_verify.core.simulation import demo
from bim_verify.core.simulation.tour_files import write_house_block

SHARED = {"threads": 0, "memory_gb": 1.0, "no_cache": True, "seed": 1}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A demo with a coarse scan."""
    target = tmp_path_factory.mktemp("demo")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(demo, "STEP_DEG", 1.0)
        files = demo.make_demo(target)
    result = verify(files.model, [files.scan], VerifyOptions(sample_spacing=0.15, cache=False))
    write_verified_ifc(files.model, result, target / "house_verified.ifc")
    return target


@pytest.fixture(scope="module")
def lines(folder: Path) -> list[str]:
    return list(tour(folder, SHARED, Progress()))


def test_each_stop_can_be_typed_as_it_is_printed(lines: list[str]) -> None:
    typed = [shlex.split(line)[1:] for line in lines if line.startswith("  bim-verify ")]
    assert len(typed) == STOPS
    assert {words[0] for words in typed} == {c.name for c in COMMANDS} - {
        "verify", "change", "demo", "info", "simulate", "decide"
    }
    for words in typed:
        values = _parser().parse_args(words)
        assert values.command.name == words[0]


def test_the_outputs_are_there(folder: Path, lines: list[str]) -> None:
    pages = (
        "quality", "plan", "update", "compare", "classify", "reconstruct", "coregister", "bundle", "facade", "displacement",
    )
    for page in pages:
        assert "</html>" in (folder / page / "index.html").read_text(encoding="utf-8")
    assert ifcopenshell.open(folder / "reconstructed.ifc").by_type("IfcWall")
    assert len(ifcopenshell.open(folder / "facade.ifc").by_type("IfcOpeningElement")) >= 6
    assert (folder / "classified.e57").stat().st_size > 100_000
    cameras = json.loads((folder / "photos" / "cameras_refined.json").read_text(encoding="ascii"))["cameras"]
    assert [c["status"] for c in cameras] == ["REFINED", "REFINED"]
    with (folder / "wall" / "displacement.csv").open(encoding="utf-8") as file:
        assert len(list(csv.DictReader(file))) == 15
    adjusted = read_block(folder / "block" / "block_adjusted.json")
    true = write_house_block(load_model(folder / "house.ifc", cache=False), folder / "again", SHARED["seed"]).points
    error = np.linalg.norm(adjusted.points - true, axis=1) / (np.sqrt(3.0) * adjusted.sigma)
    assert 0.7 < np.median(error) < 1.2 and np.quantile(error, 0.95) < 3.0
    moved = next(line for line in lines if "moved to where they stand" in line)
    assert int(moved.split()[0]) >= 5
