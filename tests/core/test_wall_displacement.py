"""A panelled wall between two epochs: joints measured and tested, what makes it hard, and what the command writes."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import ifcopenshell
import ifcopenshell.util.element
import numpy as np
import pytest

from bim_verify.cli import main
from bim_verify.core.jobs.displacement import DisplacementOptions, displacement
from bim_verify.core.scans.campaign import ReturnBlock, Station
from bim_verify.core.scans.write_e57 import write_e57
from bim_verify.core.simulation.box_building import ArraySource
from bim_verify.core.simulation.panel_wall import (
    COURSE_DEPTH_M,
    RIDGE_DEPTH_M,
    PanelMove,
    WallDesign,
    build_wall,
    joint_shift,
    leaning,
    uniform,
)
from bim_verify.core.simulation.scanner import PRESETS
from bim_verify.core.simulation.scene import Scene
from bim_verify.core.simulation.wall_scan import scan_window
from bim_verify.core.wall_displacement.edge_section import PROFILE_STEP_M, Samples, flank_profile
from bim_verify.core.wall_displacement.edges import choose_flank, fit_edges
from bim_verify.core.wall_displacement.epoch import spread_rows
from bim_verify.core.wall_displacement.face_lines import FacePart, fit_faces
from bim_verify.core.wall_displacement.result import Column, DisplacementResult, JointDisplacement
from bim_verify.core.wall_displacement.tables import column_moved

from .model_files import ModelFile, at
from .templates import check_templates

DESIGN = WallDesign()
POSITION = (1.0, 6.0, 1.75)
SCANNER = replace(PRESETS["fine"], angular_step=float(np.radians(0.1)), sigma_range=0.001)
STILL = uniform(DESIGN)
Moves = Sequence[PanelMove]


def wall(moves: Moves = STILL, **changes: object) -> Scene:
    """All columns moved alike."""
    return build_wall(DESIGN, dict.fromkeys(range(DESIGN.columns), moves), **changes)  # type: ignore[arg-type]


def scanned(scene: Scene, seed: int, *places: tuple[float, float, float], half: float = 0.0) -> ArraySource:
    """One station a place; the middle column and the edges of its neighbours, or ``half`` metres to both sides."""
    half, top = half or DESIGN.panel_width / 2 + 0.35, DESIGN.rows * (DESIGN.panel_height + DESIGN.joint)
    stations = tuple(Station(f"S{k}", np.array(place)) for k, place in enumerate(places or (POSITION,)))
    return ArraySource(stations, tuple(
        scan_window(scene, s.position, np.array([-half, -0.2, 0.0]), np.array([half, 0.2, top]), SCANNER, seed=seed + k)
        for k, s in enumerate(stations)
    ))


def middle_column(result: DisplacementResult) -> Column:
    return min(result.columns, key=lambda c: abs(c.joints[0].position[0]) if c.joints else np.inf)


def row_of(joint: JointDisplacement) -> int:
    return int(np.argmin([abs(joint.height - DESIGN.joint_height(r)) for r in range(DESIGN.rows - 1)]))


def assert_moved_as(column: Column, moves: Moves, *, count: int = DESIGN.rows - 1, within: float = 0.002) -> None:
    """The joints say what the panels did, to ``within`` metres."""
    assert len(column.paired) == count
    for joint in column.paired:
        lateral, vertical = joint_shift(DESIGN, moves, row_of(joint))
        assert joint.lateral == pytest.approx(lateral, abs=within)
        assert joint.vertical == pytest.approx(vertical, abs=within)


@pytest.fixture(scope="module")
def base() -> ArraySource:
    return scanned(wall(), 1)


@pytest.fixture(scope="module")
def moved() -> ArraySource:
    return scanned(wall(uniform(DESIGN, vertical=-0.02, lateral=0.01)), 20)


@pytest.fixture(scope="module")
def result(base: ArraySource, moved: ArraySource) -> DisplacementResult:
    return displacement(base, moved)


def test_joints_have_moved_as_the_panels_have(result: DisplacementResult) -> None:
    column = middle_column(result)
    assert_moved_as(column, uniform(DESIGN, vertical=-0.02, lateral=0.01))
    assert all(j.lateral_significant and j.vertical_significant for j in column.paired)
    assert column_moved(column)


def test_panels_that_step_out_of_one_another_keep_their_edges() -> None:
    sharp = replace(DESIGN, chamfer=0.0)
    moves = [PanelMove(0.02 * k / DESIGN.rows * (1 + k / DESIGN.rows), -0.005 * k) for k in range(DESIGN.rows)]
    scenes = [build_wall(sharp, dict.fromkeys(range(sharp.columns), m)) for m in (STILL, moves)]
    column = middle_column(displacement(scanned(scenes[0], 7), scanned(scenes[1], 8)))
    assert_moved_as(column, moves, within=0.003)
    for joint in column.paired:
        row = row_of(joint)
        opening = moves[row + 1].vertical - moves[row].vertical
        assert joint.opening is not None
        assert joint.opening_sigma is not None
        assert joint.opening_sigma < 0.004
        assert abs(joint.opening - opening) < 3.0 * joint.opening_sigma


def test_a_wall_that_settled_by_more_than_half_a_panel_is_not_told_without_a_warning() -> None:
    def joint(state: Literal["PAIRED", "NEW", "MISSING"], height: float) -> JointDisplacement:
        return JointDisplacement(0, state, 0.0, (0.0, 0.0, height), height)

    joints = (joint("NEW", 0.2), joint("PAIRED", 0.5), joint("PAIRED", 1.0), joint("MISSING", 1.5))
    column = Column(0, 0.0, 1.5, joints, *(np.zeros(0) for _ in range(3)))
    assert column.may_be_a_panel_off
    assert not replace(column, joints=joints[1:]).may_be_a_panel_off


def test_between_the_joints_the_face_has_moved_by_as_much(result: DisplacementResult) -> None:
    field = result.field
    assert len(field.distance) > 300
    assert np.median(field.distance) == pytest.approx(0.01, abs=0.0005)
    assert np.quantile(np.abs(field.distance - 0.01), 0.95) < 0.003
    assert field.significant.mean() > 0.95
    assert np.allclose(np.linalg.norm(field.normals, axis=1), 1.0)
    assert set(field.column) <= {c.number for c in result.columns}


def test_the_same_epoch_twice_has_not_moved(base: ArraySource) -> None:
    result = displacement(base, base)
    paired = [j for j in result.joints if j.state == "PAIRED"]
    assert paired
    assert all(abs(j.vertical or 0.0) < 1e-9 and abs(j.lateral or 0.0) < 1e-9 for j in paired)
    assert not result.field.significant.any()


def test_noise_alone_is_not_significant(base: ArraySource) -> None:
    result = displacement(base, scanned(wall(), 90))
    assert not any(column_moved(c) for c in result.columns)
    assert result.field.significant.mean() < 0.05


def test_a_registration_that_is_not_better_hides_the_movement(base: ArraySource, moved: ArraySource) -> None:
    result = displacement(base, moved, DisplacementOptions(registration_sigma=0.05))
    assert not any(j.vertical_significant or j.lateral_significant for j in result.joints)
    assert not any(column_moved(c) for c in result.columns)


def test_new_panels_bring_new_joints_and_the_old_ones_keep_their_partners() -> None:
    three = dict.fromkeys(range(DESIGN.columns), 3)
    moves = uniform(DESIGN, vertical=-0.012)
    result = displacement(scanned(wall(present=three), 1), scanned(wall(moves), 30))
    column = middle_column(result)
    assert_moved_as(column, moves, count=2)
    new = [j for j in column.joints if j.state == "NEW"]
    assert [row_of(j) for j in new] == [2]
    assert all(j.vertical is None and j.vertical_significant is None for j in new)


def test_a_filled_joint_is_missing_and_no_other_takes_its_place(base: ArraySource) -> None:
    moves = uniform(DESIGN, lateral=0.015)
    result = displacement(base, scanned(wall(moves, filled=[(1, 1)]), 40))
    column = middle_column(result)
    assert_moved_as(column, moves, count=2)
    assert [row_of(j) for j in column.joints if j.state == "MISSING"] == [1]


def test_a_wall_that_bends_is_followed_panel_by_panel(base: ArraySource) -> None:
    moves = leaning(DESIGN, np.radians([0.8, 0.4, -0.4, -0.8]).tolist())
    result = displacement(base, scanned(wall(moves), 50))
    column = middle_column(result)
    assert_moved_as(column, moves)
    assert column.bow is not None
    assert column.bow > 0.015


def test_a_wall_curved_in_plan_has_its_columns_measured_in_their_own_direction() -> None:
    radius = 12.0

    def curved(moves: Moves) -> Scene:
        scene = wall(moves)
        x, y, z = (scene.corners[..., k] for k in range(3))
        reach = radius - y  # the wall stands on the inside of a circle, the scanner within it
        bent = np.stack([reach * np.sin(x / radius), radius - reach * np.cos(x / radius), z], axis=-1)
        kept = np.array([not name.startswith("ground") for name in scene.names])[scene.owner]
        return Scene(bent[kept], scene.owner[kept], scene.names, reflectance=scene.reflectance)

    moves = uniform(DESIGN, vertical=-0.01, lateral=0.012)
    result = displacement(scanned(curved(STILL), 1, half=2.2), scanned(curved(moves), 60, half=2.2))
    assert len(result.columns) == 3
    for column in result.columns:
        assert_moved_as(column, moves)


def test_a_joint_between_the_scan_lines_of_one_epoch_still_parts_the_columns() -> None:
    coarse = replace(SCANNER, angular_step=float(np.radians(0.12)))
    place = np.array([15.0, 26.0, 1.75])

    plain = replace(DESIGN, relief="plain")

    def seen(moves: Moves, seed: int) -> ArraySource:
        low, high = np.array([-1.1, 0.0, 0.0]), np.array([1.1, 0.0, 6.1])
        scene = build_wall(plain, dict.fromkeys(range(plain.columns), moves))
        return ArraySource((Station("S", place),), (scan_window(scene, place, low, high, coarse, seed=seed),))

    moves = uniform(DESIGN, lateral=0.1)
    base = seen(STILL, 1)
    for seed in (10, 20, 30):
        assert_moved_as(middle_column(displacement(base, seen(moves, seed))), moves, within=0.006)


def test_epochs_from_other_stations_agree(base: ArraySource) -> None:
    moves = uniform(DESIGN, vertical=-0.015)
    later = scanned(wall(moves), 70, (-2.0, 5.0, 1.6), (2.5, 7.0, 2.1))
    assert_moved_as(middle_column(displacement(base, later)), moves)


def test_strays_and_a_thing_before_the_wall_change_nothing(base: ArraySource, moved: ArraySource) -> None:
    random = np.random.default_rng(5)
    strays = random.uniform([-1.2, -0.4, 0.0], [1.2, 1.5, 6.0], (3000, 3))
    thing = random.uniform([-0.5, 0.25, 0.0], [0.0, 0.35, 2.0], (20_000, 3))
    offsets = np.concatenate([moved.offsets[0], strays - POSITION, thing - POSITION])
    result = displacement(base, ArraySource(moved.stations, (offsets,)))
    assert_moved_as(middle_column(result), uniform(DESIGN, vertical=-0.02, lateral=0.01))


def test_the_order_of_the_returns_does_not_matter(base: ArraySource, moved: ArraySource, result: DisplacementResult) -> None:
    order = np.random.default_rng(0).permutation(len(moved.offsets[0]))
    other = displacement(base, ArraySource(moved.stations, (moved.offsets[0][order],)))
    for first, second in zip(result.joints, other.joints, strict=True):
        assert second.state == first.state
        assert second.lateral == pytest.approx(first.lateral, abs=2e-4)
        assert second.vertical == pytest.approx(first.vertical, abs=1e-3)


def flank_samples(edge: float, count: int, random: np.random.Generator) -> Samples:
    """Returns of a face with a chamfer of 20 mm at 45 degrees from ``edge`` on, a gap behind it, and relief of 8 mm."""
    v = random.uniform(-0.08, edge + 0.03, count)
    depth = np.clip(v - edge, 0.0, None)
    depth[depth == 0.0] = 0.008 * (random.random((depth == 0.0).sum()) < 0.3)
    gap = v > edge + 0.02
    depth[gap] = random.uniform(0.02, 0.14, gap.sum())
    noisy = depth + random.normal(0.0, 0.001, count)
    return Samples(v, noisy, random.random(count), 0.0, 0.0, 0.001, 0.011, 0.3, 0.008, 0.001, 0.14)


@pytest.mark.parametrize("count", [25, 400])
def test_few_returns_fix_the_edge_of_a_joint_and_sigma_says_how_well_it_moved(count: int) -> None:
    random = np.random.default_rng(1)
    places = [0.001 * (k % 7) - 0.02 for k in range(160)]
    samples = [flank_samples(edge, count, random) for edge in places]
    flanks = choose_flank(samples[:40], [None] * 40, -0.08, 0.04)[0]
    assert flanks.best.slope == pytest.approx(1.0, abs=0.26)
    assert flanks.best.depth == pytest.approx(0.02, abs=0.004)
    assert flanks.probability.sum() == pytest.approx(1.0)
    edges = fit_edges(samples, flanks, -0.08, 0.04)
    error = np.abs(np.array([e.at for e in edges]) - places)
    assert np.sqrt(np.mean(error**2)) < 0.0006
    # where no return lies between 6 mm below an edge and 21 mm above it, it says so
    assert np.all(error < np.maximum(0.003, [2.0 * e.sigma for e in edges]))
    # a movement is the difference of two edges, of which what they have in common drops out
    moved = np.diff([e.at for e in edges])[::2] - np.diff(places)[::2]
    sigma = np.hypot([e.sigma for e in edges[::2]], [e.sigma for e in edges[1::2]])
    assert np.sqrt(np.mean(moved**2)) < 0.03 / count + 0.0004
    assert np.mean(np.abs(moved) < 1.96 * sigma) > 0.88


@pytest.mark.parametrize("share", [0.3, 0.5, 0.65])
def test_grooves_over_half_of_the_face_leave_its_movement_certain(share: float) -> None:
    random = np.random.default_rng(2)
    shifts = np.array([0.0, 0.003, -0.002, 0.008] * 3)
    parts = []
    for shift in shifts:
        x, z = random.uniform(0, 1.4, 400), random.uniform(0.06, 0.7, 400)
        y = shift + 0.02 * z - 0.008 * (x / 0.14 % 1.0 < share) + random.normal(0.0, 0.001, 400)
        parts.append(FacePart(x, y, z, 0.0))
    lines = fit_faces(parts, 0.001)
    assert all(line is not None for line in lines)
    at = np.array([line.at for line in lines if line is not None])
    sigma = np.array([line.sigma for line in lines if line is not None])
    error = at - shifts - np.mean(at - shifts)
    assert np.abs(error).max() < 0.0005
    assert np.mean(np.abs(error) < 1.96 * sigma) > 0.8
    # the front of the relief is the zero of all
    assert np.mean(at - shifts) == pytest.approx(0.0, abs=0.0006)


def test_a_beam_on_a_corner_reports_a_depth_between() -> None:
    sharp = flank_profile(0.0, 0.01, 0.005, 0.0, 0.14)
    assert np.all(np.diff(sharp) >= 0)
    assert sharp[len(sharp) // 2] == pytest.approx(0.07, abs=0.02)
    # the side of a panel that rays graze sends back little: the beam reports the face for longer
    seen = flank_profile(0.0, 0.01, 0.005, -0.05, 0.14)
    assert seen[len(seen) // 2] < 0.5 * sharp[len(sharp) // 2]
    chamfer = flank_profile(1.0, 0.02, 0.0, 0.0, 0.14)
    assert chamfer[10] == pytest.approx(10 * PROFILE_STEP_M)


@pytest.mark.parametrize("relief", ["ridges", "bricks"])
def test_the_simulated_face_has_its_relief(relief: Literal["ridges", "bricks"]) -> None:
    deep = {"ridges": RIDGE_DEPTH_M, "bricks": COURSE_DEPTH_M}[relief]
    for chamfer in (0.0, 0.02):
        y = build_wall(WallDesign(relief=relief, chamfer=chamfer), surroundings=False).corners[..., 1]
        assert np.isclose(y, -deep).sum() > 100


def test_thinning_has_no_period_and_takes_what_was_asked() -> None:
    rows = spread_rows(100_000, 12_500)
    assert len(rows) == pytest.approx(12_500, rel=0.01)
    assert np.bincount(rows % 8, minlength=8).min() > 1400
    assert (np.diff(rows) < 20).all()
    assert len(spread_rows(10, 50)) == 10


def write_epochs(folder: Path, base: ArraySource, later: ArraySource) -> list[str]:
    paths = []
    for name, source in (("base", base), ("later", later)):
        paths.append(str(folder / f"{name}.e57"))
        write_e57(paths[-1], source.stations, [ReturnBlock(k, o) for k, o in enumerate(source.offsets)])
    return paths


@pytest.fixture(scope="module")
def files(base: ArraySource, moved: ArraySource, tmp_path_factory: pytest.TempPathFactory) -> tuple[list[str], str, str, str]:
    """Two scans, a model in millimetres, and the GlobalIds of the wall and of a slab elsewhere in it."""
    folder = tmp_path_factory.mktemp("wall")
    made = ModelFile()
    wall = made.product("IfcWall", "Retaining wall", made.box(4.6, 0.14, 6.1), at(-2.3, -0.14, 0.0))
    slab = made.product("IfcSlab", "Far away", made.box(2.0, 2.0, 0.2), at(30.0, 0.0, 0.0))
    return write_epochs(folder, base, moved), str(made.write(folder / "site.ifc")), wall.GlobalId, slab.GlobalId


def test_the_command_writes_table_json_and_report(files: tuple[list[str], str, str, str], tmp_path: Path) -> None:
    out, report, data = (tmp_path / n for n in ("displacement.csv", "report", "found.json"))
    code = main(["displacement", *files[0], "--out", str(out), "--report", str(report), "--json", str(data), "--quiet"])
    assert code == 0
    rows = list(csv.DictReader(out.open(encoding="utf-8")))
    settled = [float(row["Vertical_mm"]) for row in rows if row["State"] == "PAIRED" and row["Vertical_mm"]]
    assert np.median(settled) == pytest.approx(-20.0, abs=2.0)
    found = json.loads(data.read_text(encoding="utf-8"))
    assert [joint["State"] for joint in found["joints"]] == [row["State"] for row in rows]
    assert len(found["field"]["distance_mm"]) == len(found["field"]["position_m"])
    page = (report / "index.html").read_text(encoding="utf-8")
    assert page.count("<polyline") == len(found["columns"])


def test_the_wall_in_the_model_gets_a_property_set_in_the_files_units(
    files: tuple[list[str], str, str, str], tmp_path: Path
) -> None:
    paths, model, guid, _ = files
    out, ifc = tmp_path / "d.csv", tmp_path / "moved.ifc"
    before = Path(model).read_bytes()
    wanted = ["--model", model, "--element", guid, "--out-ifc", str(ifc)]
    assert main(["displacement", *paths, "--out", str(out), *wanted, "--quiet"]) == 0
    file = ifcopenshell.open(str(ifc))
    pset = ifcopenshell.util.element.get_psets(file.by_guid(guid))["BimVerify_Displacement"]
    check_templates(file, "BimVerify_Displacement")
    assert pset["VerticalMean"] == pytest.approx(-20.0, abs=2.0)
    assert pset["LateralMean"] == pytest.approx(10.0, abs=1.0)
    assert pset["Significant"] is True
    assert pset["BaseSource"] == "base.e57"
    assert Path(model).read_bytes() == before


@pytest.mark.parametrize("case", ["another element", "no such element", "half the options"])
def test_a_wall_that_is_not_the_element_is_refused_and_nothing_written(
    files: tuple[list[str], str, str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str], case: str
) -> None:
    paths, model, _, slab = files
    out, ifc = tmp_path / "d.csv", tmp_path / "moved.ifc"
    guid = {"another element": slab, "no such element": "0000000000000000000000"}.get(case, "")
    wanted = ["--model", model, *(["--element", guid] if guid else []), "--out-ifc", str(ifc)]
    assert main(["displacement", *paths, "--out", str(out), *wanted, "--quiet"]) == 1
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
    assert not out.exists()
    assert not ifc.exists()


def test_a_point_far_from_every_wall_is_refused(
    files: tuple[list[str], str, str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "d.csv"
    assert main(["displacement", *files[0], "--out", str(out), "--near=200,0,1", "--quiet"]) == 1
    (said,) = capsys.readouterr().err.strip().splitlines()
    assert " m from it" in said
    assert not out.exists()


def test_a_scan_without_a_wall_is_refused_in_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "few.xyz"
    np.savetxt(path, np.random.default_rng(0).random((50, 3)))
    out = tmp_path / "out.csv"
    assert main(["displacement", str(path), str(path), "--origin", "0,0,9", "--out", str(out), "--quiet"]) == 1
    assert not out.exists()
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_a_wall_too_narrow_for_a_column_is_refused_not_told_to_stand_still(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    x, z = np.meshgrid(np.arange(0.0, 0.25, 0.01), np.arange(0.0, 8.0, 0.01))
    path, out = tmp_path / "narrow.xyz", tmp_path / "out.csv"
    np.savetxt(path, np.column_stack([x.ravel(), np.zeros(x.size), z.ravel()]))
    assert main(["displacement", str(path), str(path), "--origin", "0,9,2", "--out", str(out), "--quiet"]) == 1
    (said,) = capsys.readouterr().err.strip().splitlines()
    assert "not determined" in said
    assert not out.exists()


def test_a_place_that_is_no_number_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out.csv"
    assert main(["displacement", "a.xyz", "b.xyz", "--near", "nan,0,0", "--out", str(out), "--quiet"]) == 1
    assert "--near" in capsys.readouterr().err
