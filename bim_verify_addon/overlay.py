"""In the 3D view: what the colours mean, with units and range, and the numbers of the active element."""

from __future__ import annotations

import textwrap
from typing import Any

import blf
import bpy
import gpu
from gpu_extras.batch import batch_for_shader

from . import colors
from .capabilities import CAPABILITIES, MODES, shown_first
from .hover import HOVER, LINE_LENGTH
from .known import known_object
from .preferences import legend_size

_handle: Any = None
MARGIN = 20
RAMP_LINES = 9
"""Height of a ramp, in lines of text."""

Linear = tuple[float, float, float, float]
PLATE: Linear = (0.1, 0.1, 0.1, 0.75)
FRONT_PLATE: Linear = (0.1, 0.1, 0.1, 0.95)
"""Beside the mouse: it may lie over the other plates."""
LINE = 1.5
"""Height of a line, in heights of its letters."""
MOST_ROWS = 12
"""Numbers that are drawn; the panel has them all."""


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


def legend(scene: bpy.types.Scene) -> colors.Legend:
    """What the colours of the current mode mean; with counts where they tell classes apart."""
    mode = MODES[scene.bim_verify.color_mode]
    made = mode.legend(scene)
    if mode.category is None:
        return made
    count = {entry.category: entry.count for entry in scene.bim_verify.counts if entry.mode == mode.identifier}
    return colors.Legend(tuple((f"{c.label}  {count.get(c.identifier, 0)}", c.color) for c in mode.categories), made.ramp)


def legends(scene: bpy.types.Scene) -> list[tuple[str, colors.Legend]]:
    """(title, legend) of all that colours say something in the scene."""
    settings = scene.bim_verify
    found = [(MODES[settings.color_mode].label, legend(scene))] if settings.has_findings else []
    for capability in CAPABILITIES:
        if capability.legend is not None and capability.step is not None and (own := capability.legend(scene)) is not None:
            found.append((capability.step.label, own))
    return found


def _draw() -> None:
    context = bpy.context
    settings = context.scene.bim_verify
    shown = legends(context.scene) if settings.show_legend else []
    if not settings.has_findings and not shown:
        return
    scale = context.preferences.system.ui_scale
    size = legend_size(context) * scale
    gpu.state.blend_set("ALPHA")
    left = MARGIN * scale
    for title, one in shown:
        left = _draw_legend(context, size, scale, title, one, left)
    if settings.show_numbers:
        _draw_numbers(context, size, scale, left)
    if settings.show_hover and HOVER.lines and HOVER.region == context.region.as_pointer():
        _draw_hover(context, size, scale)
    gpu.state.blend_set("NONE")


def _draw_legend(
    context: bpy.types.Context, size: float, scale: float, title: str, shown: colors.Legend, left: float
) -> float:
    """At ``left`` (pixels); returns where the next one may begin."""
    step = 1.6 * size
    texts = [title, *(text for text, _ in shown.swatches), *(text for _, text in (shown.ramp.ticks if shown.ramp else ()))]
    blf.size(0, size)
    width = max(blf.dimensions(0, text)[0] for text in texts) + 3.2 * size
    bottom = MARGIN * scale + _redo_panel_height(context)
    lines = len(shown.swatches) + (RAMP_LINES if shown.ramp else 0) + 1
    _rectangle(left - 0.6 * size, bottom - 0.6 * size, width, lines * step + 0.8 * size, PLATE)
    y = bottom
    for text, color in reversed(shown.swatches):
        _rectangle(left, y, size, size, (*color, 1.0))
        _text(left + 1.7 * size, y + 0.12 * size, text, size)
        y += step
    if shown.ramp:
        _ramp(left, y, size, (RAMP_LINES - 1) * step, shown.ramp)
        y += RAMP_LINES * step
    _text(left, y + 0.2 * size, title, size)
    return left + width + MARGIN * scale


def numbers(context: bpy.types.Context) -> list[str]:
    """Lines on the active element: what it is, why it has the colour it has, the numbers behind that."""
    item = known_object(context)
    if item is None:
        return []
    lines = [f"{item.bim_verify.ifc_class}  {item.bim_verify.element_name or 'unnamed'}"]
    for capability in shown_first(context.scene.bim_verify.color_mode):
        rows = capability.numbers(item) if capability.numbers is not None else []
        if rows:
            if capability.why is not None:
                lines += textwrap.wrap(capability.why(item), LINE_LENGTH)
            said = [f"{name}: {value}" for name, value in rows if value not in ("", "–")][:MOST_ROWS]
            lines += [line for one in said for line in textwrap.wrap(one, LINE_LENGTH)]
            break
    return lines


def _draw_numbers(context: bpy.types.Context, size: float, scale: float, left: float) -> None:
    """Beside the legend, in the corner: a finding that was stepped to stands in the middle of the view."""
    lines = numbers(context)
    if not lines:
        return
    width, _ = _plate_size(lines, size)
    right = next((r.width for r in context.area.regions if r.type == "UI"), 0)
    left = min(left - 0.6 * size, context.region.width - right - width - MARGIN * scale)
    _plate(lines, size, max(left, 0.0), MARGIN * scale - 0.6 * size + _redo_panel_height(context))


def _draw_hover(context: bpy.types.Context, size: float, scale: float) -> None:
    """Below and right of the mouse, or on its other side where the view ends."""
    width, height = _plate_size(HOVER.lines, size)
    apart = MARGIN * scale
    right = next((r.width for r in context.area.regions if r.type == "UI"), 0)
    x, y = HOVER.place
    left = x + apart if x + apart + width < context.region.width - right else x - apart - width
    bottom = y - apart - height if y - apart - height > 0 else y + apart
    _plate(HOVER.lines, size, max(left, 0.0), min(bottom, context.region.height - height), FRONT_PLATE)


def _plate_size(lines: list[str], size: float) -> tuple[float, float]:
    blf.size(0, size)
    return max(blf.dimensions(0, line)[0] for line in lines) + 1.2 * size, LINE * len(lines) * size + 0.8 * size


def _plate(lines: list[str], size: float, left: float, bottom: float, color: Linear = PLATE) -> None:
    """Lines of text on a dark plate; ``left``, ``bottom``: its corner, pixels."""
    _rectangle(left, bottom, *_plate_size(lines, size), color)
    for row, line in enumerate(reversed(lines)):
        _text(left + 0.6 * size, bottom + 0.6 * size + LINE * row * size, line, size)


def _redo_panel_height(context: bpy.types.Context) -> float:
    """Blender's redo panel lies in the same corner while it is there."""
    return next((r.height for r in context.area.regions if r.type == "HUD" and r.height > 1), 0)


def _ramp(x: float, y: float, size: float, height: float, ramp: colors.Ramp) -> None:
    shader = gpu.shader.from_builtin("SMOOTH_COLOR")
    count = len(ramp.colors)
    heights = [y + height * k / (count - 1) for k in range(count)]
    corners = [(px, py) for py in heights for px in (x, x + size)]
    paint: list[Linear] = [(*color, 1.0) for color in ramp.colors for _ in range(2)]
    triangles = [t for k in range(0, 2 * (count - 1), 2) for t in ((k, k + 1, k + 2), (k + 1, k + 3, k + 2))]
    batch_for_shader(shader, "TRIS", {"pos": corners, "color": paint}, indices=triangles).draw(shader)
    for place, text in ramp.ticks:
        at = y + height * place
        _rectangle(x + size, at - 0.5, 0.4 * size, 1.0, (1.0, 1.0, 1.0, 1.0))
        _text(x + 1.7 * size, at - 0.35 * size, text, size)


def _text(x: float, y: float, text: str, size: float) -> None:
    blf.size(0, size)
    blf.color(0, 1.0, 1.0, 1.0, 1.0)
    blf.position(0, x, y, 0)
    blf.draw(0, text)


def _rectangle(x: float, y: float, width: float, height: float, color: Linear) -> None:
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    corners = [(x, y), (x + width, y), (x + width, y + height), (x, y + height)]
    shader.uniform_float("color", color)
    batch_for_shader(shader, "TRIS", {"pos": corners}, indices=[(0, 1, 2), (0, 2, 3)]).draw(shader)
