"""Text that fits the sidebar, and numbers as a modeller reads them."""

from __future__ import annotations

import math
import textwrap

import bpy

CHARACTER_WIDTH = 6.2
"""Pixels of an average character of the panel font at interface scale 1."""


def wrapped(layout: bpy.types.UILayout, context: bpy.types.Context, text: str) -> None:
    """Labels, one a line, broken at the width of the region."""
    region = context.region
    width = (region.width if region is not None else 300) / context.preferences.system.ui_scale - 40
    column = layout.column(align=True)
    column.scale_y = 0.75
    for paragraph in text.splitlines():
        for line in textwrap.wrap(paragraph, max(int(width / CHARACTER_WIDTH), 20)):
            column.label(text=line)


def millimetres(value: float) -> str:
    """Metres to ``12.3 mm``; a dash where nothing was measured."""
    return "–" if not math.isfinite(value) else f"{1000 * value:z.1f} mm"


def signed_millimetres(value: float) -> str:
    """Metres to ``+12.3 mm``; a dash where nothing was measured."""
    return "–" if not math.isfinite(value) else f"{1000 * value:+z.1f} mm"


def percent(value: float) -> str:
    """A share to ``42 %``."""
    return "–" if not math.isfinite(value) else f"{100 * value:z.0f} %"
