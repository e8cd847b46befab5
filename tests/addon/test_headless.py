"""The scripts for use without a window, as processes; the .blend file they leave."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import bpy
import ifcopenshell
import ifcopenshell.util.element
import numpy as np
import pytest

from bim_verify.bim_verify_addon import project, scene
from bim_verify.bim_verify_addon.headless import save_blend
from bim_verify.core.errors import BimVerifyError
from bim_verify.core.options import VerifyOptions
from bim_verify.core.results import STATUSES, VerificationResult

from .scene_facts import status_counts

ROOT = Path(__file__).resolve().parent.parent.parent


def script(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """``python scripts/verify.py -- ...`` from another folder, without the package on the import path."""
    command = [sys.executable, str(ROOT / "scripts" / "verify.py"), "--", *arguments]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=300)


@pytest.fixture(scope="module")
def room_scan(house: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The planned faces of the room seen from its middle, 1 mm noise, from one known station."""
    rng = np.random.default_rng(3)
    station = np.array([2.0, 1.5, 1.4])
    ray = rng.normal(size=(40_000, 3))
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    low, high = np.array([0.2, 0.2, 0.0]), np.array([4.0, 2.8, 2.5])
    with np.errstate(divide="ignore"):
        reach = np.where(ray > 0, (high - station) / ray, (low - station) / ray)
    face, distance = reach.argmin(axis=1), reach.min(axis=1)
    wall = (face == 1) | ((face == 0) & (ray[:, 0] < 0)) | ((face == 2) & (ray[:, 2] < 0))
    points = station + ray[wall] * (distance[wall] + rng.normal(0, 0.001, wall.sum()))[:, None]
    path = tmp_path_factory.mktemp("room") / "room.xyz"
    np.savetxt(path, points, fmt="%.5f")
    return path


def test_the_script_verifies_and_saves_the_scene(house: Path, room_scan: Path, tmp_path: Path) -> None:
    done = script(
        str(house), str(room_scan), "--origin", "2.0,1.5,1.4", "--out", "out.ifc", "--blend", "out.blend", "--spacing-mm",
        "50", "--quiet", cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    file = ifcopenshell.open(str(tmp_path / "out.ifc"))
    found = {
        e.GlobalId: ifcopenshell.util.element.get_psets(e)["BimVerify_Verification"]["Status"]
        for e in file.by_type("IfcElement")
    }
    assert len(found) == 5
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "out.blend"))
    shown = {o["GlobalId"]: o for o in bpy.data.objects if "GlobalId" in o}
    assert set(shown) == set(found)
    assert all("bv_color" in o.data.attributes for o in shown.values())


@pytest.mark.parametrize(
    ("arguments", "code", "text"),
    [
        (("missing.ifc", "scan.e57", "--out", "out.ifc"), 1, "missing.ifc"),
        (("--wrong",), 2, "usage"),
        (("--help",), 0, ""),
    ],
)
def test_the_script_ends_with_the_commands_code(arguments: tuple[str, ...], code: int, text: str, tmp_path: Path) -> None:
    done = script(*arguments, cwd=tmp_path)
    assert done.returncode == code
    assert text in done.stderr
    assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_saved_scene_has_verdicts_and_colours(blender: bpy.types.Scene, result: VerificationResult, tmp_path: Path) -> None:
    save_blend(result, tmp_path / "saved.blend", display_vertices=10_000)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    items = scene.element_objects(bpy.context.scene)
    assert {g: o.bim_verify.status for g, o in items.items()} == {v.global_id: v.status for v in result.verdicts}
    assert status_counts(bpy.context.scene) == [(s, result.count(s)) for s in STATUSES]
    assert [m.name for m in bpy.data.materials] == ["BIM Verify"]
    shadings = [s.shading.color_type for sc in bpy.data.screens for a in sc.areas for s in a.spaces if s.type == "VIEW_3D"]
    assert set(shadings) <= {"VERTEX"}
    assert [p.name for p in tmp_path.iterdir()] == ["saved.blend"]


def test_a_saved_scene_verifies_again_with_the_same_options(
    blender: bpy.types.Scene, result: VerificationResult, scan: Path, tmp_path: Path
) -> None:
    given = VerifyOptions(
        loa=20, sigma=0.003, registration_sigma=0.001, align="fine", sample_spacing=0.05, fusion="yager", preset="tls",
        scan_frame="map", origin=(1.5, -2.25, 1.7), threads=1, memory_gb=2.0,
    )
    found = replace(result, options=given, scan_paths=(str(scan),))
    save_blend(found, tmp_path / "saved.blend", display_vertices=10_000)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    settings = bpy.context.scene.bim_verify
    kept = project.options(settings)
    for name, value in vars(given).items():
        assert getattr(kept, name) == (pytest.approx(value, rel=1e-6) if isinstance(value, float) else value), name
    assert settings.model_summary == "5 elements in 1 storey, IFC4"
    assert [(entry.points, entry.stations) for entry in settings.scans] == [(2000, 1)]


def test_saving_without_the_extension_enabled_leaves_it_so(result: VerificationResult, tmp_path: Path) -> None:
    assert not hasattr(bpy.types.Scene, "bim_verify")
    save_blend(result, tmp_path / "saved.blend", display_vertices=10_000)
    assert not hasattr(bpy.types.Scene, "bim_verify")


def test_a_place_that_cannot_be_written_is_named(result: VerificationResult, tmp_path: Path) -> None:
    with pytest.raises(BimVerifyError, match="does not exist"):
        save_blend(result, tmp_path / "nowhere" / "saved.blend", display_vertices=10_000)
