"""Enable and disable: all there, nothing left."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import bpy
import pytest

import bim_verify
from bim_verify.bim_verify_addon import operators, panels


def traces() -> dict[str, object]:
    names = [n for n in dir(bpy.types) if "BIM_VERIFY" in n.upper().replace("BIMVERIFY", "BIM_VERIFY")]
    handlers = {
        k: [str(h) for h in getattr(bpy.app.handlers, k)]
        for k in dir(bpy.app.handlers)
        if isinstance(getattr(bpy.app.handlers, k), list)
    }
    return {
        "types": names,
        "ops": dir(bpy.ops.bim_verify),
        "scene": hasattr(bpy.types.Scene, "bim_verify"),
        "object": hasattr(bpy.types.Object, "bim_verify"),
        "handlers": handlers,
    }


def test_unregister_leaves_nothing() -> None:
    before = traces()
    bim_verify.register()
    during = traces()
    bim_verify.unregister()
    assert traces() == before
    assert during["scene"]
    assert during["object"]
    assert {"import_ifc", "import_scan", "align", "verify", "export_ifc"} <= set(during["ops"])  # type: ignore[arg-type]


def test_register_twice_in_a_row_works() -> None:
    for _ in range(2):
        bim_verify.register()
        bim_verify.unregister()


def test_every_operator_can_explain_itself(blender: bpy.types.Scene) -> None:
    for cls in operators.CLASSES:
        assert any("poll" in base.__dict__ for base in cls.__mro__ if base is not bpy.types.Operator)
        assert "REGISTER" in cls.bl_options
        kind = getattr(bpy.ops.bim_verify, cls.bl_idname.removeprefix("bim_verify.")).get_rna_type()
        assert kind.description
        for prop in kind.properties:
            hidden = prop.is_hidden or prop.identifier == "rna_type"
            assert hidden or prop.description, f"{cls.bl_idname}.{prop.identifier} has no tooltip"


def test_every_setting_has_a_tooltip(blender: bpy.types.Scene) -> None:
    shown = (
        "loa",
        "sigma_mm",
        "align",
        "spacing_mm",
        "fusion",
        "scan_frame",
        "origin",
        "threads",
        "memory_gb",
        "color_mode",
    )
    kind = blender.bim_verify.bl_rna
    for name in (*shown, "display_points", "display_vertices", "deviation_range_mm", "show_legend"):
        assert kind.properties[name].description, name


def test_no_key_of_ours_is_also_a_property_group(blender: bpy.types.Scene) -> None:
    """Before 5.0 Blender keeps both in one place: whichever is written later takes the other away."""
    keys: set[str] = set()
    for path in Path(panels.__file__).parent.parent.rglob("*.py"):
        for found in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(found, ast.Assign) and "_KEY" in ast.unparse(found.targets[0]):
                keys |= {n.value for n in ast.walk(found.value) if isinstance(n, ast.Constant) and isinstance(n.value, str)}
    assert len(keys) > 10
    groups = {name for name in dir(bpy.types.Object) if name.startswith("bim_verify")}
    assert groups >= {"bim_verify", "bim_verify_facade", "bim_verify_plan"}
    assert not keys & groups


def test_panels_share_one_tab() -> None:
    tabs = {cls.bl_category for cls in panels.CLASSES if issubclass(cls, bpy.types.Panel)}
    assert tabs == {"BIM Verify"}


@pytest.mark.parametrize("module", ["numba", "ifcopenshell", "scipy", "pye57", "laspy", "matplotlib", "jinja2"])
def test_register_imports_nothing_heavy(module: str, heavy_after_register: set[str]) -> None:
    assert module not in heavy_after_register


@pytest.fixture(scope="module")
def heavy_after_register() -> set[str]:
    code = (
        "import os, sys, bpy, bim_verify; bim_verify.register(); bim_verify.unregister();"
        "print('\\n'.join(sorted({m.split('.')[0] for m in sys.modules}))); sys.stdout.flush(); os._exit(0)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=120, env={**os.environ}, check=True
    )
    return set(done.stdout.split())
