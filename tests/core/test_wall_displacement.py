"""A panelled wall between two epochs: settlement and lateral movement of its joints, and what the command writes."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bim_verify.cli import main
from bim_verify.core.jobs.displacement import displacement
from bim_verify.core.scans.campaign import ReturnBlock, Station
from bim_verify.core.scans.write_e57 import write_e57
from bim_verify.core.simulation.box_building import ArraySource
from bim_verify.core.simulation.panel_wall import PanelMove, WallDesign, build_wall, joint_shift, uniform
from bim_verify.core.simulation.scanner import PRESETS
from bim_verify.core.simulation.wall_scan import scan_window

DESIGN = WallDesign()
POSITION = np.array([1.0, 6.0, 1.75])
SCANNER = replace(PRESETS["fine"], angular_step=float(np.radians(0.1)), sigma_range=0.001)


def scanned(moves: list[PanelMove], seed: int) -> np.ndarray:
    scene = build_wall(DESIGN, dict.fromkeys(range(DESIGN.columns), moves))
    half, top = DESIGN.panel_width / 2 + 0.35, DESIGN.rows * (DESIGN.panel_height + DESIGN.joint)
    return scan_window(scene, POSITION, np.array([-half, 0.0, 0.0]), np.array([half, 0.0, top]), SCANNER, seed=seed)


@pytest.fixture(scope="module")
def epochs() -> tuple[np.ndarray, np.ndarray, list[PanelMove]]:
    moves = uniform(DESIGN, vertical=-0.02, lateral=0.01)
    return scanned(uniform(DESIGN), 1), scanned(moves, 2), moves


def source(offsets: np.ndarray) -> ArraySource:
    return ArraySource((Station("S", POSITION),), (offsets,))


def test_joints_have_moved_as_the_panels_have(epochs) -> None:  # type: ignore[no-untyped-def]
    base, later, moves = epochs
    result = displacement(source(base), source(later))
    column = min(result.columns, key=lambda c: abs(c.low + c.high - result.columns[0].low - result.columns[-1].high))
    paired = [j for j in column.joints if j.state == "PAIRED"]
    assert len(paired) == DESIGN.rows - 1
    for joint in paired:
        row = int(np.argmin([abs(joint.position[2] - DESIGN.joint_height(r)) for r in range(DESIGN.rows - 1)]))
        lateral, vertical = joint_shift(DESIGN, moves, row)
        assert joint.lateral == pytest.approx(lateral, abs=0.002)
        assert joint.vertical == pytest.approx(vertical, abs=0.002)
        assert joint.lateral_significant and joint.vertical_significant


def test_the_same_epoch_twice_has_not_moved(epochs) -> None:  # type: ignore[no-untyped-def]
    result = displacement(source(epochs[0]), source(epochs[0]))
    paired = [j for j in result.joints if j.state == "PAIRED"]
    assert paired
    assert all(abs(j.vertical or 0.0) < 1e-9 and abs(j.lateral or 0.0) < 1e-9 for j in paired)


def test_the_command_writes_one_line_a_joint(epochs, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    paths = []
    for name, offsets in zip(("base", "later"), epochs[:2], strict=True):
        paths.append(str(tmp_path / f"{name}.e57"))
        write_e57(paths[-1], (Station("S", POSITION),), [ReturnBlock(0, offsets)])
    out = tmp_path / "displacement.csv"
    assert main(["displacement", *paths, "--out", str(out), "--quiet"]) == 0
    rows = list(csv.DictReader(out.open(encoding="utf-8")))
    moved = [float(row["Vertical_mm"]) for row in rows if row["State"] == "PAIRED" and row["Vertical_mm"]]
    assert np.median(moved) == pytest.approx(-20.0, abs=2.0)


def test_a_scan_without_a_wall_is_refused_in_a_sentence(tmp_path: Path, capsys) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / "few.xyz"
    np.savetxt(path, np.random.default_rng(0).random((50, 3)))
    out = tmp_path / "out.csv"
    assert main(["displacement", str(path), str(path), "--origin", "0,0,9", "--out", str(out), "--quiet"]) == 1
    assert not out.exists()
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
