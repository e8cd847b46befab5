"""From a photo and a coarse pose to the pose: right, sure of itself only as far as it is right, refusing what is not so."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from bim_verify.core.errors import BimVerifyError
from bim_verify.core.imagery import register_image as placing
from bim_verify.core.imagery.cameras_file import CameraList, KnownCamera, camera_to_plain, read_cameras
from bim_verify.core.imagery.coregistration import CoregisterOptions, findings, refined_cameras, state_of
from bim_verify.core.imagery.detect_lines import detect_lines
from bim_verify.core.imagery.line_pose import pose_difference
from bim_verify.core.imagery.model_edges import sharp_edges
from bim_verify.core.imagery.register_image import register_image
from bim_verify.core.imagery.report import write_coregistration_report
from bim_verify.core.imagery.visible_edges import EdgeViewer
from bim_verify.core.jobs.coregister import coregister
from bim_verify.core.simulation.photo import photograph

from .photo_data import LENS, camera, room

COARSE = (np.radians([1.1, -0.8, 0.9]), np.array([0.14, -0.12, 0.1]))
SIGMA = 0.0025


@pytest.fixture(scope="module")
def photo() -> np.ndarray:
    model = room()
    shift = np.random.default_rng(4).normal(0, SIGMA, (len(model.elements), 3))
    return photograph(model, camera(), shift=shift)


@pytest.fixture(scope="module")
def viewer() -> EdgeViewer:
    model = room()
    return EdgeViewer(model, sharp_edges(model))


def test_a_photo_is_placed_to_a_centimetre_from_fifteen(photo, viewer) -> None:  # type: ignore[no-untyped-def]
    coarse = KnownCamera(camera().moved(*COARSE))
    found = register_image(viewer, detect_lines(photo, LENS), coarse, model_sigma=SIGMA)
    away = pose_difference(found.camera, camera())
    assert np.linalg.norm(away[3:]) < 0.015 and math.degrees(np.linalg.norm(away[:3])) < 0.3
    assert state_of(found) == "REFINED" and not found.weak
    assert found.covariance is not None
    assert away @ np.linalg.solve(found.covariance, away) < 35.0
    again = register_image(viewer, detect_lines(photo, LENS), coarse, model_sigma=SIGMA)
    assert np.array_equal(again.camera.position, found.camera.position)


def test_a_photo_of_another_place_is_not_placed(photo, viewer) -> None:  # type: ignore[no-untyped-def]
    elsewhere = KnownCamera(replace(camera(), rotation=camera().rotation @ np.diag([-1.0, -1.0, 1.0])))
    found = register_image(viewer, detect_lines(photo, LENS), elsewhere, model_sigma=SIGMA)
    assert state_of(found) in ("FAILED", "AMBIGUOUS") and found.note


def test_a_pose_drawn_by_chance_is_followed_to_its_end_before_it_counts(
    photo: np.ndarray, viewer: EdgeViewer, monkeypatch: pytest.MonkeyPatch
) -> None:
    by_chance, match, settle = placing._by_chance, placing.match_lines, placing._settle
    follow = True

    def stopped_short(edges: Any, lines: Any, known: KnownCamera, sigma: float) -> Any:
        found = match(edges, lines, known, sigma)
        if found is None:
            return None
        return (replace(known, camera=found[0].camera.moved(np.zeros(3), np.array([0.05, 0.0, 0.0]))), *found[1:])

    def settled(*where: Any) -> Any:
        if follow:
            return settle(*where)
        raise BimVerifyError("not followed")

    def half_way(*what: Any) -> float:
        with monkeypatch.context() as patch:
            patch.setattr(placing, "match_lines", stopped_short)
            patch.setattr(placing, "_settle", settled)
            return by_chance(*what)

    monkeypatch.setattr(placing, "_by_chance", half_way)
    lines, coarse = detect_lines(photo, LENS), KnownCamera(camera().moved(0.1 * COARSE[0], 0.1 * COARSE[1]), 0.02, 0.003)
    states = {}
    for follow in (True, False):
        states[follow] = state_of(register_image(viewer, lines, coarse, model_sigma=SIGMA))
    assert states[True] in ("REFINED", "PARTLY") and states[False] == "AMBIGUOUS"


def test_lines_of_one_direction_leave_a_direction_that_is_named(photo, viewer) -> None:  # type: ignore[no-untyped-def]
    lines = detect_lines(photo, LENS)
    steep = np.abs(lines.end - lines.start)
    upright = steep[:, 1] > 4 * steep[:, 0]
    only = type(lines)(*(getattr(lines, name)[upright] for name in lines.__dataclass_fields__))
    found = register_image(viewer, only, KnownCamera(camera().moved(*COARSE)), model_sigma=SIGMA)
    assert state_of(found) == "PARTLY"
    assert any("position along the z axis of the model" in weak.text for weak in found.weak)


def test_the_job_goes_from_files_to_refined_cameras(tmp_path: Path, photo: np.ndarray) -> None:
    model = room(origin=(1000.0, 2000.0, 30.0))
    Image.fromarray(photo).save(tmp_path / "room.png")
    coarse = camera("somewhere/room.png").moved(*COARSE)
    given = CameraList((KnownCamera(replace(coarse, position=coarse.position + model.origin)),))
    result = coregister(model, [tmp_path / "room.png"], given, CoregisterOptions(loa=40))
    (tmp_path / "refined.json").write_text(json.dumps(refined_cameras(result), allow_nan=False))
    back = read_cameras(tmp_path / "refined.json").of_image("room.png")
    away = pose_difference(back.camera, replace(camera(), position=camera().position + model.origin))
    assert np.linalg.norm(away[3:]) < 0.015 and back.position_sigma < 0.02
    entry = findings(result)["cameras"][0]
    assert np.array(entry["covariance"]).shape == (6, 6)
    assert sum(line["used"] for line in entry["lines"]) == entry["lines_used"] > 10
    page = write_coregistration_report(tmp_path / "report", result).read_text()
    assert page.count("data:image/jpeg") == 2 and "REFINED" in page


def test_cameras_files_are_read_in_every_form_and_refused_in_a_sentence(tmp_path: Path) -> None:
    path = tmp_path / "cameras.json"
    lens = {"width": 640, "height": 480, "f_mm": 26.4, "sensor_width_mm": 36.0}
    turn = camera().rotation
    entry = camera_to_plain(camera("a.jpg"))
    path.write_text(json.dumps({
        "interiors": {"phone": lens}, "position_sigma_m": 0.3,
        "cameras": [
            {"image": "a.jpg", "interior": "phone", "position": [1, 2, 3], "omega_phi_kappa_deg": [0, 0, 0]},
            {"image": "b.jpg", "position": [1, 2, 3], "rotation": turn.tolist(), "rotation_sigma_deg": 2},
            {"image": "c.jpg", "position": [1, 2, 3], "quaternion_wxyz": [1, 0, 0, 0]}, entry | {"image": "d.jpg"},
        ],
    }))
    read = read_cameras(path)
    assert read.of_image("x/a.jpg").camera.interior.fx == pytest.approx(26.4 / 36 * 640)
    assert np.allclose(read.of_image("a.jpg").camera.rotation, np.diag([1, -1, -1]))
    assert read.of_image("b.png").rotation_sigma == pytest.approx(math.radians(2))
    assert read.of_image("c.jpg").position_sigma == 0.3
    assert read.of_image("d.jpg").camera.interior == LENS
    with pytest.raises(BimVerifyError, match=r"no camera for the image e\.jpg"):
        read.of_image("e.jpg")
    for spoiled, sentence in (
        ({"position": [1, 2]}, "no position"), ({"rotation": [[1, 0, 0], [0, 1, 0], [0, 0, -1]]}, "no 3 x 3 rotation"),
        ({"interior": {"width": 640, "height": 480}}, "fx must be a number"),
        ({"interior": entry["interior"] | {"k1": -40.0}}, "cannot be inverted"), ({"position_sigma_m": 0}, "larger than zero"),
        ({"position_sigma_m": 1e-200}, "must lie between"), ({"position_sigma_m": 10**400}, "must be a number"),
        ({"interior": {"width": 640, "height": 480, "f_mm": 26, "sensor_width_mm": 0}}, "sensor_width_mm must be larger"),
    ):
        path.write_text(json.dumps({"cameras": [entry | spoiled]}))
        with pytest.raises(BimVerifyError, match=sentence):
            read_cameras(path)
    path.write_text('{"cameras": [1' + 5000 * "0" + "]}")
    with pytest.raises(BimVerifyError, match="no JSON file that can be read"):
        read_cameras(path)


def test_what_is_no_image_is_refused_in_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "room.png").write_text("no image")
    with pytest.raises(BimVerifyError, match=r"Cannot read .* as an image"):
        coregister(room(), [tmp_path / "room.png"], CameraList((KnownCamera(camera()),)))
    Image.new("L", (64, 48)).save(tmp_path / "room.png")
    with pytest.raises(BimVerifyError, match="64 x 48 pixels"):
        coregister(room(), [tmp_path / "room.png"], CameraList((KnownCamera(camera()),)))


def test_a_longer_focal_length_keeps_where_the_lens_images_things() -> None:
    ideal = np.random.default_rng(0).uniform([0, 0], [639, 479], (50, 2))
    for scale in (0.97, 1.03):
        longer = LENS.scaled(scale)
        assert longer.fx == pytest.approx(scale * LENS.fx)
        assert np.abs(longer.distort(ideal) - LENS.distort(ideal)).max() < 1e-9


def test_a_focal_length_that_is_estimated_takes_its_distortion_along(photo, viewer) -> None:  # type: ignore[no-untyped-def]
    off = LENS.scaled(1.01)
    coarse = KnownCamera(replace(camera().moved(*COARSE), interior=off))
    found = register_image(viewer, detect_lines(photo, off), coarse, model_sigma=SIGMA, focal=True)
    lens = found.camera.interior
    assert lens.fx == pytest.approx(LENS.fx, rel=0.006) and lens.fx != off.fx
    corner = np.array([[20.0, 15.0]])
    assert np.abs(lens.distort(corner) - off.distort(corner)).max() < 1e-9


def test_only_poses_that_hold_are_counted_and_have_figures(tmp_path: Path, photo: np.ndarray) -> None:
    Image.fromarray(photo).save(tmp_path / "room.png")
    given = CameraList((KnownCamera(camera().moved(*COARSE)),))
    result = coregister(room(), [tmp_path / "room.png"], given, CoregisterOptions(loa=40))
    found = result.registrations[0]
    refused = replace(result, registrations=(replace(found, runner_up=1.0, note="Another pose"),))
    assert result.placed == 1 and refused.placed == 0
    assert findings(result)["cameras"][0]["shift"] is not None and findings(refused)["cameras"][0]["shift"] is None
    page = write_coregistration_report(tmp_path / "report", refused).read_text()
    assert "AMBIGUOUS" in page and "Chance" in page and page.count(">–<") == 6
    elsewhere = replace(camera(), rotation=camera().rotation @ np.diag([-1.0, -1.0, 1.0]))
    with pytest.raises(BimVerifyError, match="None of the images could be placed"):
        coregister(room(), [tmp_path / "room.png"], CameraList((KnownCamera(elsewhere),)))


def test_images_are_looked_at_before_the_model_is_read(tmp_path: Path) -> None:
    cameras = CameraList((KnownCamera(camera("a.png")), KnownCamera(camera("b.png"))))
    Image.new("L", (640, 480)).save(tmp_path / "a.png")
    with pytest.raises(BimVerifyError, match=r"Cannot read .*b\.png as an image"):
        coregister(tmp_path / "there_is_no.ifc", [tmp_path / "a.png", tmp_path / "b.png"], cameras)


def test_coarse_sigmas_can_be_said_for_a_file_that_states_none(tmp_path: Path) -> None:
    entry = camera_to_plain(camera("a.jpg"))
    (tmp_path / "c.json").write_text(json.dumps({"cameras": [entry, entry | {"image": "b.jpg", "position_sigma_m": 0.05}]}))
    read = read_cameras(tmp_path / "c.json", 0.5, 0.1)
    assert [k.position_sigma for k in read.cameras] == [0.5, 0.05] and read.cameras[0].rotation_sigma == pytest.approx(0.1)
