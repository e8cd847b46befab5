"""The legend in the 3D view: what the colours mean, with units."""

from __future__ import annotations

from typing import Any

import blf
import bpy
import gpu
from gpu_extras.batch import batch_for_shader

from . import colors
from .preferences import legend_size

_handle: Any = None
MARGIN = 20


def register() -> None:
    """Start drawing; nothing to draw on in background mode."""
    global _handle
    if not bpy.app.background:
        _handle = bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_PIXEL")


def unregister() -> None:
    """Stop drawing."""
    global _handle
    if _handle is not None:
        bpy.types.SpaceView3D.draw_handler_remove(_handle, "WINDOW")
        _handle = None


def legend_lines(settings: bpy.types.PropertyGroup) -> list[colors.Swatch]:
    """What each colour of the current mode means; with counts where it is the status."""
    mode = colors.BY_IDENTIFIER[settings.color_mode]
    lines = mode.legend(settings.deviation_range_mm / 1000)
    if mode.identifier != "STATUS":
        return lines
    return [(f"{label}  {entry.count}", color) for (label, color), entry in zip(lines, settings.counts, strict=False)]


def _draw() -> None:
    context = bpy.context
    settings = context.scene.bim_verify
    if not settings.show_legend or not settings.counts:
        return
    scale = context.preferences.system.ui_scale
    size = legend_size(context) * scale
    lines = legend_lines(settings)
    title = colors.BY_IDENTIFIER[settings.color_mode].label
    step = 1.6 * size
    blf.size(0, size)
    width = max(blf.dimensions(0, text)[0] for text in (title, *(line[0] for line in lines))) + 3.2 * size
    left, bottom = MARGIN * scale, MARGIN * scale
    gpu.state.blend_set("ALPHA")
    _rectangle(left - 0.6 * size, bottom - 0.6 * size, width, (len(lines) + 1) * step + 0.8 * size, (0.1, 0.1, 0.1, 0.75))
    for row, (text, color) in enumerate(reversed(lines)):
        y = bottom + row * step
        _rectangle(left, y, size, size, (*color, 1.0))
        _text(left + 1.7 * size, y + 0.12 * size, text, size)
    _text(left, bottom + len(lines) * step + 0.2 * size, title, size)
    gpu.state.blend_set("NONE")


def _text(x: float, y: float, text: str, size: float) -> None:
    blf.size(0, size)
    blf.color(0, 1.0, 1.0, 1.0, 1.0)
    blf.position(0, x, y, 0)
    blf.draw(0, text)


def _rectangle(x: float, y: float, width: float, height: float, color: tuple[float, float, float, float]) -> None:
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    corners = [(x, y), (x + width, y), (x + width, y + height), (x, y + height)]
    shader.uniform_float("color", color)
    batch_for_shader(shader, "TRIS", {"pos": corners}, indices=[(0, 1, 2), (0, 2, 3)]).draw(shader)
