"""All checks of the project: lint, types, tests without Blender, tests with the bpy module, the commands as processes.

    python scripts/check.py            everything
    python scripts/check.py lint types core cli addon      only these
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def lint() -> int:
    return _run([sys.executable, "-m", "ruff", "check", "."])


def types() -> int:
    """The library and the console; Blender's properties are annotations that no type checker can read.

    mypy finds packages by folder name, so it looks at the checkout through a link called ``bim_verify``.
    """
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "bim_verify").symlink_to(ROOT, target_is_directory=True)
        config = ["--config-file", str(ROOT / "pyproject.toml"), "--cache-dir", str(ROOT / ".mypy_cache")]
        chosen = ["-p", "bim_verify.core", "-m", "bim_verify.cli", "-m", "bim_verify.__main__"]
        return _run([sys.executable, "-m", "mypy", *config, *chosen], cwd=folder, MYPYPATH=folder)


def core() -> int:
    return _pytest("tests/core", "-n", "2")


def cli() -> int:
    return _pytest("tests/cli")


def addon() -> int:
    """With the bpy module. The process is left by ``os._exit``: Blender may hang in its own clean-up at exit."""
    leave = "import os, sys, pytest; code = pytest.main(['tests/addon']); sys.stdout.flush(); os._exit(int(code))"
    with tempfile.TemporaryDirectory() as folder:
        return _run([sys.executable, "-c", leave], BLENDER_USER_RESOURCES=folder)


def _pytest(*arguments: str, **environment: str) -> int:
    return _run([sys.executable, "-m", "pytest", *arguments], **environment)


def _run(command: list[str], cwd: str | Path = ROOT, **environment: str) -> int:
    return subprocess.run(command, cwd=cwd, env={**os.environ, **environment}, check=False).returncode


CHECKS: dict[str, Callable[[], int]] = {"lint": lint, "types": types, "core": core, "cli": cli, "addon": addon}


def main(chosen: list[str]) -> int:
    unknown = [name for name in chosen if name not in CHECKS]
    if unknown:
        print(f"No such check: {', '.join(unknown)}; there are {', '.join(CHECKS)}.", file=sys.stderr)
        return 2
    failed = []
    for name in chosen or list(CHECKS):
        print(f"== {name}", flush=True)
        start = time.monotonic()
        if CHECKS[name]():
            failed.append(name)
        print(f"== {name}: {'failed' if name in failed else 'passed'} in {time.monotonic() - start:.0f} s", flush=True)
    print(f"Failed: {', '.join(failed)}" if failed else "All checks passed.", flush=True)
    return bool(failed)


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
