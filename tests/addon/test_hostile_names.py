"""An IFC whose names are scripts, paths, formulas and formats does no harm in any export, nor in the scene."""

from __future__ import annotations

import csv
import io
import re
import uuid
import zipfile
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import bpy
import ifcopenshell
import pytest
from bcf.bcfxml import load

from bim_verify.bim_verify_addon import overlay, scene
from bim_verify.bim_verify_addon.headless import save_blend
from bim_verify.core.model.load import load_model
from bim_verify.core.results import VerificationResult

from ..core.factory import fabricate, make_ifc

ops = bpy.ops.bim_verify
Verification = Callable[[Callable[..., VerificationResult]], None]
NAMES = ("<script>alert(1)</script>", "../../x", "%s%n{0}{{7*7}}", "=1+1", "/tmp/y\\z\"]]>&amp;")
REASON = "=HYPERLINK(\"http://evil\") <img src=x onerror=alert(1)>"
EXPORTS = {
    "export_ifc": "a.ifc", "export_bcf": "a.bcf", "export_table": "a.xlsx", "export_ids": "a.ids",
    "export_templates": "t.ifc", "report": "r",
}  # fmt: skip


@pytest.fixture
def exported(blender: bpy.types.Scene, scan: Path, tmp_path: Path, verification: Verification) -> Path:
    """A folder with every export of a hostile model, one verdict overruled for a hostile reason."""
    house = make_ifc(tmp_path / "h.ifc", names=NAMES)
    made = fabricate(load_model(house, cache=False, threads=1))
    verification(lambda *_: made)
    blender.bim_verify.display_vertices = 10_000
    ops.import_ifc(filepath=str(house))
    ops.import_scan(filepath=str(scan))
    ops.verify()
    for item in scene.element_objects(blender).values():
        item.select_set(item.bim_verify.status == "CONFIRMED")
    assert ops.decide(status="DEVIATING", reason=REASON, author="</td><script>") == {"FINISHED"}
    out = tmp_path / "out"
    out.mkdir()
    for operator, name in EXPORTS.items():
        assert getattr(ops, operator)(filepath=str(out / name)) == {"FINISHED"}
    assert ops.export_table(filepath=str(out / "a.csv")) == {"FINISHED"}
    assert sorted(p.name for p in tmp_path.iterdir()) == ["h.ifc", "out"]
    assert sorted(p.name for p in out.iterdir()) == sorted([*EXPORTS.values(), "a.csv"])
    return out


def test_no_export_runs_or_goes_where_a_name_says(exported: Path) -> None:
    page = (exported / "r" / "index.html").read_text(encoding="utf-8")
    assert sorted(p.name for p in (exported / "r").iterdir()) == ["elements.csv", "index.html"]
    assert "<script>alert" not in page
    assert "<img src=x" not in page
    assert len(re.findall("<script", page)) == 2  # the data and our own

    written = ifcopenshell.open(str(exported / "a.ifc"))
    assert set(NAMES) == {e.Name for e in written.by_type("IfcElement")}

    with load(exported / "a.bcf") as book:
        titles = " ".join(t.topic.title for t in book.topics.values())
    assert "<script>alert(1)</script>" in titles
    with zipfile.ZipFile(exported / "a.bcf") as archive:
        for name in archive.namelist():
            assert ".." not in name
            assert not name.startswith("/")
            if "/" in name:
                uuid.UUID(name.split("/")[0])
            if name.endswith((".bcf", ".bcfv", ".xml", ".version")):
                ElementTree.fromstring(archive.read(name))

    for table in (exported / "a.csv", exported / "r" / "elements.csv"):
        rows = list(csv.reader(io.StringIO(table.read_text(encoding="utf-8-sig"))))
        assert not [cell for row in rows for cell in row if cell.startswith(("=", "+", "@")) or "\n=" in cell]
    with zipfile.ZipFile(exported / "a.xlsx") as book:
        text = "".join(book.read(n).decode() for n in book.namelist() if n.endswith((".xml", ".rels")))
    assert "<f>" not in text
    assert "<hyperlink" not in text

    ElementTree.parse(exported / "a.ids")
    ifcopenshell.open(str(exported / "t.ifc"))


def test_the_scene_keeps_them_as_texts(blender: bpy.types.Scene, tmp_path: Path) -> None:
    made = fabricate(load_model(make_ifc(tmp_path / "h.ifc", names=NAMES), cache=False, threads=1))
    save_blend(made, tmp_path / "saved.blend", display_vertices=10_000)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["h.ifc", "saved.blend"]
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    items = scene.element_objects(bpy.context.scene)
    assert {item.bim_verify.element_name for item in items.values()} == set(NAMES)
    assert not bpy.data.texts
    assert not [driver for item in items.values() if item.animation_data for driver in item.animation_data.drivers]
    for item in items.values():
        bpy.context.view_layer.objects.active = item
        assert item.bim_verify.element_name in overlay.numbers(bpy.context)[0]
