"""What is registered with Blender, in which order."""

from __future__ import annotations

import os
import sys

import bpy
from bpy.app.handlers import persistent

from . import commands, hover, operators, overlay, panels, preferences, properties
from .leftovers import remove_compiled_files
from .session import SESSION

CLASSES = (preferences.BimVerifyPreferences, *operators.CLASSES, *panels.CLASSES, *hover.CLASSES)


def register() -> None:
    """Register classes, properties, handlers, the command and the legend."""
    keep_caches_inside()
    properties.register()
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.app.handlers.load_pre.append(_forget)
    commands.register()
    overlay.register()


def unregister() -> None:
    """The reverse of ``register``."""
    overlay.unregister()
    hover.forget()
    commands.unregister()
    bpy.app.handlers.load_pre.remove(_forget)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
    properties.unregister()
    SESSION.clear()
    remove_compiled_files()


def keep_caches_inside() -> None:
    """Let numba keep compiled kernels, and us tessellations, in the extension's user folder.

    The installed package may not be writable, and Blender removes that folder with the extension, so nothing is left
    behind. A place that the user chose is kept.
    """
    if not preferences.PACKAGE.startswith("bl_ext."):
        return
    for variable, name in (("NUMBA_CACHE_DIR", "numba"), ("BIM_VERIFY_CACHE", "tessellations")):
        if variable not in os.environ:
            os.environ[variable] = bpy.utils.extension_path_user(preferences.PACKAGE, path=name, create=True)
    if "numba" in sys.modules:
        sys.modules["numba"].config.CACHE_DIR = os.environ["NUMBA_CACHE_DIR"]


@persistent
def _forget(*_arguments: object) -> None:
    SESSION.clear()
    hover.forget()
