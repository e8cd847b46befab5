"""The reconstruction operator: writes the model, takes it as the scene's, or leaves the scene as it was."""

from __future__ import annotations

from pathlib import Path

import bpy
import ifcopenshell
import numpy as np
import pytest
from shapely.geometry import box

from bim_verify.bim_verify_addon import scene
from bim_verify.bim_verify_addon.capabilities import compare
from bim_verify.bim_verify_addon.headless import save_blend
from bim_verify.core import jobs
from bim_verify.core.errors import BimVerifyError
from bim_verify.core.files import all_or_none
from bim_verify.core.options import ReconstructOptions
from bim_verify.core.reconstruction.building import (
    MEASURED,
    BuiltRoom,
    BuiltSlab,
    BuiltStorey,
    BuiltWall,
    FitRecord,
    Reconstruction,
)
from bim_verify.core.reconstruction.write_ifc import write_reconstruction

ops = bpy.ops.bim_verify


@pytest.fixture
def made(scan: Path) -> Reconstruction:
    """One room with one wall and a floor."""
    fit = FitRecord(0.001, 0.001, 0.9, 0.001, MEASURED, 1000)
    wall = BuiltWall(
        np.array([0.0, 0.0]), np.array([4.0, 0.0]), 0.2, box(0.0, -0.1, 4.0, 0.1), 0.0, 2.5, (), (None, None), (0,), False, fit
    )
    slab = BuiltSlab(box(0.0, 0.0, 4.0, 3.0), 0.0, 0.2, "FLOOR", fit)
    storey = BuiltStorey("Storey 1", 0.0, 2.5, (wall,), (), (slab,), (BuiltRoom(box(0.0, 0.1, 4.0, 3.0), 0.0, 2.5),))
    return Reconstruction(np.zeros(3), (storey,), 2000, 1, (str(scan),))


def test_what_was_made_becomes_the_model(
    blender: bpy.types.Scene, scan: Path, made: Reconstruction, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    assert not ops.reconstruct.poll()
    ops.import_scan(filepath=str(scan))
    monkeypatch.setattr(jobs, "reconstruct", lambda *_: made)
    assert ops.reconstruct(filepath=str(tmp_path / "made")) == {"FINISHED"}
    written = ifcopenshell.open(str(tmp_path / "made.ifc"))
    assert written.header.file_name.name == "made.ifc"
    walls = {w.GlobalId for w in written.by_type("IfcWall")}
    assert walls
    assert walls <= set(scene.element_objects(blender))
    assert blender.bim_verify.model_path == str(tmp_path / "made.ifc")
    assert "1 room, 1 wall" in blender.bim_verify_reconstruct.summary


def test_it_may_only_be_written(
    blender: bpy.types.Scene, house: Path, scan: Path, made: Reconstruction, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    ops.import_ifc(filepath=str(house))
    ops.import_scan(filepath=str(scan))
    before = set(scene.element_objects(blender))
    monkeypatch.setattr(jobs, "reconstruct", lambda *_: made)
    assert ops.reconstruct(filepath=str(tmp_path / "made.ifc"), show=False) == {"FINISHED"}
    assert set(scene.element_objects(blender)) == before
    assert blender.bim_verify.model_path == str(house)
    with pytest.raises(RuntimeError, match="never written"):
        ops.reconstruct(filepath=str(house))


def test_report_dimensions_and_comparison_lie_beside_it(
    blender: bpy.types.Scene, house: Path, scan: Path, made: Reconstruction, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    ops.import_scan(filepath=str(scan))
    monkeypatch.setattr(jobs, "reconstruct", lambda *_: made)
    settings = blender.bim_verify_reconstruct
    settings.with_report = settings.with_dimensions = True
    settings.reference = str(house)
    assert ops.reconstruct("INVOKE_DEFAULT", filepath=str(tmp_path / "made.ifc")) == {"FINISHED"}
    assert sorted(p.name for p in tmp_path.iterdir()) == ["made.ifc", "made_dimensions.csv", "made_report"]
    assert "Against the reference" in (tmp_path / "made_report" / "index.html").read_text(encoding="utf-8")
    with pytest.raises(RuntimeError, match="never written"):
        ops.reconstruct(filepath=str(house), reference=str(house))


def test_a_known_registration_is_passed_on(
    blender: bpy.types.Scene, scan: Path, made: Reconstruction, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    ops.import_scan(filepath=str(scan))
    asked: list[float | None] = []

    def reconstruct(_: object, options: ReconstructOptions, *__: object) -> Reconstruction:
        asked.append(options.registration_sigma)
        return made

    monkeypatch.setattr(jobs, "reconstruct", reconstruct)
    settings = blender.bim_verify_reconstruct
    ops.reconstruct("INVOKE_DEFAULT", filepath=str(tmp_path / "estimated.ifc"), show=False)
    settings.registration_known, settings.registration_sigma_mm = True, 3.0
    ops.reconstruct("INVOKE_DEFAULT", filepath=str(tmp_path / "panel.ifc"), show=False)
    ops.reconstruct(filepath=str(tmp_path / "said.ifc"), show=False, registration_known=True, registration_sigma_mm=0.0)
    assert asked == [None, pytest.approx(0.003), 0.0]


def test_the_model_is_compared_with_another_file(
    blender: bpy.types.Scene, house: Path, made: Reconstruction, tmp_path: Path
) -> None:
    ops.import_ifc(filepath=str(house))
    assert ops.compare(filepath=str(house)) == {"FINISHED"}
    kinds = {i.name: i.get(compare.KIND_KEY) for i in scene.element_objects(blender).values()}
    assert set(kinds.values()) == {"MATCHED"}
    assert "Thomson and Boehm's number: 0.000" in blender.bim_verify_compare.summary
    write_reconstruction(tmp_path / "one_wall.ifc", made)
    blender.bim_verify_compare.with_report = True
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    assert ops.compare("INVOKE_DEFAULT", filepath=str(tmp_path / "one_wall.ifc")) == {"FINISHED"}
    assert {i.get(compare.KIND_KEY) for i in scene.element_objects(blender).values()} == {"MATCHED", "EXTRA"}
    assert (tmp_path / "house_comparison" / "index.html").is_file()
    with pytest.raises(RuntimeError, match="nothing"):
        ops.compare(filepath=str(tmp_path / "nothing.ifc"))


def test_a_failure_leaves_file_and_scene(
    blender: bpy.types.Scene, scan: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    ops.import_scan(filepath=str(scan))

    def fail(*_: object) -> Reconstruction:
        raise BimVerifyError("No storey was found.")

    monkeypatch.setattr(jobs, "reconstruct", fail)
    with pytest.raises(RuntimeError, match="No storey was found"):
        ops.reconstruct(filepath=str(tmp_path / "made.ifc"))
    assert list(tmp_path.iterdir()) == []
    assert not scene.element_objects(blender)


def test_a_blend_file_shows_it(blender: bpy.types.Scene, made: Reconstruction, tmp_path: Path) -> None:
    with all_or_none():  # as the commands do
        save_blend(made, tmp_path / "made.blend")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "made.blend"))
    assert scene.element_objects(bpy.context.scene)
