"""Scan quality in the scene: a colour mode with its legend, beside what a verification knows of the same vertices."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
import pytest

from bim_verify.bim_verify_addon import hover, overlay, scene, survey_scene
from bim_verify.bim_verify_addon.headless import save_blend
from bim_verify.core import jobs
from bim_verify.core.model.elements import BuildingModel
from bim_verify.core.quality.options import QualityOptions
from bim_verify.core.quality.results import QualityResult
from bim_verify.core.results import VerificationResult
from bim_verify.core.scans.campaign import Station
from bim_verify.core.simulation.box_building import ArraySource
from bim_verify.core.simulation.scanner import Scanner, scan_station
from bim_verify.core.simulation.scene import build_scene

ops = bpy.ops.bim_verify
Verification = Callable[[Callable[..., VerificationResult]], None]


@pytest.fixture(scope="module")
def survey(house_model: BuildingModel) -> QualityResult:
    """Of the small house, seen from one station inside."""
    place = np.array([2.0, 1.5, 1.4])
    scanner = Scanner("test", np.radians(1.0), sigma_range=0.001)
    seen = scan_station(build_scene(house_model, {}), place - house_model.origin, np.eye(3), scanner, 1)
    return jobs.quality(house_model, ArraySource((Station("S0", place),), (seen.offset,)), QualityOptions(sample_spacing=0.1))


def test_verdicts_and_survey_share_the_surface(
    blender: bpy.types.Scene, house: Path, scan: Path, result: VerificationResult, survey: QualityResult,
    verification: Verification, monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    verification(lambda *_: result)
    monkeypatch.setattr(jobs, "quality", lambda *_: survey)
    blender.bim_verify.display_vertices = 10_000
    blender.bim_verify.spacing_mm = 1000 * result.options.sample_spacing
    ops.import_ifc(filepath=str(house))
    ops.import_scan(filepath=str(scan))
    ops.verify()
    assert ops.quality() == {"FINISHED"}
    assert blender.bim_verify.color_mode == survey_scene.MODE
    items = scene.element_objects(blender).values()
    for item in items:
        assert {"bv_deviation", "bv_occupied", "bv_cause", "bv_spacing", "bv_color"} <= set(item.data.attributes.keys())
    swatches = [text for text, _ in overlay.legend(blender).swatches]
    assert swatches[:2] == ["Seen", "Seen through"]
    ops.verify()
    assert all("bv_cause" in item.data.attributes for item in items)
    blender.bim_verify.color_mode = "DEVIATION"
    item = next(o for o in items if o.bim_verify.ifc_class == "IfcWall")
    text = "\n".join(hover.lines(item, 0))
    assert "LOA30" in text
    blender.bim_verify.color_mode = survey_scene.MODE
    assert item["bim_verify_quality"].split()[0] in "\n".join(hover.lines(item, 0))


def test_another_model_takes_the_survey_away(
    blender: bpy.types.Scene, house: Path, scan: Path, survey: QualityResult, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(jobs, "quality", lambda *_: survey)
    blender.bim_verify.display_vertices = 10_000
    ops.import_ifc(filepath=str(house))
    ops.import_scan(filepath=str(scan))
    ops.quality()
    assert blender[survey_scene.SUMMARY_KEY]
    (tmp_path / "other.ifc").write_bytes(house.read_bytes() + b"\n")
    ops.import_ifc(filepath=str(tmp_path / "other.ifc"))
    assert survey_scene.SUMMARY_KEY not in blender
    assert not blender.bim_verify.has_findings
    assert not any("bim_verify_quality" in item for item in scene.element_objects(blender).values())


def test_a_survey_alone_is_explained_too(blender: bpy.types.Scene, survey: QualityResult, tmp_path: Path) -> None:
    save_blend(survey, tmp_path / "survey.blend", display_vertices=10_000)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "survey.blend"))
    found = bpy.context.scene
    assert found.bim_verify.has_findings
    assert found.bim_verify.color_mode == survey_scene.MODE
    seen = 0
    for item in scene.element_objects(found).values():
        cause = np.empty(len(item.data.vertices), np.float32)
        item.data.attributes["bv_cause"].data.foreach_get("value", cause)
        color = np.empty(4 * len(cause), np.float32)
        item.data.attributes["bv_color"].data.foreach_get("color", color)
        green = color.reshape(-1, 4)[cause == 0]
        seen += len(green)
        assert np.all(green[:, 1] > green[:, 0])
    assert seen
    found.bim_verify.color_mode = "SPACING"
    assert overlay.legend(found).ramp is not None
