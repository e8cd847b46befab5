"""The coloured scene as a .blend file, without a window."""

from __future__ import annotations

from pathlib import Path

import bpy

from ..core.files import whole_file
from ..core.results import VerificationResult
from . import frame, project, register, scene, unregister
from .properties import DEFAULT_DISPLAY_VERTICES
from .surface_grid import make_display
from .survey_scene import show_any


def save_blend(result: VerificationResult, path: str | Path, *, display_vertices: int = DEFAULT_DISPLAY_VERTICES) -> None:
    """Write a .blend file with every element of ``result``, coloured, ready to open and to render.

    What is open in this process is replaced by a new, empty file. ``display_vertices``: about how many vertices the
    coloured surfaces get together. Raises BimVerifyError when ``path`` cannot be written.
    """
    with whole_file(Path(path).absolute()) as temporary:  # Blender has a folder of its own for relative paths
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        ours = not hasattr(bpy.types.Scene, "bim_verify")
        if ours:
            register()
        try:
            if not show_any(bpy.context.scene, result, display_vertices):
                _build(result, make_display(result, display_vertices))
            bpy.ops.wm.save_as_mainfile(filepath=str(temporary), compress=True, copy=True)
        finally:
            if ours:
                unregister()


def _build(result: VerificationResult, display: scene.Display) -> None:
    target = bpy.context.scene
    settings = target.bim_verify
    settings.model_path = str(Path(result.model.path).resolve())
    for path in result.scan_paths:
        entry = settings.scans.add()
        entry.path, entry.name = str(Path(path).resolve()), Path(path).name
    settings.loa, settings.sigma_mm = str(result.options.loa), 1000 * result.options.sigma
    settings.align = result.options.align
    project.adopt_frame(target, result.model)
    scene.show_result(target, result, display)
    scene.show_colors_in_views()
    assert frame.stored(target) is not None
