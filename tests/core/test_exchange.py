"""BCF, IDS, workbook and templates: read back by the libraries of the field, passing and failing where they should."""

from __future__ import annotations

import csv
import io
import re
import zipfile
from dataclasses import replace
from pathlib import Path

import ifcopenshell
import ifcopenshell.api.pset
import numpy as np
import pytest
from bcf.bcfxml import load
from ifctester import ids
from PIL import Image

import bim_verify
from bim_verify.core.errors import BimVerifyError
from bim_verify.core.exchange.bcf import Version, write_bcf
from bim_verify.core.exchange.findings import findings
from bim_verify.core.exchange.ids import write_ids
from bim_verify.core.exchange.viewpoint import finding_camera
from bim_verify.core.exchange.xlsx import write_xlsx
from bim_verify.core.model.elements import BuildingModel
from bim_verify.core.model.load import load_model
from bim_verify.core.model.pset_definitions import TEMPLATES
from bim_verify.core.model.pset_templates import write_templates
from bim_verify.core.model.raycast import RayScene
from bim_verify.core.model.sample_surface import sample_surface
from bim_verify.core.model.samples import SurfaceSamples
from bim_verify.core.model.write_psets import verification_properties, write_verified_ifc
from bim_verify.core.report.csv_out import HEADER, elements_csv
from bim_verify.core.results import Decision, VerificationResult

from . import verify_data
from .factory import fabricate, make_ifc

HOSTILE = ("<script>alert(1)</script>", "../../etc/passwd", "=cmd|' /C calc'!A0", "a\x00\x08b & \"c\" ]]>", "C:\\" + "ä" * 500)


@pytest.fixture(scope="module")
def house(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_ifc(tmp_path_factory.mktemp("exchange") / "house.ifc")


@pytest.fixture(scope="module")
def result(house: Path) -> VerificationResult:
    return fabricate(load_model(house, cache=False, threads=1))


@pytest.fixture(scope="module")
def hostile(result: VerificationResult) -> VerificationResult:
    verdicts = tuple(replace(v, name=n, storey=n) for v, n in zip(result.verdicts, HOSTILE, strict=True))
    return replace(result, verdicts=verdicts)


@pytest.mark.parametrize("version", ["3.0", "2.1"])
def test_bcf_is_read_back_with_camera_picture_and_guid(result: VerificationResult, tmp_path: Path, version: str) -> None:
    path = tmp_path / "findings.bcf"
    count = write_bcf(path, result, version=version)
    expected = {f.verdict.global_id: f for f in findings(result)}
    assert count == len(expected) == 3
    with load(path) as book:
        assert book.version.version_id == version
        assert len(book.topics) == count
        for handler in book.topics.values():
            (view,) = handler.viewpoints.values()
            (component,) = view.visualization_info.components.selection.component
            finding = expected.pop(component.ifc_guid)
            assert handler.topic.title == finding.title
            assert finding.verdict.reason in handler.topic.description
            camera = view.visualization_info.orthogonal_camera
            eye = np.array([camera.camera_view_point.x, camera.camera_view_point.y, camera.camera_view_point.z])
            ahead = np.array([camera.camera_direction.x, camera.camera_direction.y, camera.camera_direction.z])
            up = np.array([camera.camera_up_vector.x, camera.camera_up_vector.y, camera.camera_up_vector.z])
            assert abs(ahead @ up) < 1e-9
            model = result.model
            own = model.triangles[model.triangle_start[finding.row] : model.triangle_start[finding.row + 1]]
            corners = model.vertices[own].reshape(-1, 3)
            middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0)) + model.origin
            assert np.linalg.norm(np.cross(middle - eye, ahead)) < 1e-6
            assert (middle - eye) @ ahead > 0
            assert Image.open(io.BytesIO(view.snapshot)).size == (480, 360)
    assert not expected


def test_bcf_of_the_same_finding_keeps_its_topic(result: VerificationResult, tmp_path: Path) -> None:
    for name in ("a.bcf", "b.bcf"):
        write_bcf(tmp_path / name, result, pictures=False)
    with load(tmp_path / "a.bcf") as a, load(tmp_path / "b.bcf") as b:
        assert set(a.topics) == set(b.topics)


@pytest.mark.parametrize("version", ["3.0", "2.1"])
def test_bcf_says_which_model_and_which_day(result: VerificationResult, tmp_path: Path, version: Version) -> None:
    write_bcf(tmp_path / "f.bcf", result, version=version, pictures=False)
    project = ifcopenshell.open(result.model.path).by_type("IfcProject")[0].GlobalId
    with load(tmp_path / "f.bcf") as book:
        for handler in book.topics.values():
            files = handler.header.files.file if version == "3.0" else handler.header.file
            assert [(f.filename, f.ifc_project) for f in files] == [("house.ifc", project)] and files[0].date is not None
            made, changed = (str(handler.topic.creation_date), str(handler.topic.modified_date))
            assert made.startswith("2024-05-01") and changed > made


def test_bcf_takes_no_path_and_no_markup_from_names(hostile: VerificationResult, tmp_path: Path) -> None:
    path = tmp_path / "findings.bcf"
    write_bcf(path, hostile, statuses=("CONFIRMED", "DEVIATING", "ABSENT", "PARTIAL", "NOTOBSERVED"))
    safe = set("0123456789abcdef-")
    names = zipfile.ZipFile(path).namelist()
    for name in names:
        parts = name.strip("/").split("/")
        assert name in ("bcf.version", "project.bcfp", "extensions.xml") or set(parts[0]) <= safe
        assert len(parts) == 1 or parts[1] == "markup.bcf" or set(parts[1].rsplit(".", 1)[0]) <= safe
    with load(path) as book:
        titles = " ".join(t.topic.title for t in book.topics.values())
    assert "<script>alert(1)</script>" in titles
    assert "../../etc/passwd" in titles
    assert [p.name for p in tmp_path.iterdir()] == ["findings.bcf"]


def seen_share(model: BuildingModel, samples: SurfaceSamples, row: int, scene: RayScene) -> float:
    """Of the samples of an element that face its camera, how many are seen in the picture."""
    mine = (samples.element == row) & samples.exposed
    camera = finding_camera(model, row, samples.position[mine], samples.normal[mine], scene, 4 / 3)
    facing = samples.position[mine][samples.normal[mine] @ camera.forward < -0.1]
    depth = (facing - camera.center) @ camera.forward + camera.reach
    _, triangle = scene.first_hit(facing - depth[:, None] * camera.forward, np.tile(camera.forward, (len(facing), 1)))
    return float(((model.triangle_element[triangle] == row) & (depth > 0)).mean())


def test_bcf_camera_sees_the_element(result: VerificationResult) -> None:
    scene = RayScene(result.model)
    for row, verdict in enumerate(result.verdicts):
        assert seen_share(result.model, result.samples, row, scene) > 0.5, verdict.name


def test_bcf_camera_looks_into_rooms_and_up_to_ceilings() -> None:
    """The slab over both rooms, the ceiling under it, what stands in the rooms."""
    model = verify_data.house()
    scene, samples = RayScene(model), sample_surface(model, 0.2)
    for name in ("slab", "ceiling", "floor", "partition", "column", "cupboard", "plate", "valve"):
        row = next(k for k, e in enumerate(model.elements) if e.name == name)
        assert seen_share(model, samples, row, scene) > 0.7, name


def test_a_decision_counts_in_the_findings(result: VerificationResult) -> None:
    absent = next(v for v in result.verdicts if v.status == "ABSENT")
    confirmed = next(v for v in result.verdicts if v.status == "CONFIRMED")
    decided = replace(result, decisions={
        absent.global_id: Decision("CONFIRMED", "behind the shelf", "A. Modeller", "2026-01-02", "ABSENT"),
        confirmed.global_id: Decision("DEVIATING", "cracked", "A. Modeller", "2026-01-02", "CONFIRMED"),
    })  # fmt: skip
    found = {f.verdict.global_id: f for f in findings(decided)}
    assert absent.global_id not in found
    assert "Decided by A. Modeller" in found[confirmed.global_id].text


def test_unknown_bcf_version_and_place_are_refused(result: VerificationResult, tmp_path: Path) -> None:
    with pytest.raises(BimVerifyError, match="choose"):
        write_bcf(tmp_path / "x.bcf", result, version="1.0")  # type: ignore[arg-type]
    with pytest.raises(BimVerifyError, match="does not exist"):
        write_bcf(tmp_path / "nowhere" / "x.bcf", result)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("schema", ["IFC2X3", "IFC4", "IFC4X3_ADD2"])
def test_ids_passes_and_fails_where_it_should(tmp_path: Path, schema: str) -> None:
    house = make_ifc(tmp_path / "house.ifc", schema=schema)
    result = fabricate(load_model(house, cache=False, threads=1))
    write_ids(tmp_path / "check.ids", result)
    write_verified_ifc(house, result, tmp_path / "verified.ifc")
    check = ids.open(str(tmp_path / "check.ids"), validate=True)
    file = ifcopenshell.open(str(tmp_path / "verified.ifc"))
    given, reached = check.specifications
    check.validate(file)
    assert given.status is True
    assert {e.GlobalId for e in given.applicable_entities} == {v.global_id for v in result.verdicts}
    assert reached.status is False
    bad = {v.global_id for v in result.verdicts if v.achieved_loa not in ("LOA30", "LOA40", "LOA50")}
    assert {e.GlobalId for e in reached.failed_entities} == bad

    good = replace(result, verdicts=tuple(replace(v, achieved_loa="LOA40") for v in result.verdicts))
    write_verified_ifc(house, good, tmp_path / "good.ifc")
    check.validate(ifcopenshell.open(str(tmp_path / "good.ifc")))
    assert [s.status for s in check.specifications] == [True, True]

    check.validate(ifcopenshell.open(str(house)))
    assert given.status is False


def test_ids_asks_nothing_of_a_layered_wall_whose_parts_have_the_bodies(tmp_path: Path) -> None:
    house = make_ifc(tmp_path / "house.ifc")
    file = ifcopenshell.open(str(house))
    wall = file.by_type("IfcWall")[0]
    whole = ifcopenshell.api.run("root.create_entity", file, ifc_class="IfcWall", name="Layered")
    part = ifcopenshell.api.run("root.create_entity", file, ifc_class="IfcBuildingElementPart", name="Layer")
    part.Representation, part.ObjectPlacement = wall.Representation, wall.ObjectPlacement
    ifcopenshell.api.run("aggregate.assign_object", file, products=[part], relating_object=whole)
    file.write(str(tmp_path / "layered.ifc"))
    found = fabricate(load_model(tmp_path / "layered.ifc", cache=False, threads=1))
    assert found.model.partly == ("IfcWall",)
    good = replace(found, verdicts=tuple(replace(v, achieved_loa="LOA40") for v in found.verdicts))
    write_ids(tmp_path / "check.ids", good)
    write_verified_ifc(tmp_path / "layered.ifc", good, tmp_path / "good.ifc")
    check = ids.open(str(tmp_path / "check.ids"), validate=True)
    check.validate(ifcopenshell.open(str(tmp_path / "good.ifc")))
    assert [s.status for s in check.specifications] == [True, True, True]
    check.validate(ifcopenshell.open(str(tmp_path / "layered.ifc")))
    assert [len(s.failed_entities) for s in check.specifications[:2]] == [3, 3]


def test_bcf_holds_two_elements_of_one_globalid_and_any_characters_in_it(
    result: VerificationResult, tmp_path: Path
) -> None:
    same = tuple(replace(v, global_id="<b>\x01x", status="ABSENT") for v in result.verdicts)
    count = write_bcf(tmp_path / "f.bcf", replace(result, verdicts=same), pictures=False)
    with load(tmp_path / "f.bcf") as archive:
        assert len(archive.topics) == count == len(same)


def test_workbook_holds_every_element_and_runs_nothing(hostile: VerificationResult, tmp_path: Path) -> None:
    path = tmp_path / "elements.xlsx"
    write_xlsx(path, hostile)
    with zipfile.ZipFile(path) as book:
        sheet = book.read("xl/worksheets/sheet1.xml").decode()
        texts = book.read("xl/sharedStrings.xml").decode()
        everything = "".join(book.read(name).decode() for name in book.namelist() if name.endswith((".xml", ".rels")))
    assert sheet.count("<row ") == len(hostile.verdicts) + 1
    assert "<f>" not in everything
    assert "hyperlink" not in everything
    assert "&lt;script&gt;" in texts
    assert "\x08" not in texts


def test_csv_has_the_decision_and_guards_formulas(hostile: VerificationResult) -> None:
    absent = next(v for v in hostile.verdicts if v.status == "ABSENT")
    decision = Decision("CONFIRMED", "=1+1", "me", "2026-01-02", "ABSENT")
    text = elements_csv(replace(hostile, decisions={absent.global_id: decision})).decode("utf-8-sig")
    rows = list(csv.DictReader(io.StringIO(text)))
    assert list(rows[0]) == list(HEADER)
    row = next(r for r in rows if r["GlobalId"] == absent.global_id)
    assert (row["Decided"], row["DecidedBy"], row["DecisionReason"]) == ("CONFIRMED", "me", "'=1+1")
    assert all(not r["Name"].startswith("=") for r in rows)


def test_templates_describe_every_property_that_is_written(result: VerificationResult, tmp_path: Path) -> None:
    write_templates(tmp_path / "templates.ifc")
    file = ifcopenshell.open(str(tmp_path / "templates.ifc"))
    found = {t.Name: t for t in file.by_type("IfcPropertySetTemplate")}
    assert set(found) == set(TEMPLATES)
    written = {n: kind for n, (kind, _) in verification_properties(result.verdicts[0], "", "", "").items()}
    described = {p.Name: p.PrimaryMeasureType for p in found["BimVerify_Verification"].HasPropertyTemplates}
    assert described == written
    assert all(p.Description for t in found.values() for p in t.HasPropertyTemplates)
    lengths = [p for t in found.values() for p in t.HasPropertyTemplates if p.PrimaryMeasureType == "IfcLengthMeasure"]
    assert all("unit of length" in p.Description for p in lengths)


def test_every_set_of_the_code_has_a_template() -> None:
    """What each command writes is held against its template where that command is tested (``check_templates``)."""
    core = Path(bim_verify.__file__).parent / "core"
    named = {name for path in core.rglob("*.py") for name in re.findall(r'"(BimVerify_[A-Za-z]+)"', path.read_text("utf-8"))}
    assert named == set(TEMPLATES)


def test_templates_cannot_be_written_as_ifc2x3(tmp_path: Path) -> None:
    with pytest.raises(BimVerifyError, match="IFC2X3"):
        write_templates(tmp_path / "old.ifc", schema="IFC2X3")
