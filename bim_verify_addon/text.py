"""Text that fits the sidebar, and numbers as a modeller reads them."""

from __future__ import annotations

import math
import textwrap

import bpy

CHARACTER_WIDTH = 6.2
"""Pixels of an average character of the panel font at interface scale 1."""


NAME_SHARE = 0.53
"""Of the width, for the names in a list of numbers."""


def wrapped(layout: bpy.types.UILayout, context: bpy.types.Context, text: str) -> None:
    """Labels, one a line, broken at the width of the region."""
    column = layout.column(align=True)
    column.scale_y = 0.75
    for paragraph in text.splitlines():
        for line in textwrap.wrap(paragraph, characters(context)):
            column.label(text=line)


def table(layout: bpy.types.UILayout, context: bpy.types.Context, rows: list[tuple[str, str]]) -> None:
    """Names and values beside each other; one below the other where they are too long for that, so that nothing is cut."""
    column = layout.column(align=True)
    column.scale_y = 0.8
    width = characters(context)
    for name, value in rows:
        if not value:
            continue
        if len(name) > NAME_SHARE * width or len(value) > (1.0 - NAME_SHARE) * width:
            for line in textwrap.wrap(f"{name}: {value}", width):
                column.label(text=line)
            continue
        split = column.split(factor=NAME_SHARE)
        split.label(text=name)
        split.label(text=value)


def characters(context: bpy.types.Context) -> int:
    """About how many fit into one line of the region."""
    region = context.region
    width = (region.width if region is not None else 300) / context.preferences.system.ui_scale - 40
    return max(int(width / CHARACTER_WIDTH), 20)


def millimetres(value: float) -> str:
    """Metres to ``12.3 mm``; a dash where nothing was measured."""
    return "–" if not math.isfinite(value) else f"{1000 * value:z.1f} mm"


def signed_millimetres(value: float) -> str:
    """Metres to ``+12.3 mm``; a dash where nothing was measured."""
    return "–" if not math.isfinite(value) else f"{1000 * value:+z.1f} mm"


def percent(value: float) -> str:
    """A share to ``42 %``."""
    return "–" if not math.isfinite(value) else f"{100 * value:z.0f} %"
