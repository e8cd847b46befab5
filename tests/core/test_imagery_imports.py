"""Bundle projects: plain JSON, COLMAP text and binary, Metashape XML; what is adjusted is what was written."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bim_verify.cli import main
from bim_verify.core.errors import BimVerifyError
from bim_verify.core.imagery.bundle_problem import BundleProblem
from bim_verify.core.imagery.bundle_project import adjusted_project, read_project
from bim_verify.core.imagery.cameras_file import camera_to_plain, read_cameras
from bim_verify.core.jobs.bundle import bundle as adjust

from .imagery_data import bundle


def as_json(problem: BundleProblem) -> dict[str, Any]:
    o, c = problem.observed, problem.control
    return {
        "cameras": [camera_to_plain(camera) for camera in problem.cameras], "points": problem.points.tolist(),
        "observations": np.column_stack([o.camera, o.point, o.pixel]).tolist(), "sigma_px": 0.5, "free": list(problem.free),
        "control": [
            {"point": int(p), "coordinates": x.tolist(), "sigma_m": s.tolist()}
            for p, x, s in zip(c.point, c.coordinates, c.sigma, strict=True)
        ],
    }


def quaternion(rotation: np.ndarray) -> list[float]:
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(rotation).as_quat()
    return [w, x, y, z]


def write_colmap(folder: Path, problem: BundleProblem, binary: bool) -> None:
    folder.mkdir()
    lens = problem.interiors[0]
    p = [lens.fx, lens.fy, lens.cx + 0.5, lens.cy + 0.5, *lens.distortion[:4]]
    o = problem.observed
    poses = [(quaternion(c.rotation), (-c.rotation @ c.position).tolist()) for c in problem.cameras]
    if binary:
        head = struct.pack("<QiiQQ8d", 1, 7, 4, lens.width, lens.height, *p)
        (folder / "cameras.bin").write_bytes(head)
        data = struct.pack("<Q", len(poses))
        for k, (q, t) in enumerate(poses):
            rows = o.camera == k
            data += struct.pack("<I7dI", k + 1, *q, *t, 7) + problem.cameras[k].name.encode() + b"\0"
            data += struct.pack("<Q", rows.sum())
            seen = zip(o.pixel[rows], o.point[rows], strict=True)
            data += b"".join(struct.pack("<ddq", *(xy + 0.5), 100 + i) for xy, i in seen)
        (folder / "images.bin").write_bytes(data)
        data = struct.pack("<Q", len(problem.points))
        for i, x in enumerate(problem.points):
            data += struct.pack("<Q3d3BdQ2I", 100 + i, *x, 1, 2, 3, 0.5, 1, 1, 0)
        (folder / "points3D.bin").write_bytes(data)
        return
    values = " ".join(map(repr, map(float, p)))
    (folder / "cameras.txt").write_text(f"# cameras\n7 OPENCV {lens.width} {lens.height} {values}\n")
    text = "# images\n"
    for k, (q, t) in enumerate(poses):
        rows = o.camera == k
        text += f"{k + 1} {' '.join(map(repr, map(float, q + t)))} 7 {problem.cameras[k].name}\n"
        text += " ".join(f"{float(u) + 0.5!r} {float(v) + 0.5!r} {100 + i}" for (u, v), i in zip(
            o.pixel[rows], o.point[rows], strict=True
        )) + "\n"
    (folder / "images.txt").write_text(text)
    (folder / "points3D.txt").write_text(
        "".join(f"{100 + i} {' '.join(map(repr, map(float, x)))} 1 2 3 0.5 1 0\n" for i, x in enumerate(problem.points))
    )


@pytest.mark.parametrize("kind", ["json", "text", "binary"])
def test_every_form_gives_the_same_adjustment(tmp_path: Path, kind: str) -> None:
    problem, truth = bundle(3)
    content = as_json(problem)
    if kind != "json":
        write_colmap(tmp_path / "sparse", problem, kind == "binary")
        content = {"import": "sparse", **{k: content[k] for k in ("sigma_px", "free", "control")}}
    (tmp_path / "project.json").write_text(json.dumps(content))
    found = adjust(tmp_path / "project.json", robust=False)
    direct = adjust(problem, robust=False)
    assert np.abs(found.result.points - direct.result.points).max() < 1e-6
    assert np.abs(found.result.points - truth).max() < 0.02
    out = adjusted_project(found.problem, found.result, found.method)
    (tmp_path / "adjusted.json").write_text(json.dumps(out, allow_nan=False))
    again = read_project(tmp_path / "adjusted.json")
    assert np.abs(again.points - found.result.points).max() < 1e-9 and len(again.observed) == len(problem.observed)
    assert len(out["point_covariance"]) == len(truth) and min(row[0] for row in out["point_covariance"]) > 0


def test_metashape_cameras_keep_where_points_are_seen(tmp_path: Path) -> None:
    problem, truth = bundle(0)
    camera, lens = problem.cameras[2], problem.cameras[2].interior
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = camera.rotation.T, (camera.position - [5.0, 6.0, 7.0]) / 2.0
    (tmp_path / "cameras.xml").write_text(f"""<?xml version="1.0"?><document version="2.0"><chunk><sensors>
<sensor id="0"><resolution width="{lens.width}" height="{lens.height}"/><calibration type="frame" class="adjusted">
<f>{lens.fx}</f><cx>{lens.cx + 0.5 - lens.width / 2}</cx><cy>{lens.cy + 0.5 - lens.height / 2}</cy><k1>-0.02</k1>
<p1>0.001</p1><p2>-0.0004</p2></calibration></sensor></sensors>
<transform><rotation>1 0 0 0 1 0 0 0 1</rotation><translation>5 6 7</translation><scale>2</scale></transform>
<cameras><camera id="0" sensor_id="0" label="c2.jpg"><transform>{' '.join(map(str, pose.ravel()))}</transform></camera>
<camera id="1" sensor_id="0" label="not aligned"/></cameras></chunk></document>""")
    read = read_cameras(tmp_path / "cameras.xml").of_image("c2.jpg").camera
    assert np.abs(read.position - camera.position).max() < 1e-9
    x, y = (read.project(truth[:5]) - [read.interior.cx, read.interior.cy]).T / read.interior.fx
    r2 = x * x + y * y
    bent = x * (1 - 0.02 * r2) + 0.001 * (r2 + 2 * x * x) - 0.0008 * x * y
    u = lens.cx + 0.5 + lens.fx * bent
    assert np.abs(read.interior.distort(read.project(truth[:5]))[:, 0] + 0.5 - u).max() < 1e-6


def test_a_colmap_folder_can_stand_in_the_place_of_the_project(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_colmap(tmp_path / "sparse", bundle(0)[0], False)
    assert len(read_project(tmp_path / "sparse").cameras) == 8
    given = tmp_path / "sparse" / "images.txt"
    before = given.read_bytes()
    assert main(["bundle", str(tmp_path / "sparse"), "--out", str(tmp_path / "out.json")]) == 1
    assert "datum" in capsys.readouterr().err
    assert main(["bundle", str(tmp_path / "sparse"), "--out", str(given)]) == 1 and given.read_bytes() == before


def test_the_command_says_what_it_left_out_and_which_sigmas_it_gives(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    problem, _ = bundle(3)
    content = as_json(problem) | {"sigma_px": 0.1}
    content["observations"] = [row for row in content["observations"] if row[1] != 70 or row[0] == 0]
    (tmp_path / "p.json").write_text(json.dumps(content))
    assert main([
        "bundle", str(tmp_path / "p.json"), "--out", str(tmp_path / "o.json"), "--plain", "--memory-gb", "1", "--quiet",
        "--report", str(tmp_path / "report"),
    ]) == 0
    said = capsys.readouterr().out
    assert "Left out: 1 points" in said and "Sigmas count tie points" in said
    out = json.loads((tmp_path / "o.json").read_text())
    assert out["points_left_out"] == [70] and out["variance_factor"] > 9
    assert out["groups"][0]["sigma_multiplied_by"] == pytest.approx(out["groups"][0]["variance_component"] ** 0.5, rel=0.01)
    assert "Sigmas count tie points" in (tmp_path / "report" / "index.html").read_text()


@pytest.mark.parametrize(("change", "sentence"), [
    ({"observations": [[0, 0, 1]]}, "rows of 4 or 5 numbers"),
    ({"observations": [[99, 0, 1, 1]]}, "names camera 99; they are numbered 0 to 7"),
    ({"observations": [[-2, 0, 1, 1]]}, "names camera -2"), ({"observations": [[1e300, 0, 1, 1]]}, "whole numbers"),
    ({"control": [{"point": True, "coordinates": [0, 0, 0]}]}, "needs a point"),
    ({"free": ["f", "zoom"]}, "zoom cannot be calibrated"), ({"control": [{"point": 900}]}, "needs a point"),
    ({"import": "nowhere"}, "neither a folder of COLMAP"), ({"sigma_px": -1}, "larger than zero"),
    ({"sigma_px": 1e-300}, "1e-09 to 1e"), ({"sigma_px": 1e300}, "1e-09 to 1e"),
    ({"control": [{"point": 0, "coordinates": [0, 0, 0], "sigma_m": 1e-200}]}, "1e-09 to 1e"),
    ({"control": [{"point": 0, "coordinates": [1e300, 0, 0]}]}, r"beyond 1e\+08 m"),
    ({"observations": [[0, 0, 1e300, 1]]}, r"pixels beyond 1e\+06"), ({"points": [[0, 1e200, 0]] * 900}, r"beyond 1e\+08 m"),
    ({"control": [{"point": 0, "coordinates": [0, 0, 0]}] * 2}, "names point 0, which is a control point already"),
])
def test_projects_that_cannot_be_right_are_refused(tmp_path: Path, change: dict[str, Any], sentence: str) -> None:
    problem, _ = bundle(0)
    (tmp_path / "project.json").write_text(json.dumps(as_json(problem) | change))
    with pytest.raises(BimVerifyError, match=sentence):
        read_project(tmp_path / "project.json")


def test_a_colmap_model_that_is_cut_off_is_refused(tmp_path: Path) -> None:
    problem, _ = bundle(0)
    write_colmap(tmp_path / "sparse", problem, True)
    data = (tmp_path / "sparse" / "images.bin").read_bytes()
    (tmp_path / "sparse" / "images.bin").write_bytes(data[: len(data) // 2])
    (tmp_path / "project.json").write_text(json.dumps({"import": "sparse"}))
    with pytest.raises(BimVerifyError, match="no COLMAP model that can be read"):
        read_project(tmp_path / "project.json")


@pytest.mark.parametrize(("old", "new", "sentence"), [
    ("<k1>-0.02</k1>", "<k1>-0,02</k1>", "k1 that cannot be read"),
    ("<scale>2</scale>", "<scale>0</scale>", "scale that is not"),
    ("<scale>2</scale>", "<scale>two</scale>", "scale that cannot be read"),
    ("<rotation>1 0 0", "<rotation>2 0 0", "no 3 x 3 rotation"),
    ("<transform>1.0 0.0", "<transform>-1.0 0.0", "no 3 x 3 rotation"),
    ("<f>1000</f>", "<f>-1000</f>", "focal length of -1000"), ('width="800"', 'width="8000000"', "whole pixels"),
    ("<transform>1.0 0.0", "<transform>one 0.0", "transform that cannot be read"),
])
def test_a_metashape_file_with_numbers_that_cannot_be_right_is_refused(
    tmp_path: Path, old: str, new: str, sentence: str
) -> None:
    text = f"""<document><chunk><sensors><sensor id="0"><resolution width="800" height="600"/>
<calibration type="frame"><f>1000</f><k1>-0.02</k1></calibration></sensor></sensors>
<transform><rotation>1 0 0 0 1 0 0 0 1</rotation><scale>2</scale></transform>
<cameras><camera id="0" sensor_id="0" label="a"><transform>{' '.join(map(str, np.eye(4).ravel()))}</transform></camera>
</cameras></chunk></document>"""
    (tmp_path / "good.xml").write_text(text)
    assert read_cameras(tmp_path / "good.xml").cameras[0].camera.interior.fx == 1000
    (tmp_path / "bad.xml").write_text(text.replace(old, new))
    assert text.replace(old, new) != text
    with pytest.raises(BimVerifyError, match=sentence):
        read_cameras(tmp_path / "bad.xml")


@pytest.mark.parametrize(("old", "new", "sentence"), [
    ("\n1 0 0\n", "\n1 0.5 0\n", "no 3 x 3 rotation"), ("\n1 0 0\n", "\n-1 0 0\n", "no 3 x 3 rotation"),
    ("900 0 0", "-900 0 0", "focal length of -900"), ("900 0 0", "nan 0 0", "focal length of nan"),
    ("2 0 0 1.0 2.0", "inf 0 0 1.0 2.0", "cut off or damaged"), ("2 0 0 1.0 2.0", "9 0 0 1.0 2.0", "cut off or damaged"),
])
def test_a_bundler_file_with_numbers_that_cannot_be_right_is_refused(
    tmp_path: Path, old: str, new: str, sentence: str
) -> None:
    camera = "900 0 0\n1 0 0\n0 1 0\n0 0 1\n{} 0 0\n"
    text = (
        f"# Bundle file v0.3\n2 1\n{camera.format(0)}{camera.format(-1)}0.1 0.2 -5\n255 255 255\n2 0 0 1.0 2.0 1 0 3.0 4.0\n"
    )
    (tmp_path / "b.out").write_text(text)
    assert len(read_project(tmp_path / "b.out").cameras) == 2
    (tmp_path / "b.out").write_text(text.replace(old, new))
    with pytest.raises(BimVerifyError, match=sentence):
        read_project(tmp_path / "b.out")


def test_a_colmap_track_of_impossible_length_is_refused(tmp_path: Path) -> None:
    write_colmap(tmp_path / "sparse", bundle(0)[0], True)
    points = tmp_path / "sparse" / "points3D.bin"
    data = bytearray(points.read_bytes())
    data[8 + 43 : 8 + 51] = b"\xff" * 8
    points.write_bytes(bytes(data))
    with pytest.raises(BimVerifyError, match="no COLMAP model that can be read"):
        read_project(tmp_path / "sparse")


def test_the_files_that_a_project_imports_are_never_written_to(tmp_path: Path) -> None:
    write_colmap(tmp_path / "sparse", bundle(0)[0], False)
    (tmp_path / "p.json").write_text(json.dumps({"import": "sparse"}))
    given = tmp_path / "sparse" / "points3D.txt"
    before = given.read_bytes()
    assert main(["bundle", str(tmp_path / "p.json"), "--out", str(given)]) == 1
    assert given.read_bytes() == before
