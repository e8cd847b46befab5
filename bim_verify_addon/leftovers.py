"""What Blender itself leaves behind when it removes an extension."""

from __future__ import annotations

import contextlib
import importlib.util
import sys
from pathlib import Path

import bpy

from .preferences import PACKAGE


def remove_compiled_files() -> None:
    """Take away the compiled files of wheels that are a single file; they are made again when they are imported.

    Such a file lies beside those of other extensions, and Blender, which removes what a wheel lists, does not know what
    Python compiled from it. A Blender that goes on to remove the extension tells it no more than to unregister.
    """
    if not PACKAGE.startswith("bl_ext."):
        return
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    site = Path(bpy.utils.user_resource("EXTENSIONS"), ".local", "lib", version, "site-packages")
    for source in site.glob("*.py"):
        with contextlib.suppress(OSError):
            Path(importlib.util.cache_from_source(str(source))).unlink()
    with contextlib.suppress(OSError):
        (site / "__pycache__").rmdir()  # only where it is empty
