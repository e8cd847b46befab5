"""The extension as users get it: manifest, zip, install in a clean profile, a verification without network.

The last is slow (it downloads and unpacks all wheels) and runs where ``BIM_VERIFY_SLOW_TESTS`` is set.
"""

from __future__ import annotations

import importlib.util
import io
import os
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import bpy
import pytest

import bim_verify
from bim_verify.core.commands import COMMANDS

ROOT = Path(__file__).resolve().parent.parent.parent
TOOL = Path(bpy.utils.system_resource("SCRIPTS")) / "addons_core" / "bl_pkg" / "cli" / "blender_ext.py"
SINGLE = "single_of_ours-1.0-py3-none-any.whl"
PYTHON = f"{sys.version_info.major}.{sys.version_info.minor}"

slow = pytest.mark.skipif(not os.environ.get("BIM_VERIFY_SLOW_TESTS"), reason="set BIM_VERIFY_SLOW_TESTS to run it")

USE = """
import os, sys, bpy, addon_utils
scratch, house, scan = sys.argv[1:4]
names = [n for n in os.listdir(scratch) if n.endswith(".zip")]
bpy.ops.extensions.package_install_files(filepath=os.path.join(scratch, names[0]), repo="user_default", enable_on_install=True)
assert "bl_ext.user_default.bim_verify" in bpy.context.preferences.addons, "not enabled"
import numba
assert numba.__file__.startswith(os.environ["BLENDER_USER_RESOURCES"]), numba.__file__
ops = bpy.ops.bim_verify
bpy.context.scene.bim_verify.origin = "2.0,1.5,1.4"
bpy.context.scene.bim_verify.spacing_mm = 50
assert ops.import_ifc(filepath=house) == {"FINISHED"}
assert ops.import_scan(filepath=scan) == {"FINISHED"}
assert ops.verify() == {"FINISHED"}
assert ops.export_ifc(filepath=os.path.join(scratch, "out.ifc")) == {"FINISHED"}
assert os.environ["NUMBA_CACHE_DIR"].startswith(os.environ["BLENDER_USER_RESOURCES"])
addon_utils.disable("bl_ext.user_default.bim_verify")
assert not hasattr(bpy.types.Scene, "bim_verify")
print("verified", flush=True)
os._exit(0)
"""

COME_AND_GO = """
import os, sys, bpy
older, newer = sys.argv[1:3]
profile = os.environ["BLENDER_USER_RESOURCES"]
home = next(r for r in bpy.context.preferences.extensions.repos if r.module == "user_default").directory
where = os.path.join(home, "bim_verify")

def install(path):
    bpy.ops.extensions.package_install_files(filepath=path, repo="user_default", enable_on_install=True)
    assert hasattr(bpy.types.Scene, "bim_verify"), "not enabled"
    return open(os.path.join(where, "blender_manifest.toml")).read()

assert 'version = "0.0.1"' in install(older)
assert os.path.exists(os.path.join(where, "gone.py"))
kept = os.environ["BIM_VERIFY_CACHE"]
assert kept.startswith(profile), kept
open(os.path.join(kept, "made_by_us"), "w").close()
sys.dont_write_bytecode = False
import single_of_ours
compiled = single_of_ours.__cached__
assert compiled.startswith(profile) and os.path.exists(compiled), compiled
assert 'version = "0.0.1"' not in install(newer)
assert not os.path.exists(os.path.join(where, "gone.py")), "a file of the older version is still there"
assert bpy.ops.bim_verify.import_ifc.poll()
bpy.ops.extensions.package_uninstall(repo_directory=home, pkg_id="bim_verify")
assert not hasattr(bpy.types.Scene, "bim_verify"), "still registered"
names = [os.path.join(a, n) for a, folders, files in os.walk(profile) for n in folders + files]
left = [name for name in names if "bim_verify" in os.path.basename(name) or name.endswith("made_by_us")]
left += [name for name in names if "single_of_ours" in name or name.endswith((".py", ".pyc"))]
print("left", left, flush=True)
os._exit(0)
"""


def test_manifest_is_valid_and_agrees_with_the_package(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, str(TOOL), "validate", str(ROOT)], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
    assert (manifest["id"], manifest["version"]) == ("bim_verify", bim_verify.__version__)
    assert manifest["blender_version_min"] == "4.2.0"
    assert set(manifest["permissions"]) == {"files"}


def test_zip_holds_the_code_and_no_tests(tmp_path: Path) -> None:
    command = [sys.executable, str(TOOL), "build", "--source-dir", str(ROOT), "--output-filepath", str(tmp_path / "b.zip")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    names = zipfile.ZipFile(tmp_path / "b.zip").namelist()
    assert {"__init__.py", "blender_manifest.toml", "core/results.py", "bim_verify_addon/registration.py"} <= set(names)
    assert not [n for n in names if n.startswith(("tests/", "docs/", ".")) or "__pycache__" in n or n.endswith(".blend")]
    scripts = {Path(name).stem for name in names if name.startswith("scripts/")}
    assert scripts == {command.name for command in COMMANDS} | {"headless_entry", "make_wall_example"}


def test_an_update_replaces_and_an_uninstall_leaves_nothing(tmp_path: Path) -> None:
    newer, older, profile = tmp_path / "newer.zip", tmp_path / "older.zip", tmp_path / "profile"
    profile.mkdir()
    command = [sys.executable, str(TOOL), "build", "--source-dir", str(ROOT), "--output-filepath", str(newer)]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    plain = newer.rename(tmp_path / "plain.zip")
    rewrite(plain, newer, bim_verify.__version__)
    rewrite(plain, older, "0.0.1", "gone.py")
    keep = {k: v for k, v in os.environ.items() if k not in ("BIM_VERIFY_CACHE", "NUMBA_CACHE_DIR")}
    done = subprocess.run(
        [sys.executable, "-c", COME_AND_GO, str(older), str(newer)],
        env={**keep, "BLENDER_USER_RESOURCES": str(profile)}, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert "left []" in done.stdout, done.stdout + done.stderr


def rewrite(source: Path, target: Path, version: str, *more: str) -> None:
    """The zip as another version with more files, and with a wheel that is a single file."""
    with zipfile.ZipFile(source) as read, zipfile.ZipFile(target, "w") as written:
        for name in read.namelist():
            data = read.read(name)
            if name == "blender_manifest.toml":
                data = data.replace(f'version = "{bim_verify.__version__}"'.encode(), f'version = "{version}"'.encode(), 1)
                data = data.replace(b"[permissions]", f'wheels = ["./wheels/{SINGLE}"]\n\n[permissions]'.encode(), 1)
            written.writestr(name, data)
        for name in more:
            written.writestr(name, "")
        written.writestr(f"wheels/{SINGLE}", single_wheel())


def single_wheel() -> bytes:
    """A wheel of one module that is no package."""
    facts = SINGLE.split("-py3")[0] + ".dist-info"
    files = {
        "single_of_ours.py": "",
        f"{facts}/METADATA": "Metadata-Version: 2.1\nName: single-of-ours\nVersion: 1.0\n",
        f"{facts}/WHEEL": "Wheel-Version: 1.0\nGenerator: tests\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }
    record = "".join(f"{name},,\n" for name in (*files, f"{facts}/RECORD"))
    held = io.BytesIO()
    with zipfile.ZipFile(held, "w") as wheel:
        for name, text in {**files, f"{facts}/RECORD": record}.items():
            wheel.writestr(name, text)
    return held.getvalue()


def test_a_zip_takes_each_wheel_once() -> None:
    spec = importlib.util.spec_from_file_location("build_extension", ROOT / "scripts" / "build_extension.py")
    assert spec is not None and spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    names = ("a-1.10-py3-none-any.whl", "a-1.9-py3-none-any.whl", "b-2-cp311-cp311-x.whl", "b-3-cp313-cp313-x.whl")
    found = [Path("3.11") / names[0], Path("3.13") / names[1], Path("3.11") / names[2], Path("3.13") / names[3]]
    assert [w.name for w in script.without_twins([*found, Path("3.13") / names[0]])] == [names[2], names[1], names[3]]


@slow
def test_installs_in_a_clean_profile_and_verifies_without_network(house: Path, scan: Path, tmp_path: Path) -> None:
    scratch, profile = tmp_path / "scratch", tmp_path / "profile"
    scratch.mkdir()
    profile.mkdir()
    platform = {"linux": "linux-x64", "win32": "windows-x64"}.get(sys.platform, "macos-arm64")
    build = [sys.executable, str(ROOT / "scripts" / "build_extension.py"), "--out", str(scratch)]
    subprocess.run([*build, "--platforms", platform, "--pythons", PYTHON], check=True, timeout=900)
    keep = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "NUMBA_CACHE_DIR")}
    offline = {"HTTP_PROXY": "http://127.0.0.1:9", "HTTPS_PROXY": "http://127.0.0.1:9", "NO_PROXY": ""}
    done = subprocess.run(
        [sys.executable, "-c", USE, str(scratch), str(house), str(scan)],
        env={**keep, **offline, "BLENDER_USER_RESOURCES": str(profile)},
        capture_output=True, text=True, timeout=900,
    )  # fmt: skip
    assert "verified" in done.stdout, done.stdout + done.stderr
    assert (scratch / "out.ifc").is_file()
