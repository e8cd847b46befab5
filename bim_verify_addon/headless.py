"""The coloured scene as a .blend file, without a window."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy

from ..core.errors import BimVerifyError
from ..core.files import whole_file
from . import paint, register, scene, unregister
from .capabilities import CAPABILITIES
from .properties import DEFAULT_DISPLAY_VERTICES


def save_blend(result: Any, path: str | Path, *, display_vertices: int = DEFAULT_DISPLAY_VERTICES) -> None:
    """Write a .blend file that shows ``result`` (of any capability that can), ready to open and to render.

    What is open in this process is replaced by a new, empty file. ``display_vertices``: about how many vertices the
    coloured surfaces get together. Raises BimVerifyError when ``path`` cannot be written.
    """
    with whole_file(Path(path).absolute()) as temporary:  # Blender has a folder of its own for relative paths
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        ours = not hasattr(bpy.types.Scene, "bim_verify")
        if ours:
            register()
        try:
            target = bpy.context.scene
            target.bim_verify.display_vertices = display_vertices
            if not any(c.show(target, result) for c in CAPABILITIES if c.show is not None):
                raise BimVerifyError("--blend has nothing to show for this command.")
            paint.refresh(target)
            scene.show_colors_in_views()
            bpy.ops.wm.save_as_mainfile(filepath=str(temporary), compress=True, copy=True)
        finally:
            if ours:
                unregister()
