"""Photos as evidence: tie points with their own accuracy and rays, dense points without rays, and the table of both."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bim_verify.core.errors import BimVerifyError
from bim_verify.core.evidence.dense_points import DensePoints, TieAccuracy
from bim_verify.core.evidence.gather import NEAR_CUT, SensorModel, gather
from bim_verify.core.evidence.masses import level_conversion, surface_masses
from bim_verify.core.evidence.station_index import build_index
from bim_verify.core.imagery.block_points import read_block
from bim_verify.core.imagery.bundle import adjust_bundle
from bim_verify.core.imagery.bundle_project import adjusted_project
from bim_verify.core.jobs import verify
from bim_verify.core.model.on_element import ElementSurfaces
from bim_verify.core.model.raycast import RayScene
from bim_verify.core.options import VerifyOptions
from bim_verify.core.report.json_out import result_to_json
from bim_verify.core.results import VerificationResult
from bim_verify.core.scans.write_ply import write_ply
from bim_verify.core.sensing.presets import PRESETS
from bim_verify.core.simulation.photo_block import cameras_around, dense_cloud, photograph_block

from .photo_data import room

PLACES = np.array([[1.3, 1.0, 1.5], [3.6, 1.1, 1.4], [2.7, 3.4, 1.6], [2.3, 1.3, 1.4]])


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> dict[str, VerificationResult]:
    """The room without its table and with a door 8 cm off, verified by tie points, and by dense points too."""
    folder = tmp_path_factory.mktemp("photos")
    model = room()
    shift = np.zeros((len(model.elements), 3))
    names = [e.name for e in model.elements]
    shift[names.index("table")] = np.nan
    shift[names.index("door")] = (0.0, -0.08, 0.0)
    scene = RayScene(model, shift)
    cameras = cameras_around(PLACES, 7)
    problem, _ = photograph_block(scene, cameras, 90, 4)
    adjusted = adjust_bundle(problem)
    project, dense = folder / "adjusted.json", folder / "dense.ply"
    project.write_text(json.dumps(adjusted_project(problem, adjusted, "test")))
    cloud, normal = dense_cloud(scene, cameras, 60.0, 0.003, 5)
    write_ply(dense, dict(zip(("x", "y", "z", "nx", "ny", "nz"), [*cloud.T, *normal.T], strict=True)))
    options = VerifyOptions(sample_spacing=0.1)
    return {
        "ties": verify(model, [project], options),
        "dense": verify(model, [project], replace(options, dense=(str(dense),))),
        "preset": verify(model, [project], replace(options, preset="tie-points", fusion="dempster")),
    }


def statuses(result: VerificationResult) -> dict[str, str]:
    return {v.name: v.status for v in result.verdicts}


def test_verdicts_of_tie_points_and_of_dense_points(found: dict[str, VerificationResult]) -> None:
    for kind in ("ties", "dense"):
        status = statuses(found[kind])
        assert status["table"] == "ABSENT", kind
        assert status["door"] == "DEVIATING", kind
        assert all(status[name] in ("CONFIRMED", "PARTIAL") for name in ("north", "south", "west", "east")), kind
    assert statuses(found["dense"])["north"] == "CONFIRMED"


def test_dense_points_add_belief_and_never_emptiness(found: dict[str, VerificationResult]) -> None:
    ties, dense = found["ties"].summary()["coverage"], found["dense"].summary()["coverage"]
    assert dense >= ties
    assert statuses(found["dense"])["ceiling"] != "ABSENT"


def test_the_table_has_the_accuracy_of_each_element(found: dict[str, VerificationResult]) -> None:
    rows = {row.name: row for row in found["dense"].photos}
    north = rows["north"]
    assert north.tie_points > 20 and north.dense_points > 500
    assert north.tie_sigma is not None and 0.0002 < north.tie_sigma < 0.01
    assert north.dense_sigma is not None and 0.0002 < north.dense_sigma < 0.01
    assert north.tie_parameters is not None and north.dense_parameters is not None
    assert set(north.confirmed) == {40, 30, 20}
    assert result_to_json(found["dense"])["photos"][0]["confirmed"].keys() == {"40", "30", "20"}
    preset = {row.name: row for row in found["preset"].photos}["north"]
    wanted = PRESETS["tie-points"]
    assert preset.tie_parameters == (wanted.kappa, wanted.lam, wanted.c)


def test_each_point_counts_with_its_own_accuracy() -> None:
    offsets = np.array([[3.0, 0.0, 0.0]])
    query, normal = np.array([[3.015, 0.0, 0.0]]), np.array([[-1.0, 0.0, 0.0]])
    belief = []
    for sigma in (0.001, 0.02):
        index = build_index(offsets, 0.05, np.array([[sigma, 0.0, 0.0]]))
        belief.append(1.0 - np.exp(gather(index, query, normal, SensorModel(0.001, 0.0025)).log_emp[0]))
    assert belief[0] < 0.05 < 0.5 < belief[1]
    query = np.array([[3.001, 0.0, 0.0]])
    fixed = SensorModel(0.001, 0.0025, PRESETS["tie-points"])
    plain = 1.0 - np.exp(gather(build_index(offsets, 0.05), query, normal, fixed).log_emp[0])
    own = 1.0 - np.exp(gather(build_index(offsets, 0.05, np.array([[0.002, 0.0, 0.0]])), query, normal, fixed).log_emp[0])
    assert own == pytest.approx(plain * level_conversion(np.array([0.002]), 0.0025)[0], rel=1e-6)


def test_the_conversion_is_that_of_the_table() -> None:
    stated = {(0.002, 0.0005): 0.1766 / 0.85, (0.002, 0.0025): 0.7057 / 0.85, (0.0025, 0.0025): 0.5246 / 0.73}
    for (sigma, level), factor in stated.items():
        assert level_conversion(np.array([sigma]), level)[0] == pytest.approx(factor, abs=2e-3)


def test_dense_points_fuse_without_conflict_as_written_out() -> None:
    rng = np.random.default_rng(0)
    model = room()
    cloud = np.column_stack([rng.uniform(1.9, 3.1, 3000), 4.0 + rng.normal(0, 0.002, 3000), rng.uniform(2.0, 2.6, 3000)])
    dense = DensePoints(cloud, None, TieAccuracy.of(cloud[:20], np.tile(np.eye(3) * 4e-6, (20, 1, 1))), 0, 0.002, None, 1.0)
    sensor = SensorModel(0.002, 0.0075)
    north = [e.name for e in model.elements].index("north")
    query, normal = np.array([[2.5, 4.0, 2.3]]), np.array([[0.0, -1.0, 0.0]])
    one = np.zeros(1, np.int64)
    triangle = np.flatnonzero(model.triangle_element == north)[:1].astype(np.int32)
    seen = dense.sight(
        sensor, one, query, normal, np.array([north], np.int32), triangle, np.zeros((1, 3)), ElementSurfaces(model)
    )
    parameters = dense.parameters(0.002, 0.0075)
    near = cloud[np.linalg.norm((cloud - query[0])[:, [0, 2]], axis=1) < 5 * dense.spacing]
    masses = surface_masses(near - query[0], normal[0], parameters.c, parameters.lam, parameters.kappa)
    assert seen.log_masses[0, 2] == pytest.approx(np.log(masses[:, 2]).sum(), rel=1e-4)
    assert seen.log_masses[0, 0] == 0.0
    close = np.linalg.norm((cloud - query[0])[:, [0, 2]], axis=1) < NEAR_CUT * dense.spacing
    assert seen.deviation[0] == pytest.approx(4.0 - cloud[close, 1].mean(), abs=1e-9)


def test_dense_points_need_their_tie_points(tmp_path: Path) -> None:
    scan = tmp_path / "scan.ply"
    x = np.linspace(0, 1, 50)
    write_ply(scan, {"x": x, "y": x, "z": x})
    with pytest.raises(BimVerifyError, match="adjusted project"):
        verify(room(), [scan], VerifyOptions(dense=(str(scan),), origin=(1.0, 1.0, 1.5)))


def test_points_that_nothing_fixes_are_left_out(tmp_path: Path) -> None:
    cameras = cameras_around(PLACES, 6)
    problem, _ = photograph_block(RayScene(room()), cameras, 30, 6)
    path = tmp_path / "p.json"
    document = adjusted_project(problem, adjust_bundle(problem), "test")
    document["point_covariance"][0] = [1.0, 0, 0, 1.0, 0, 1.0]
    path.write_text(json.dumps(document))
    assert len(read_block(path).points) == len(problem.points) - 1
