"""A dense cloud against a scan by M3C2, on the command line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bim_verify.cli import main
from bim_verify.core.scans.write_ply import write_ply

SHIFT_M = 0.008


def wall(path: Path, shift: float, count: int, seed: int) -> Path:
    """A wall of 2 x 1.5 m at y = 3 m + ``shift`` with 2 mm of noise."""
    rng = np.random.default_rng(seed)
    write_ply(path, {
        "x": rng.uniform(0, 2, count), "y": 3.0 + shift + rng.normal(0, 0.002, count), "z": rng.uniform(0, 1.5, count)
    })
    return path


def test_distances_and_levels_are_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    base, later = wall(tmp_path / "a.ply", 0.0, 40_000, 1), wall(tmp_path / "b.ply", SHIFT_M, 30_000, 2)
    out = tmp_path / "m3c2.csv"
    arguments = ["displacement", str(base), str(later), "--out", str(out), "--m3c2", "--origin", "1,0,1", "--quiet"]
    assert main(arguments) == 0
    assert "core points lie in both clouds" in capsys.readouterr().out
    rows = np.genfromtxt(out, delimiter=",", names=True)
    assert len(rows) > 500
    assert np.median(rows["distance_mm"]) == pytest.approx(-1000 * SHIFT_M, abs=0.2)  # away from the scanner
    assert np.median(rows["level_of_detection_mm"]) == pytest.approx(2.8, abs=0.7)
    assert rows["significant"].mean() > 0.95
    assert main([*arguments, "--near", "1,3,1"]) == 1
    assert "--near belongs to a panelled wall" in capsys.readouterr().err
