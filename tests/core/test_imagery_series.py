"""A series of photos tied to the model by lines in some of them, free networks, and Bundler files."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from bim_verify.core.errors import BimVerifyError
from bim_verify.core.imagery.bundle import adjust_bundle
from bim_verify.core.imagery.bundle_problem import BundleProblem, Control
from bim_verify.core.imagery.bundler import read_bundler
from bim_verify.core.imagery.camera import PHOTOGRAMMETRIC
from bim_verify.core.imagery.free_net import FreeNet
from bim_verify.core.imagery.line_pose import pose_difference
from bim_verify.core.imagery.model_edges import sharp_edges
from bim_verify.core.imagery.series import adjust_series
from bim_verify.core.imagery.visible_edges import EdgeViewer
from bim_verify.core.jobs.bundle import ModelEdges
from bim_verify.core.jobs.bundle import bundle as run_bundle
from bim_verify.core.model.raycast import RayScene
from bim_verify.core.simulation.box_building import box, building_model
from bim_verify.core.simulation.photo import photograph
from bim_verify.core.simulation.photo_block import edge_lines, photograph_block, walk

from .imagery_data import bundle
from .photo_data import camera, room

LENGTH_M = 8.0


def hall() -> list:
    """A short corridor with doors and beams."""
    boxes = [
        box("floor", (0, 0, -0.2), (8, 2.4, 0)), box("ceiling", (0, 0, 2.6), (8, 2.4, 2.8)),
        box("left", (0, 2.4, 0), (8, 2.6, 2.6)), box("right", (0, -0.2, 0), (8, 0, 2.6)),
        box("west", (-0.2, 0, 0), (0, 2.4, 2.6)), box("east", (8, 0, 0), (8.2, 2.4, 2.6)),
    ]
    for k, x in enumerate((1.5, 3.5, 5.5)):
        boxes.append(box(f"door {k}", (x, 2.32, 0), (x + 0.95, 2.4, 2.1)))
        boxes.append(box(f"beam {k}", (x + 0.4, 0, 2.35), (x + 0.6, 2.4, 2.6)))
    return boxes


def test_lines_in_two_images_take_the_drift_out_of_a_series() -> None:
    model = building_model(hall())
    truth = walk(LENGTH_M, 9)
    problem, points = photograph_block(RayScene(model), truth, 60, 3, control=0, track=3, free=())
    near = np.argsort(np.linalg.norm(points - truth[0].position, axis=1))[:5]
    control = Control(near, points[near] + np.random.default_rng(1).normal(0, 0.01, (5, 3)), np.full((5, 3), 0.01))
    viewer = EdgeViewer(model, sharp_edges(model))
    rng = np.random.default_rng(2)
    lines = {k: edge_lines(viewer, truth[k], 0.3, rng) for k in (0, 8)}
    alone = adjust_bundle(replace(problem, control=control))
    tied = adjust_series(
        problem, lines, viewer, np.zeros(3), model_sigma=0.0005, position_sigma=0.1, rotation_sigma=math.radians(1.0),
        robust=False,
    )
    far = [np.linalg.norm(f.cameras[8].position - truth[8].position) for f in (alone, tied.bundle)]
    assert far[1] < 0.01 and far[1] < far[0]
    away = np.array([pose_difference(a, b) for a, b in zip(tied.bundle.cameras, truth, strict=True)])
    square = np.einsum("ci,cij,cj->c", away, np.linalg.inv(tied.bundle.pose_covariance), away)
    assert square.mean() < 20
    assert {g.name for g in tied.bundle.groups} >= {"tie points", "lines on edges"}


def test_a_block_of_cameras_at_one_place_has_no_scale() -> None:
    problem, _ = bundle(0)
    with pytest.raises(BimVerifyError, match="stand at one place"):
        FreeNet(problem.cameras[:1])


def test_a_block_without_control_keeps_the_mean_of_its_cameras() -> None:
    problem, _ = bundle(3)
    free = replace(problem, control=Control.none(), free=())
    found = adjust_bundle(free, terms=(FreeNet(free.cameras),))
    middle = [np.mean([c.position for c in cameras], axis=0) for cameras in (found.cameras, free.cameras)]
    assert np.abs(middle[0] - middle[1]).max() < 1e-4
    assert (np.einsum("pii->p", found.point_covariance) > 0).all()
    assert (found.shared_sigma >= 0).all()


def write_bundler(path: Path, problem: BundleProblem) -> None:
    """As Bundler writes a block without distortion."""
    lens = problem.interiors[0]
    rows = ["# Bundle file v0.3", f"{len(problem.cameras)} {len(problem.points)}"]
    for c in problem.cameras:
        turn = PHOTOGRAMMETRIC @ c.rotation
        rows += [f"{lens.fx!r} 0 0", *(" ".join(map(repr, r.tolist())) for r in turn)]
        rows.append(" ".join(map(repr, (-turn @ c.position).tolist())))
    o = problem.observed
    for k, point in enumerate(problem.points):
        seen = np.flatnonzero(o.point == k)
        xy = (o.pixel[seen] - [lens.cx, lens.cy]) * [1, -1]
        track = " ".join(f"{o.camera[i]} 0 {x!r} {y!r}" for i, (x, y) in zip(seen, xy.tolist(), strict=True))
        rows += [" ".join(map(repr, point.tolist())), "0 0 0", f"{len(seen)} {track}"]
    path.write_text("\n".join(rows))


def test_a_bundler_file_is_the_block_that_was_written(tmp_path: Path) -> None:
    problem, _ = bundle(1)
    write_bundler(tmp_path / "b.out", problem)
    found = read_bundler(tmp_path / "b.out", 0.5, np.array([3000.0, 2000.0]))
    assert np.abs(found.points - problem.points).max() < 1e-9
    for a, b in zip(found.cameras, problem.cameras, strict=True):
        assert np.abs(pose_difference(a, b)).max() < 1e-6
    order = np.lexsort((problem.observed.camera, problem.observed.point))
    assert np.abs(found.observed.pixel - problem.observed.pixel[order]).max() < 1e-6
    (tmp_path / "cut.out").write_text("\n".join((tmp_path / "b.out").read_text().splitlines()[:50]))
    with pytest.raises(BimVerifyError, match="damaged"):
        read_bundler(tmp_path / "cut.out", 0.5)


def test_photos_on_disk_tie_a_block_to_the_model(tmp_path: Path) -> None:
    model = room(origin=(100.0, 50.0, 0.0))
    local = [camera("a.png"), camera("b.png").moved(np.array([0.0, 0.1, 0.0]), np.array([0.5, 0.2, 0.05]))]
    for k, one in enumerate(local):
        cv2.imwrite(str(tmp_path / one.name), photograph(model, one, seed=k))
    third = replace(local[0].moved(np.zeros(3), np.array([0.3, 0.0, 0.1])), name="c.png")
    problem, _ = photograph_block(RayScene(model), [*local, third], 80, 7, control=0, free=())
    shifted = replace(
        problem, cameras=tuple(replace(c, position=c.position + model.origin) for c in problem.cameras),
        points=problem.points + model.origin,
    )
    found = run_bundle(shifted, edges=ModelEdges(
        model=model, images=[tmp_path / one.name for one in local], loa=50, position_sigma=0.05, rotation_sigma=0.01
    ))
    assert set(found.placed.values()) <= {"REFINED", "PARTLY"} and set(found.placed) == {"a.png", "b.png"}
    for one, truth in zip(found.result.cameras, local, strict=False):
        assert np.linalg.norm(one.position - model.origin - truth.position) < 0.01
