"""Build the Blender extension: the code, and the wheels it needs for each platform and Python of Blender.

    python scripts/build_extension.py --out dist                                   all platforms, one zip each
    python scripts/build_extension.py --out dist --per-python                      one zip each for 4.2 to 5.0 and from 5.1 on
    python scripts/build_extension.py --out dist --platforms linux-x64 --pythons 3.11

Needs pip and Blender: the ``bpy`` module in this Python, or a Blender executable named with ``--blender``. The wheels
are those that pip resolves for the NumPy that Blender itself brings; what Blender brings is not bundled. Nearly all of a
zip is llvmlite, IfcOpenShell, SciPy, pye57 and Embree, once for each Python.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

PIP_PLATFORMS = {
    "linux-x64": ["manylinux_2_28_x86_64", "manylinux_2_27_x86_64", "manylinux_2_17_x86_64", "manylinux2014_x86_64",
                  "manylinux_2_31_x86_64"],
    "windows-x64": ["win_amd64"],
    "macos-arm64": ["macosx_14_0_arm64"],
    "macos-x64": ["macosx_13_0_x86_64"],
}  # fmt: skip
"""Blender's names of platforms, and the wheel tags that run on each (pip adds the older macOS versions)."""

BLENDER_NUMPY = {"3.11": "1.24.3", "3.13": "2.3.4"}
"""The oldest NumPy in a Blender with that Python (4.2 LTS; 5.1). Compiled wheels must accept it."""

INSTEAD = {"macos-x64": {"numba": ["numba>=0.62"], "pye57": []}}
"""What a platform gets in place of the project's own requirement. For Intel Macs numba has no newer wheels and pye57 none;
without it E57 files are read, but ``simulate`` and ``demo`` cannot write one."""

BLENDER_VERSIONS = {"3.11": ("4.2.0", "5.1.0"), "3.13": ("5.1.0", "")}
"""Of a zip for one Python: the first Blender it is for, and the first it is not for any more."""

IN_BLENDER = {"numpy", "requests", "urllib3", "certifi", "idna", "charset_normalizer"}
"""Comes with Blender; a second copy could clash with it."""

NOT_INSIDE = {"matplotlib"}
"""Only the scripts that make the documentation draw with these."""


def main() -> int:
    """Parse, collect, build, validate; 0 when every asked-for platform was built."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="folder for the zip files")
    parser.add_argument("--platforms", default=",".join(PIP_PLATFORMS), help="comma-separated Blender platforms")
    parser.add_argument("--pythons", default=",".join(BLENDER_NUMPY), help="comma-separated Python versions")
    parser.add_argument("--per-python", action="store_true", help="one zip a Python: half the size, for fewer Blenders")
    parser.add_argument("--wheels", type=Path, help="keep downloaded wheels here (a folder that may be used again)")
    parser.add_argument("--blender", help="Blender executable; default: the bpy module of this Python")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    failed = []
    with tempfile.TemporaryDirectory(prefix="bim_verify_build_") as scratch:
        for platform in options.platforms.split(","):
            wheels = options.wheels or Path(scratch) / "wheels"
            try:
                found = {python: collect(platform, python, wheels / platform) for python in options.pythons.split(",")}
                groups = [[python] for python in found] if options.per_python else [list(found)]
                for group in groups:
                    chosen = without_twins([wheel for python in group for wheel in found[python]])
                    stage = Path(scratch) / f"stage_{platform}_{'_'.join(group)}"
                    target = build(platform, group[0] if options.per_python else "", chosen, stage, options)
                    print(f"{platform}: {target} {target.stat().st_size / 1e6:.0f} MB, {len(chosen)} wheels", flush=True)
            except subprocess.CalledProcessError as error:
                print(f"{platform}: failed\n{error.stdout}", file=sys.stderr)
                failed.append(platform)
    return 1 if failed else 0


def requirements(platform: str) -> list[str]:
    """What the package needs at run time inside Blender, from pyproject.toml."""
    with (ROOT / "pyproject.toml").open("rb") as stream:
        declared = tomllib.load(stream)["project"]["dependencies"]
    instead = INSTEAD.get(platform, {})
    wanted = [line for line in declared if name_of(line) not in IN_BLENDER | NOT_INSIDE]
    return [used for line in wanted for used in instead.get(name_of(line), [line])]


def name_of(requirement: str) -> str:
    """``laspy[lazrs]>=2.7`` -> ``laspy``."""
    return re.split(r"[^A-Za-z0-9_.-]", requirement, maxsplit=1)[0].lower()


def collect(platform: str, python: str, folder: Path) -> list[Path]:
    """Download the wheels of one platform and Python; those of Blender's own packages are left out."""
    place = folder / python
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    tags = [part for tag in PIP_PLATFORMS[platform] for part in ("--platform", tag)]
    pip = [sys.executable, "-m", "pip", "download", "--quiet", "--only-binary=:all:", "--dest", str(place)]
    target = [*tags, "--python-version", python, "--implementation", "cp"]
    run([*pip, *target, *requirements(platform), f"numpy=={BLENDER_NUMPY[python]}"])
    return [wheel for wheel in place.glob("*.whl") if name_of(wheel.name.split("-")[0]) not in IN_BLENDER]


def without_twins(wheels: list[Path]) -> list[Path]:
    """Each wheel once. Of pure Python packages in two versions the older stays: it was chosen for the older NumPy too."""
    kept: dict[str, Path] = {}
    for wheel in sorted(wheels, key=lambda w: [int(n) for n in re.findall(r"\d+", w.name.split("-")[1])]):
        pure = wheel.name.endswith("-none-any.whl")
        kept.setdefault(wheel.name.split("-")[0] if pure else wheel.name, wheel)
    return sorted(kept.values())


def build(platform: str, python: str, wheels: list[Path], stage: Path, options: argparse.Namespace) -> Path:
    """Stage the code with its wheels and an adapted manifest, build the zip and validate it.

    ``python``: the only one that the zip is for; empty for all.
    """
    skipped = shutil.ignore_patterns(".*", "__pycache__", "tests", "docs", "build", "dist", "demo", "*.egg-info", "*.zip")
    shutil.copytree(ROOT, stage, ignore=skipped)
    (stage / "wheels").mkdir()
    for wheel in wheels:
        shutil.copy2(wheel, stage / "wheels" / wheel.name)
    version = re.search(r'^__version__ = "(.+)"', (ROOT / "__init__.py").read_text(encoding="utf-8"), re.MULTILINE)
    if version is None:
        raise SystemExit("__init__.py has no __version__.")
    manifest = (ROOT / "blender_manifest.toml").read_text(encoding="utf-8")
    manifest = re.sub(r'^version = ".*"', f'version = "{version[1]}"', manifest, flags=re.MULTILINE)
    suffix = ""
    if python:
        first, after = BLENDER_VERSIONS[python]
        limits = f'blender_version_min = "{first}"' + (f'\nblender_version_max = "{after}"' if after else "")
        manifest = re.sub(r'^blender_version_min = ".*"', limits, manifest, flags=re.MULTILINE)
        suffix = f"-blender{first.rpartition('.')[0]}"
    listed = "".join(f'    "./wheels/{wheel.name}",\n' for wheel in wheels)
    generated = f'platforms = ["{platform}"]\nwheels = [\n{listed}]\n\n[permissions]'
    (stage / "blender_manifest.toml").write_text(manifest.replace("[permissions]", generated, 1), encoding="utf-8")
    target = options.out / f"bim_verify-{version[1]}-{platform}{suffix}.zip"
    target.unlink(missing_ok=True)
    tool = extension_tool(options.blender)
    run([*tool, "build", "--source-dir", str(stage), "--output-filepath", str(target.resolve())])
    run([*tool, "validate", str(target.resolve())])
    return target


def extension_tool(blender: str | None) -> list[str]:
    """The command that builds and validates extensions: Blender's own, or the same script in the bpy module."""
    if blender:
        return [blender, "--factory-startup", "--command", "extension"]
    import bpy

    scripts = Path(bpy.utils.system_resource("SCRIPTS"))
    return [sys.executable, str(scripts / "addons_core" / "bl_pkg" / "cli" / "blender_ext.py")]


def run(command: list[str]) -> None:
    """Run a command; its output is in the error when it fails."""
    subprocess.run(command, check=True, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)


if __name__ == "__main__":
    code = main()
    sys.stdout.flush()
    os._exit(code)
