"""What is registered with Blender, in which order."""

from __future__ import annotations

import os
import sys

import bpy
from bpy.app.handlers import persistent

from . import commands, operators, overlay, panels, preferences, properties
from .session import SESSION

CLASSES = (preferences.BimVerifyPreferences, *operators.CLASSES, *panels.CLASSES)


def register() -> None:
    """Register classes, properties, handlers, the command and the legend."""
    keep_compiled_kernels()
    properties.register()
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.app.handlers.load_pre.append(_forget)
    commands.register()
    overlay.register()


def unregister() -> None:
    """The reverse of ``register``."""
    overlay.unregister()
    commands.unregister()
    bpy.app.handlers.load_pre.remove(_forget)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
    properties.unregister()
    SESSION.clear()


def keep_compiled_kernels() -> None:
    """Let numba keep compiled kernels in the extension's user folder: the installed package may not be writable.

    Blender removes that folder with the extension. A place that the user chose is kept.
    """
    if "NUMBA_CACHE_DIR" in os.environ or not preferences.PACKAGE.startswith("bl_ext."):
        return
    folder = bpy.utils.extension_path_user(preferences.PACKAGE, path="numba", create=True)
    os.environ["NUMBA_CACHE_DIR"] = folder
    if "numba" in sys.modules:
        sys.modules["numba"].config.CACHE_DIR = folder


@persistent
def _forget(*_arguments: object) -> None:
    SESSION.clear()
