"""The operators in background: what they make in the scene and write to files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bpy
import ifcopenshell
import ifcopenshell.util.element
import numpy as np
import pytest

from bim_verify.bim_verify_addon import project, scene
from bim_verify.core.errors import BimVerifyError, Cancelled
from bim_verify.core.model.elements import BuildingModel
from bim_verify.core.report import palette
from bim_verify.core.results import STATUSES, VerificationResult

from ..core.factory import make_ifc
from .scene_facts import status_counts

ops = bpy.ops.bim_verify
Verification = Callable[[Callable[..., VerificationResult]], None]


def column(mesh: bpy.types.Mesh, name: str, width: int = 1) -> np.ndarray:
    values = np.empty(len(mesh.vertices) * width, dtype=np.float32)
    mesh.attributes[name].data.foreach_get("color" if width == 4 else "value", values)
    return values.reshape(-1, width) if width > 1 else values


def contents() -> dict[str, object]:
    """What a user would notice if it had changed."""
    settings = bpy.context.scene.bim_verify
    return {
        "objects": {
            o.name: (len(o.data.vertices), tuple(o.location), sorted(o.data.attributes.keys())) for o in bpy.data.objects
        },
        "meshes": sorted(m.name for m in bpy.data.meshes),
        "collections": sorted(c.name for c in bpy.data.collections),
        "settings": {k: str(settings[k]) for k in sorted(settings.keys()) if k not in ("scans", "counts")},
        "scans": [s.path for s in settings.scans],
        "counts": [(c.mode, c.category, c.count) for c in settings.counts],
        "frame": list(bpy.context.scene.get("bim_verify_frame", [])),
    }


@pytest.fixture
def prepared(blender: bpy.types.Scene, house: Path, scan: Path) -> bpy.types.Scene:
    assert ops.import_ifc(filepath=str(house)) == {"FINISHED"}
    assert ops.import_scan(filepath=str(scan)) == {"FINISHED"}
    blender.bim_verify.display_vertices = 10_000
    return blender


def test_import_ifc_makes_named_objects_in_storeys(blender: bpy.types.Scene, house: Path, house_model: BuildingModel) -> None:
    assert ops.import_ifc(filepath=str(house)) == {"FINISHED"}
    found = scene.element_objects(blender)
    assert set(found) == {e.global_id for e in house_model.elements}
    for element in house_model.elements:
        item = found[element.global_id]
        assert item.name == f"{element.ifc_class}/{element.name}"
        assert [c.name for c in item.users_collection] == [element.storey]
    bpy.context.view_layer.update()
    low = np.min([item.matrix_world @ v.co for item in found.values() for v in item.data.vertices], axis=0)
    assert low == pytest.approx([0.0, 0.0, -0.2], abs=1e-6)


def test_import_ifc_again_updates_in_place(blender: bpy.types.Scene, house: Path) -> None:
    ops.import_ifc(filepath=str(house))
    before = {g: o.as_pointer() for g, o in scene.element_objects(blender).items()}
    ops.import_ifc(filepath=str(house))
    assert {g: o.as_pointer() for g, o in scene.element_objects(blender).items()} == before
    assert len(bpy.data.meshes) == len(before)


def test_import_of_another_model_replaces_the_first(blender: bpy.types.Scene, house: Path, tmp_path: Path) -> None:
    ops.import_ifc(filepath=str(house))
    ops.import_ifc(filepath=str(make_ifc(tmp_path / "other.ifc")))
    assert len(scene.element_objects(blender)) == 5
    assert len(bpy.data.objects) == 5


def test_names_from_the_file_do_no_harm(blender: bpy.types.Scene, tmp_path: Path) -> None:
    names = ("<script>alert(1)</script>", "../../etc/passwd", "ä" * 300, "", "%s%n")
    assert ops.import_ifc(filepath=str(make_ifc(tmp_path / "h.ifc", names=names))) == {"FINISHED"}
    items = scene.element_objects(blender).values()
    assert len(items) == 5
    assert {item.bim_verify.element_name for item in items} == set(names)


def test_import_scan_is_a_coloured_cloud(blender: bpy.types.Scene, scan: Path) -> None:
    assert ops.import_scan(filepath=str(scan)) == {"FINISHED"}
    (item,) = scene.scan_objects(blender)
    mesh = item.data
    assert (len(mesh.vertices), len(mesh.edges), len(mesh.polygons)) == (2000, 0, 0)
    assert mesh.attributes["bv_color"].data_type == "FLOAT_COLOR"
    assert mesh.attributes["station"].data_type == "INT"
    bpy.context.view_layer.update()
    shown = np.array([item.matrix_world @ v.co for v in mesh.vertices])
    expected = np.loadtxt(scan)
    assert np.allclose(np.sort(shown, axis=0), np.sort(expected, axis=0), atol=1e-5)
    assert (blender.bim_verify.scans[0].points, blender.bim_verify.scans[0].stations) == (2000, 1)


def test_scan_is_thinned_for_display_only(blender: bpy.types.Scene, scan: Path) -> None:
    blender.bim_verify.display_points = 1000
    ops.import_scan(filepath=str(scan))
    assert len(scene.scan_objects(blender)[0].data.vertices) == 1000
    assert blender.bim_verify.scans[0].points == 2000


def test_scans_can_be_chosen_together_and_removed(blender: bpy.types.Scene, scan: Path, tmp_path: Path) -> None:
    (tmp_path / "a.xyz").write_bytes(scan.read_bytes())
    (tmp_path / "b.xyz").write_bytes(scan.read_bytes())
    ops.import_scan(directory=str(tmp_path), files=[{"name": "a.xyz"}, {"name": "b.xyz"}])
    assert [s.name for s in blender.bim_verify.scans] == ["a.xyz", "b.xyz"]
    ops.remove_scan()
    assert [s.name for s in blender.bim_verify.scans] == ["a.xyz"]
    assert len(scene.scan_objects(blender)) == 1


def test_verify_writes_the_attributes(
    prepared: bpy.types.Scene, result: VerificationResult, verification: Verification
) -> None:
    asked = []
    verification(lambda model, scans, options, progress: asked.append((scans, options)) or result)
    prepared.bim_verify.loa, prepared.bim_verify.sigma_mm = "20", 3.0
    assert ops.verify() == {"FINISHED"}
    ((scans, options),) = asked
    assert scans == [prepared.bim_verify.scans[0].path]
    assert (options.loa, options.sigma, options.align) == (20, pytest.approx(0.003), "none")

    found = scene.element_objects(prepared)
    assert len(found) == len(result.verdicts)
    for verdict in result.verdicts:
        item = found[verdict.global_id]
        mesh = item.data
        for name in ("bv_occupied", "bv_empty", "bv_unknown", "bv_deviation"):
            assert (mesh.attributes[name].data_type, mesh.attributes[name].domain) == ("FLOAT", "POINT")
        assert (mesh.attributes["bv_color"].data_type, mesh.attributes["bv_color"].domain) == ("FLOAT_COLOR", "POINT")
        assert mesh.color_attributes.active_color.name == "bv_color"
        assert mesh.color_attributes[mesh.color_attributes.render_color_index].name == "bv_color"
        occupied, empty, unknown = (column(mesh, n) for n in ("bv_occupied", "bv_empty", "bv_unknown"))
        assert np.allclose(occupied + empty + unknown, 1.0, atol=1e-5)
        assert unknown.mean() == pytest.approx(verdict.belief_unknown, abs=0.06)
        deviation = column(mesh, "bv_deviation")
        if verdict.deviation_median is None:
            assert np.isnan(deviation).all()
        else:
            assert np.nanmedian(deviation) == pytest.approx(verdict.deviation_median, abs=0.002)
        expected = palette.to_linear(palette.STATUS_COLORS[verdict.status])
        assert np.allclose(column(mesh, "bv_color", 4), [*expected, 1.0], atol=1e-6)
        assert item.bim_verify.status == verdict.status
        assert item.bim_verify.reason == verdict.reason
        assert item.bim_verify.coverage == pytest.approx(verdict.coverage, abs=1e-6)
    assert status_counts(prepared) == [(s, result.count(s)) for s in STATUSES]


def test_verify_takes_its_own_options_first(
    prepared: bpy.types.Scene, result: VerificationResult, verification: Verification
) -> None:
    asked = []
    verification(lambda model, scans, options, progress: asked.append(options) or result)
    ops.verify(loa="40", sigma_mm=1.0, align="fine")
    assert (asked[0].loa, asked[0].sigma, asked[0].align) == (40, pytest.approx(0.001), "fine")
    assert prepared.bim_verify.loa == "30"


def test_verify_again_leaves_no_old_meshes(
    prepared: bpy.types.Scene, result: VerificationResult, verification: Verification
) -> None:
    verification(lambda *_: result)
    ops.verify()
    before = sorted(m.name for m in bpy.data.meshes)
    ops.verify()
    assert sorted(m.name for m in bpy.data.meshes) == before


@pytest.mark.parametrize("mode", ["STATUS", "BELIEF", "DEVIATION", "LOA"])
def test_colour_modes_follow_the_attributes(
    prepared: bpy.types.Scene, result: VerificationResult, verification: Verification, mode: str
) -> None:
    verification(lambda *_: result)
    ops.verify()
    prepared.bim_verify.color_mode = mode
    deviating = next(v for v in result.verdicts if v.status == "DEVIATING")
    mesh = scene.element_objects(prepared)[deviating.global_id].data
    color = column(mesh, "bv_color", 4)[:, :3]
    if mode == "BELIEF":
        srgb = palette.belief_color(*(column(mesh, n) for n in ("bv_occupied", "bv_empty", "bv_unknown")))
    elif mode == "DEVIATION":
        srgb = palette.deviation_color(column(mesh, "bv_deviation"), 0.02)
    else:
        assert len(np.unique(color, axis=0)) == 1
        return
    assert np.allclose(color, palette.to_linear(srgb), atol=1e-5)


def test_select_findings_selects_these_and_no_others(
    prepared: bpy.types.Scene, result: VerificationResult, verification: Verification
) -> None:
    verification(lambda *_: result)
    ops.verify()
    ops.select_findings(category="ABSENT")
    expected = {v.global_id for v in result.verdicts if v.status == "ABSENT"}
    assert {o["GlobalId"] for o in bpy.context.selected_objects} == expected
    ops.select_findings(category="PARTIAL", extend=True)
    assert len(bpy.context.selected_objects) == len(expected) + result.count("PARTIAL")


def test_export_writes_the_property_sets_beside_an_untouched_source(
    prepared: bpy.types.Scene, house: Path, result: VerificationResult, verification: Verification, tmp_path: Path
) -> None:
    before = house.read_bytes()
    verification(lambda *_: result)
    ops.verify()
    assert ops.export_ifc(filepath=str(tmp_path / "out.ifc")) == {"FINISHED"}
    file = ifcopenshell.open(str(tmp_path / "out.ifc"))
    for verdict in result.verdicts:
        psets = ifcopenshell.util.element.get_psets(file.by_guid(verdict.global_id))
        assert psets["BimVerify_Verification"]["Status"] == verdict.status
    assert house.read_bytes() == before


def test_export_onto_the_source_is_refused(
    prepared: bpy.types.Scene, house: Path, result: VerificationResult, verification: Verification
) -> None:
    before = house.read_bytes()
    verification(lambda *_: result)
    ops.verify()
    with pytest.raises(RuntimeError, match=r"house\.ifc"):
        ops.export_ifc(filepath=str(house))
    assert house.read_bytes() == before


def test_results_survive_saving_and_loading(
    prepared: bpy.types.Scene, result: VerificationResult, verification: Verification, tmp_path: Path
) -> None:
    verification(lambda *_: result)
    ops.verify()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    opened = bpy.context.scene
    assert {o.bim_verify.status for o in scene.element_objects(opened).values()} == set(STATUSES)
    assert not ops.export_ifc.poll()
    assert ops.verify.poll()


def broken(error: Exception) -> Callable[..., VerificationResult]:
    def verify(*_: object) -> VerificationResult:
        raise error

    return verify


def test_a_failed_job_says_one_sentence_and_changes_nothing(prepared: bpy.types.Scene, verification: Verification) -> None:
    verification(broken(BimVerifyError("The scan lies 1 km off. Align it first.")))
    before = contents()
    with pytest.raises(RuntimeError, match="The scan lies 1 km off"):
        ops.verify()
    assert contents() == before


def test_a_cancelled_job_changes_nothing(prepared: bpy.types.Scene, verification: Verification) -> None:
    verification(broken(Cancelled()))
    before = contents()
    assert ops.verify() == {"CANCELLED"}
    assert contents() == before


@pytest.mark.parametrize("operator", ["import_ifc", "import_scan"])
@pytest.mark.parametrize("kind", ["missing", "rubbish", "folder", "unnamed"])
def test_bad_files_change_nothing(prepared: bpy.types.Scene, tmp_path: Path, operator: str, kind: str) -> None:
    path = tmp_path / "bad.e57"
    if kind == "rubbish":
        path.write_bytes(b"\0\1\2rubbish" * 100)
    elif kind == "folder":
        path.mkdir()
    before = contents()
    with pytest.raises(RuntimeError) as error:
        getattr(ops, operator)(filepath="" if kind == "unnamed" else str(path))
    assert "Traceback" not in str(error.value)
    assert contents() == before


def test_polls_say_what_is_missing(blender: bpy.types.Scene, house: Path) -> None:
    assert not ops.verify.poll()
    assert not ops.align.poll()
    assert not ops.export_ifc.poll()
    assert not ops.remove_scan.poll()
    with pytest.raises(RuntimeError, match="Import an IFC model first"):
        ops.verify()
    ops.import_ifc(filepath=str(house))
    with pytest.raises(RuntimeError, match="Add at least one scan first"):
        ops.verify()
    with pytest.raises(RuntimeError, match="Verify first"):
        ops.export_ifc(filepath="x.ifc")


def test_a_bad_scanner_position_is_explained(prepared: bpy.types.Scene) -> None:
    prepared.bim_verify.origin = "over there"
    with pytest.raises(RuntimeError, match="takes three numbers X,Y,Z in metres"):
        ops.verify()


def test_each_of_several_clouds_has_its_own_scanner_position(prepared: bpy.types.Scene, tmp_path: Path) -> None:
    for given in (None, (1.5, -2.0, 1.7), {"a.xyz": (1.0, 2.0, 3.0), "/b c.xyz": (4.0, 5.0, -6.0)}):
        assert project.scanner_position(project.in_text(given)) == given
    assert project.scanner_position("1;2;3") == (1.0, 2.0, 3.0)
    clouds = [str(tmp_path / name) for name in ("a.xyz", "b.xyz")]
    for path in clouds:
        Path(path).write_text("1 2 3\n2 2 3\n3 2 3\n")
        prepared.bim_verify.scans.add().path = path
    prepared.bim_verify.origin = "0,0,1"
    with pytest.raises(RuntimeError, match=r"a.xyz, b.xyz name no scanner position, and one was given for all of them"):
        ops.verify()
