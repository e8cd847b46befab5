"""Plan, simulate and survey from inside Blender: markers, an organised scan with its truth, elements coloured by cause."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

bpy = pytest.importorskip("bpy")

import ifcopenshell  # noqa: E402
import ifcopenshell.util.element  # noqa: E402
import numpy as np  # noqa: E402

from bim_verify.bim_verify_addon import forecast_scene, overlay, scene, survey_scene  # noqa: E402
from bim_verify.bim_verify_addon.capabilities import MODES  # noqa: E402
from bim_verify.bim_verify_addon.text import percent  # noqa: E402
from bim_verify.core.quality import prediction  # noqa: E402
from bim_verify.core.report import palette  # noqa: E402
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


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def sets_of(path: Path, name: str) -> dict[str, dict[str, object]]:
    """GlobalId -> the property set ``name``, of the elements that have it."""
    file = ifcopenshell.open(str(path))
    found = {e.GlobalId: ifcopenshell.util.element.get_psets(e) for e in file.by_type("IfcElement")}
    return {key: sets[name] for key, sets in found.items() if name in sets}


def stations(target: bpy.types.Scene, planned: bool) -> list[bpy.types.Object]:
    return [i for i in target.objects if survey_scene.STATION_KEY in i and bool(i["planned"]) == planned]


def forecast_is_shown(target: bpy.types.Scene) -> None:
    """Every element has the colour of what the plan is expected to give, and its numbers."""
    assert target.bim_verify.color_mode == forecast_scene.MODE
    items = list(scene.element_objects(target).values())
    kinds = {item.bim_verify_plan.kind for item in items}
    assert forecast_scene.REACHED in kinds and kinds <= {category.identifier for category in MODES["FORECAST"].categories}
    shown = dict(overlay.legend(target).swatches)
    for category in MODES["FORECAST"].categories:
        count = sum(item.bim_verify_plan.kind == category.identifier for item in items)
        assert shown[f"{category.label}  {count}"] == category.color
    for item in items:
        color = np.empty(4 * len(item.data.vertices), np.float32)
        item.data.attributes["bv_color"].data.foreach_get("color", color)
        wanted = next(c.color for c in MODES["FORECAST"].categories if c.identifier == item.bim_verify_plan.kind)
        assert np.allclose(color.reshape(-1, 4)[:, :3], palette.to_linear(wanted), atol=0.01)
    item = next(i for i in items if i.bim_verify_plan.kind == forecast_scene.REACHED)
    bpy.context.view_layer.objects.active = item
    text = "\n".join(overlay.numbers(bpy.context))
    assert f"LOA10 with set-up {item.bim_verify_plan.set_up}" in text
    assert f"Measured, expected: {percent(item.bim_verify_plan.coverage)}" in text
    assert item.bim_verify_plan.coverage > item.bim_verify_plan.target * 0.999
    target.bim_verify.color_mode = "PLANNED"
    assert overlay.legend(target).ramp is not None


def test_another_model_takes_the_forecast_away(blender: bpy.types.Scene, house: Path, tmp_path: Path) -> None:
    bpy.ops.bim_verify.import_ifc(filepath=str(house))
    bpy.ops.bim_verify.plan(loa="10", scanner="fast", coverage=0.5)
    assert blender.bim_verify.has_findings
    (tmp_path / "other.ifc").write_bytes(house.read_bytes() + b"\n")
    bpy.ops.bim_verify.import_ifc(filepath=str(tmp_path / "other.ifc"))
    assert not blender.bim_verify.has_findings
    forecasts = [item.bim_verify_plan for item in scene.element_objects(blender).values()]
    assert forecasts and not any(forecast.plan_loa or forecast.kind for forecast in forecasts)


def test_from_a_plan_to_a_simulated_scan_to_its_quality(blender: bpy.types.Scene, house: Path, tmp_path: Path) -> None:
    blender.bim_verify.model_path = str(house)
    assert bpy.ops.bim_verify.plan(loa="10", scanner="fast", coverage=0.5) == {"FINISHED"}
    planned = stations(blender, True)
    assert planned and all(len(i.data.vertices) > 10 for i in planned)
    assert f"{len(planned)} set-up" in blender[survey_scene.SUMMARY_KEY]
    forecast_is_shown(blender)

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

    folder = tmp_path / "quality"
    assert bpy.ops.bim_verify.export_quality(filepath=str(folder)) == {"FINISHED"}
    assert names(folder) == ["patches.csv", "quality.json", "report", "samples.ply", "surveyed.ifc"]
    assert set(sets_of(folder / "surveyed.ifc", "BimVerify_ScanQuality")) == set(elements)
    assert bpy.ops.bim_verify.export_plan(filepath=str(tmp_path / "plan")) == {"FINISHED"}
    assert names(tmp_path / "plan") == ["planned.ifc", "report", "stations.csv", "stations.json"]
    assert len(json.loads((tmp_path / "plan" / "stations.json").read_text())["stations"]) == len(planned)
    survey_scene.forget(blender)
    assert not bpy.ops.bim_verify.export_quality.poll() and not bpy.ops.bim_verify.export_plan.poll()


def test_the_quality_of_the_selection_leaves_the_others(blender: bpy.types.Scene, house: Path, tmp_path: Path) -> None:
    bpy.ops.bim_verify.import_ifc(filepath=str(house))
    camera = bpy.data.objects.new("eye", bpy.data.cameras.new("eye"))
    camera.location = (2.0, 1.5, 1.4)
    blender.collection.objects.link(camera)
    blender.camera = camera
    out = tmp_path / "scene.e57"
    assert bpy.ops.bim_verify.simulate(filepath=str(out), scanner="fast") == {"FINISHED"}
    bpy.ops.bim_verify.import_scan(filepath=str(out))
    items = scene.element_objects(blender)
    one, other = list(items)[:2]
    for key, item in items.items():
        item.select_set(key == one)
    assert bpy.ops.bim_verify.quality(loa="10", selected_only=True) == {"FINISHED"}
    assert [key for key, item in items.items() if "bim_verify_quality" in item] == [one]
    for key, item in items.items():
        item.select_set(key == other)
    assert bpy.ops.bim_verify.quality(loa="20", selected_only=True) == {"FINISHED"}
    assert bpy.ops.bim_verify.export_ifc(filepath=str(tmp_path / "out.ifc")) == {"FINISHED"}
    found = sets_of(tmp_path / "out.ifc", "BimVerify_ScanQuality")
    assert set(found) == {one, other}


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
