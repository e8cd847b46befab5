"""Rules that every operator keeps: why it cannot run, what it does and in which unit, undo, redo panel, one way to warn."""

from __future__ import annotations

import ast
import inspect
import re
from pathlib import Path

import bpy
import pytest

from bim_verify.bim_verify_addon import operators, photo_scene, survey_scene, wall_scene
from bim_verify.bim_verify_addon.capabilities import CAPABILITIES
from bim_verify.bim_verify_addon.jobs import Job
from bim_verify.bim_verify_addon.operators.file_browser import FileJob
from bim_verify.bim_verify_addon.session import SESSION, RunningJob

ONLY_WRITE_FILES = {
    "export_ifc", "export_bcf", "export_change", "export_quality", "export_plan",
    "report", "export_table", "export_dimensions", "export_ids", "export_templates",
    "update_model", "undo_update", "classify", "simulate", "write_facade",
    "export_displacement", "export_cameras",
}  # fmt: skip
"""They change nothing in the scene, so there is nothing to undo."""
WRITE_FOLDERS = {"report", "export_change", "export_quality", "export_plan", "export_cameras"}
NEED_NOTHING = {"import_ifc", "import_scan", "facade", "simulate", "export_templates", "bundle"}
SELECTION = {
    "verify": "selected_only", "plan": "selected_only", "export_bcf": "selected_only", "export_table": "selected_only",
    "change": "selected_only", "quality": "selected_only", "report": "selected_only", "export_ids": "selected_only",
    "export_dimensions": "selected_only",
    "decide": "", "select_findings": "", "step_finding": "", "isolate_findings": "",
}  # fmt: skip
"""Those that work on elements one by one; those without a setting always take the selection, or make one."""
UNITS = {"_mm": "millimetres", "_m": "metres", "_gb": "gigabytes", "_deg": "degrees", "_px": "pixels"}

every = pytest.mark.parametrize("cls", operators.CLASSES, ids=lambda cls: cls.bl_idname)
jobs = pytest.mark.parametrize("cls", [c for c in operators.CLASSES if issubclass(c, Job)], ids=lambda cls: cls.bl_idname)


def name_of(cls: type) -> str:
    return str(cls.bl_idname.removeprefix("bim_verify."))  # type: ignore[attr-defined]


def asked(cls: type) -> tuple[bool, list[str]]:
    """Whether it may run now, and what it says if not."""
    said: list[str] = []
    spy = type("Spy", (cls,), {"poll_message_set": staticmethod(said.append)})
    return bool(spy.poll(bpy.context)), said  # type: ignore[attr-defined]


def properties(cls: type) -> list[bpy.types.Property]:
    kind = getattr(bpy.ops.bim_verify, name_of(cls)).get_rna_type()
    return [p for p in kind.properties if not p.is_hidden and p.identifier != "rna_type"]


@every
def test_it_says_why_it_cannot_run(blender: bpy.types.Scene, cls: type) -> None:
    may, said = asked(cls)
    assert may == (name_of(cls) in NEED_NOTHING)
    assert may or (len(said) == 1 and len(said[0]) > 5 and said[0][0].isupper())


@jobs
def test_one_job_at_a_time(verified: bpy.types.Scene, cls: type) -> None:
    verified.bim_verify_displacement.base = verified.bim_verify_displacement.later = "x.e57"
    verified["bim_verify_facades"] = "{}"
    verified.bim_verify_change.result_key = SESSION.comparisons.keep(object())  # type: ignore[arg-type]
    verified[wall_scene.RESULT_KEY] = SESSION.walls.keep(None)  # type: ignore[arg-type]
    verified[survey_scene.SURVEY_KEY] = SESSION.surveys.keep(object())  # type: ignore[arg-type]
    verified[survey_scene.PLAN_KEY] = SESSION.plans.keep(object())  # type: ignore[arg-type]
    verified[photo_scene.RESULT_KEY] = SESSION.photos.keep(object())  # type: ignore[arg-type]
    assert asked(cls)[0]
    SESSION.job = RunningJob("Some work")
    try:
        assert asked(cls) == (False, ["Some work is running; wait for it or press Esc"])
    finally:
        SESSION.job = None


@every
def test_it_is_described(blender: bpy.types.Scene, cls: type) -> None:
    assert cls.__doc__ and cls.bl_label and len(cls.bl_description) > 20  # type: ignore[attr-defined]
    assert not cls.bl_description.endswith(".")  # type: ignore[attr-defined]  # Blender adds one
    for prop in properties(cls):
        assert prop.name and prop.description, prop.identifier


@every
def test_it_has_a_redo_panel_and_undo_where_it_changes_the_scene(cls: type) -> None:
    assert "REGISTER" in cls.bl_options  # type: ignore[attr-defined]
    assert ("UNDO" in cls.bl_options) == (name_of(cls) not in ONLY_WRITE_FILES)  # type: ignore[attr-defined]


@jobs
def test_a_file_is_asked_for_in_one_way(blender: bpy.types.Scene, cls: type) -> None:
    own = getattr(bpy.ops.bim_verify, name_of(cls)).get_rna_type().properties.keys()
    assert ("filepath" in own) == issubclass(cls, FileJob)
    writes = name_of(cls) in ONLY_WRITE_FILES | {"reconstruct"}
    assert ("check_existing" in own) == (writes and name_of(cls) not in WRITE_FOLDERS)


@every
def test_warnings_go_one_way(cls: type) -> None:
    source = inspect.getsource(cls)
    assert 'report({"WARNING"}' not in source


@pytest.mark.parametrize("name", SELECTION)
def test_it_works_on_all_or_on_the_selection(blender: bpy.types.Scene, name: str) -> None:
    kind = getattr(bpy.ops.bim_verify, name).get_rna_type()
    assert not SELECTION[name] or kind.properties[SELECTION[name]].type == "BOOLEAN"


def test_every_length_has_its_unit_in_the_tooltip(blender: bpy.types.Scene) -> None:
    groups = [(c.bl_idname, properties(c)) for c in operators.CLASSES]
    for owner in ("bim_verify", *(f"bim_verify_{c.name}" for c in CAPABILITIES if c.settings is not None)):
        groups.append((owner, [p for p in getattr(blender, owner).bl_rna.properties if p.type in ("FLOAT", "INT", "STRING")]))
    looked_at = 0
    for owner, members in groups:
        for prop in members:
            unit = next((word for end, word in UNITS.items() if prop.identifier.endswith(end)), "")
            if not unit and prop.type == "FLOAT" and prop.unit == "LENGTH":
                unit = "metres"
            if not unit and re.search(r"corners", prop.identifier):
                unit = "pixels"
            if unit:
                looked_at += 1
                assert unit in prop.description, f"{owner}.{prop.identifier}"
    assert looked_at > 10


def test_the_audit_sees_every_operator_of_the_package() -> None:
    found = set()
    folder = operators.__path__[0]
    for path in Path(folder).glob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        found |= {n.name for n in ast.walk(tree) if isinstance(n, ast.ClassDef) and n.name.startswith("BIMVERIFY_OT_")}
    assert found == {cls.__name__ for cls in operators.CLASSES}
