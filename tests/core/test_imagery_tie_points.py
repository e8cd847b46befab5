"""Tie points of a bundle as evidence: walls that were photographed are confirmed, one that is not there is not."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from bim_verify.core.change.results import CONFIRMED, DISAPPEARED, NEW, UNKNOWN
from bim_verify.core.commands.verify import summary_lines
from bim_verify.core.evidence.photo_campaign import photo_campaign
from bim_verify.core.imagery.cameras_file import camera_to_plain
from bim_verify.core.jobs import change, quality, reconstruct, verify
from bim_verify.core.model.raycast import RayScene
from bim_verify.core.options import ChangeOptions, VerifyOptions
from bim_verify.core.quality import assess
from bim_verify.core.quality.options import QualityOptions
from bim_verify.core.quality.prediction import NOISES_M, SPACINGS_M, ErrorTable
from bim_verify.core.reconstruction import reconstruct as reconstruction
from bim_verify.core.report.html import render_page
from bim_verify.core.scans.open import open_scans
from bim_verify.core.simulation.photo import looking

from .photo_data import camera, room

SIGMA_M = 0.004


def project(path: Path, missing: str = "", place_sigma: float = 0.002) -> Path:
    """Tie points on what four cameras see of the room without one element, seen by at least two of them; where the cameras
    stand is known to ``place_sigma`` metres."""
    model = room()
    shift = np.zeros((len(model.elements), 3))
    shift[[e.name == missing for e in model.elements]] = np.nan
    scene, rng = RayScene(model, shift), np.random.default_rng(1)
    cameras = [
        camera(f"{k}.jpg").moved(np.zeros(3), np.array([x, y, 0.0]))
        for k, (x, y) in enumerate(((0.0, 0.0), (0.4, 0.1), (0.1, 0.5), (0.6, 0.3)))
    ]
    cameras = [type(c)(c.name, c.interior, looking(0.9 + 0.05 * k, -0.05, 0.0), c.position) for k, c in enumerate(cameras)]
    ray = np.column_stack([rng.uniform(-0.6, 0.6, 6000), rng.uniform(-0.45, 0.45, 6000), np.ones(6000)]) @ cameras[0].rotation
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    reach, triangle = scene.first_hit(np.repeat(cameras[0].position[None], len(ray), 0), ray)
    points = cameras[0].position + ray[triangle >= 0] * reach[triangle >= 0, None]
    observations = []
    for k, one in enumerate(cameras):
        to = points - one.position
        far = np.linalg.norm(to, axis=1)
        first, _ = scene.first_hit(np.repeat(one.position[None], len(to), 0), to / far[:, None])
        pixel = one.interior.distort(one.project(points))
        inside = ((pixel > 0) & (pixel < [639, 479])).all(axis=1) & (np.abs(first - far) < 0.01)
        observations += [[k, int(i), *map(float, pixel[i])] for i in np.flatnonzero(inside)]
    shaken = points + rng.normal(0, SIGMA_M, points.shape)
    path.write_text(json.dumps({
        "format": "bim_verify.bundle", "cameras": [camera_to_plain(c) for c in cameras], "points": shaken.tolist(),
        "observations": observations, "sigma_px": 0.05, "position_sigma_m": place_sigma,
    }))
    return path


def test_a_bundle_is_opened_like_a_scan_with_a_station_per_camera(tmp_path: Path) -> None:
    source = open_scans([project(tmp_path / "adjusted.json")])
    assert len(source.stations) == 4 and all(s.known for s in source.stations)
    block = next(source.blocks())
    assert np.linalg.norm(block.offsets, axis=1).max() < 6.5


def test_tie_points_confirm_what_they_lie_on_and_not_what_is_gone(tmp_path: Path) -> None:
    options = VerifyOptions(loa=20, sigma=SIGMA_M, sample_spacing=0.1)
    verdicts = {}
    for missing in ("", "table"):
        found = verify(room(), [project(tmp_path / "adjusted.json", missing)], options)
        verdicts[missing] = {e.name: v.status for e, v in zip(found.model.elements, found.verdicts, strict=True)}
    assert verdicts[""]["north"] == "CONFIRMED" and verdicts[""]["table"] in ("CONFIRMED", "PARTIAL")
    assert verdicts["table"]["table"] == "ABSENT" and verdicts["table"]["north"] == "CONFIRMED"
    assert verdicts[""]["west"] == "NOTOBSERVED"


def test_a_block_without_control_says_so_and_its_place_counts(tmp_path: Path) -> None:
    options = VerifyOptions(loa=20, sigma=SIGMA_M, sample_spacing=0.1)
    found = verify(room(), [project(tmp_path / "free.json", place_sigma=0.15)], options)
    assert any("no control points and was adjusted freely" in text for text in found.warnings)
    assert {s.registration_sigma for s in found.stations} == {0.15}
    statuses = {v.status for v in found.verdicts}
    assert statuses <= {"PARTIAL", "NOTOBSERVED"}  # nothing is decided to 5 cm from a place known to 15
    assert all("known to 150 mm" in v.reason for v in found.verdicts if v.status == "PARTIAL")


def moved_block(path: Path, off: tuple[float, float, float], place_sigma: float) -> Path:
    """The project, all of it ``off`` [m]."""
    content = json.loads(project(path, place_sigma=place_sigma).read_text())
    for entry in content["cameras"]:
        entry["position"] = (np.array(entry["position"]) + off).tolist()
    content["points"] = (np.array(content["points"]) + off).tolist()
    path.write_text(json.dumps(content))
    return path


def test_nothing_is_gone_for_a_block_without_control_that_may_be_off(tmp_path: Path) -> None:
    options = ChangeOptions(voxel=0.04, sigma=SIGMA_M, sample_spacing=0.1, memory_gb=1.0, cache=False)
    off = moved_block(tmp_path / "off.json", (0.1, 0.1, 0.1), 0.15)
    found = change(room(), [[off]], options=options)
    assert {e.state for e in found.elements} <= {"CONFIRMED", "UNKNOWN"}
    assert all(e.disappeared_ratio == 0.0 for e in found.elements)
    assert any("150 mm, as its cameras' positions" in text for text in found.warnings)
    assert found.epochs[0].registration_sigma == 0.15
    believed = change(room(), [[off]], options=replace(options, registration_sigma=0.002))
    assert {e.state for e in believed.elements} & {"DISAPPEARED", "PARTIAL"}
    assert any("2.0 mm are counted for that, as you stated" in text for text in believed.warnings)
    assert not found.clusters and believed.clusters
    assert set(np.unique(found.voxels.state)) <= {UNKNOWN, CONFIRMED}
    assert {NEW, DISAPPEARED} <= set(np.unique(believed.voxels.state))


def test_voxels_and_groups_of_a_block_that_may_be_off_are_neither_new_nor_gone(tmp_path: Path) -> None:
    options = ChangeOptions(voxel=0.04, sigma=SIGMA_M, sample_spacing=0.3, memory_gb=1.0, cache=False)
    off, sure = moved_block(tmp_path / "off.json", (0.1, 0.1, 0.1), 0.15), project(tmp_path / "sure.json")
    for reference, stated in ((None, 0.15), ([sure], None)):
        found = change(room(), [[off]], reference, replace(options, registration_sigma=stated))
        assert not found.clusters and not found.clusters_left_out
        assert set(np.unique(found.voxels.state)) <= {UNKNOWN, CONFIRMED}
        assert all(c.new == c.disappeared == 0 for c in found.voxel_counts if "epoch" in (c.epoch, c.against))
        assert any("no voxel or group new or gone" in text and "(epoch)" in text for text in found.warnings)


def test_a_block_that_may_be_off_says_nothing_of_groups_of_other_epochs(tmp_path: Path) -> None:
    options = ChangeOptions(voxel=0.04, sigma=SIGMA_M, sample_spacing=0.3, memory_gb=1.0, cache=False)
    off, last = moved_block(tmp_path / "off.json", (0.1, 0.1, 0.1), 0.15), project(tmp_path / "last.json", "table")
    found, alone = (change(room(), epochs, options=options) for epochs in ([[off], [last]], [[last]]))
    assert [(c.kind, c.voxels) for c in found.clusters] == [(c.kind, c.voxels) for c in alone.clusters]
    assert found.clusters and {c.persistence for c in found.clusters} == {"unknown"}
    assert not any("epoch 1" in c.epochs for c in found.clusters)
    counts = {(c.epoch, c.against): c.new + c.disappeared for c in found.voxel_counts}
    assert counts["epoch 2", "epoch 1"] == counts["epoch 1", "model"] == 0 < counts["epoch 2", "model"]


def test_a_building_from_a_block_without_control_is_said_to_be_scaled_as_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reconstruction, "reconstruct", lambda *_: SimpleNamespace(warnings=[], timings={}))
    free, fixed = project(tmp_path / "free.json", place_sigma=0.03), tmp_path / "fixed.json"
    content = json.loads(free.read_text())
    seen = sorted({row[1] for row in content["observations"]})
    content["control"] = [{"point": k, "coordinates": content["points"][k]} for k in seen[:: len(seen) // 6]]
    fixed.write_text(json.dumps(content))
    said = reconstruct([free]).warnings
    position = np.array([entry["position"] for entry in content["cameras"]])
    share = 0.03 / np.linalg.norm(position - position.mean(axis=0))
    assert len(said) == 1 and f"off by {100 * share:.2g} % (one sigma)" in said[0]
    assert not reconstruct([fixed]).warnings


def test_quality_counts_the_place_of_a_block_without_control(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    table = ErrorTable(*np.full((2, len(SPACINGS_M), len(NOISES_M)), 0.001))
    monkeypatch.setattr(assess, "table_for", lambda *_, **__: table)
    free = project(tmp_path / "free.json", place_sigma=0.15)
    found = quality(room(), [free], QualityOptions(sample_spacing=0.1, cache=False))
    assert any("no control points and was adjusted freely" in text for text in found.warnings)
    assert found.registration_sigma >= 0.15
    errors = [e.predicted_error for e in found.elements if e.predicted_error is not None]
    assert errors and min(errors) > 0.1  # cameras of one block share it, so many of them make it no smaller
    assert next(f for f in found.factors if f.name == "Positional uncertainty").value >= 0.15


def test_two_blocks_in_files_of_one_name_are_two_bodies_of_evidence(tmp_path: Path) -> None:
    for folder in "ab":
        (tmp_path / folder).mkdir()
        project(tmp_path / folder / "block.json")
    content = json.loads((tmp_path / "b" / "block.json").read_text())
    for camera_entry in content["cameras"]:
        camera_entry["position"][2] += 0.01
    (tmp_path / "b" / "block.json").write_text(json.dumps(content))
    source = open_scans([tmp_path / "a" / "block.json", tmp_path / "b" / "block.json"])
    campaign = photo_campaign(source.stations, source.photo_blocks, SIGMA_M)
    assert campaign is not None and len(set(campaign.body[:-1].tolist())) == 2


def test_the_report_of_photos_speaks_of_photos(tmp_path: Path) -> None:
    found = verify(room(), [project(tmp_path / "adjusted.json")], VerifyOptions(loa=20, sigma=SIGMA_M, sample_spacing=0.1))
    page = render_page(found)
    assert "<dt>Photos</dt>" in page and "4 cameras" in page and "<dt>Rays</dt>" in page
    assert "scanner" not in page and "no beam" not in page
    assert "from 4 photos" in summary_lines(found)[1]
