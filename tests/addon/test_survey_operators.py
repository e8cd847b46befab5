"""Plan, simulate and survey from inside Blender: markers, an organised scan with its truth, elements coloured by cause."""

from __future__ import annotations

from pathlib import Path

import pytest

bpy = pytest.importorskip("bpy")

import numpy as np  # noqa: E402

from bim_verify.bim_verify_addon import scene, survey_scene  # noqa: E402
from bim_verify.core.quality import prediction  # noqa: E402
from bim_verify.core.scans.open import open_scans  # noqa: E402
from bim_verify.core.simulation.return_truth import MIXED, OWNER, TRUE_RANGE, read_truth  # noqa: E402
from bim_verify.core.simulation.scanner import PRESETS, Scanner  # noqa: E402


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """A coarse scanner, and one table of errors for all sizes."""
    table = prediction.ErrorTable(*(np.full((len(prediction.SPACINGS_M), len(prediction.NOISES_M)), 0.002) for _ in range(2)))
    monkeypatch.setattr(prediction, "make_table", lambda width, height: table)
    monkeypatch.setattr(prediction, "_made", {})
    monkeypatch.setitem(PRESETS, "fast", Scanner("fast", np.radians(1.0), sigma_range=0.001))


def stations(target: bpy.types.Scene, planned: bool) -> list[bpy.types.Object]:
    return [i for i in target.objects if survey_scene.STATION_KEY in i and bool(i["planned"]) == planned]


def test_from_a_plan_to_a_simulated_scan_to_its_quality(blender: bpy.types.Scene, house: Path, tmp_path: Path) -> None:
    blender.bim_verify.model_path = str(house)
    assert bpy.ops.bim_verify.plan(loa="10", scanner="fast", coverage=0.5) == {"FINISHED"}
    planned = stations(blender, True)
    assert planned and all(len(i.data.vertices) > 10 for i in planned)
    assert f"{len(planned)} set-up" in blender[survey_scene.SUMMARY_KEY]

    out = tmp_path / "scene.e57"
    assert bpy.ops.bim_verify.simulate(filepath=str(out), scanner="fast") == {"FINISHED"}
    source = open_scans([out])
    assert len(source.stations) == len(planned) and all(s.grid is not None for s in source.stations)
    truth = read_truth(out, 0)
    first = next(b for b in source.blocks() if b.station == 0)
    assert set(truth) == {OWNER, MIXED, TRUE_RANGE}
    away = np.linalg.norm(first.offsets, axis=1) - truth[TRUE_RANGE][: len(first.offsets)]
    assert np.abs(np.median(away)) < 0.001

    entry = blender.bim_verify.scans.add()
    entry.path, entry.use = str(out), True
    assert bpy.ops.bim_verify.quality(loa="10") == {"FINISHED"}
    assert len(stations(blender, False)) == len(planned) == len(stations(blender, True))
    elements = scene.element_objects(blender)
    covered = [item["bim_verify_coverage"] for item in elements.values()]
    assert max(covered) > 0.3
    mesh = max(elements.values(), key=lambda item: item["bim_verify_coverage"]).data
    assert {survey_scene.COVERED, survey_scene.SPACING, scene.COLOR} <= set(mesh.attributes.keys())
    assert all(item["bim_verify_quality"] for item in elements.values())


def test_any_scene_can_be_scanned_from_its_camera(blender: bpy.types.Scene, tmp_path: Path) -> None:
    bpy.ops.mesh.primitive_cube_add(size=4.0)
    camera = bpy.data.objects.new("eye", bpy.data.cameras.new("eye"))
    blender.collection.objects.link(camera)
    blender.camera = camera
    out = tmp_path / "cube.e57"
    assert bpy.ops.bim_verify.simulate(filepath=str(out), scanner="fast", seed=3) == {"FINISHED"}
    source = open_scans([out])
    point = np.concatenate([b.offsets + source.stations[0].position for b in source.blocks()])
    assert len(point) > 20_000
    assert np.abs(np.abs(point).max(axis=1) - 2.0).max() < 0.02


def test_a_scene_without_anything_to_scan_is_refused(blender: bpy.types.Scene, tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="no mesh"):
        bpy.ops.bim_verify.simulate(filepath=str(tmp_path / "no.e57"))
    assert not (tmp_path / "no.e57").exists()
