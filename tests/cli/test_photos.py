"""``coregister`` and ``bundle`` as users run them."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from bim_verify.core.imagery.cameras_file import camera_to_plain

from ..core.factory import make_ifc
from ..core.imagery_data import bundle
from ..core.photo_data import camera
from ..core.test_imagery_imports import as_json


def run(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "bim_verify", *arguments], cwd=cwd, capture_output=True, text=True, timeout=300
    )


def test_a_bundle_is_adjusted_and_written_whole(tmp_path: Path) -> None:
    problem, _ = bundle(0)
    (tmp_path / "project.json").write_text(json.dumps(as_json(problem)))
    done = run(
        "bundle", "project.json", "--out", "adjusted.json", "--json", "found.json", "--report", "report", "--quiet",
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    assert "tie points" in done.stdout
    found = json.loads((tmp_path / "found.json").read_text())
    assert found["summary"]["points"] == 80 and found["summary"]["control_points"] == 6
    adjusted = json.loads((tmp_path / "adjusted.json").read_text())
    assert len(adjusted["point_covariance"]) == 80 and adjusted["variance_factor"] == pytest.approx(1.0, abs=0.2)
    assert "Control points" in (tmp_path / "report" / "index.html").read_text()


def test_mistakes_are_one_sentence_and_leave_nothing(tmp_path: Path) -> None:
    make_ifc(tmp_path / "house.ifc")
    (tmp_path / "cameras.json").write_text(json.dumps({"cameras": [camera_to_plain(camera("other.png"))]}))
    (tmp_path / "room.png").write_bytes(b"no image")
    (tmp_path / "project.json").write_text("{}")
    before = sorted(p.name for p in tmp_path.iterdir())
    for arguments, sentence in (
        (("coregister", "house.ifc", "room.png", "--cameras", "cameras.json", "--out", "out.json"), "no camera for the image"),
        (("coregister", "house.ifc", "room.png", "--cameras", "nowhere.json", "--out", "out.json"), "Cannot read nowhere.json"),
        (("coregister", "house.ifc", "room.png", "--cameras", "cameras.json", "--out", "room.png"), "is an input"),
        (("bundle", "project.json", "--out", "out.json"), "holds no list of cameras"),
    ):
        done = run(*arguments, "--quiet", cwd=tmp_path)
        assert done.returncode == 1
        assert sentence in done.stderr and len(done.stderr.strip().splitlines()) == 1
        assert sorted(p.name for p in tmp_path.iterdir()) == before
