"""Preferences of the extension."""

from __future__ import annotations

import bpy
from bpy.props import IntProperty

from ..core.model import tessellation_cache

PACKAGE = __package__.rpartition(".")[0]


class BimVerifyPreferences(bpy.types.AddonPreferences):
    """What a user sets once for all files."""

    bl_idname = PACKAGE

    legend_size: IntProperty(name="Legend size", default=12, min=8, max=32, description="Height of the legend's text, points")

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.prop(self, "legend_size")
        self.layout.label(text=f"Tessellations are kept in {tessellation_cache.folder()}")


def legend_size(context: bpy.types.Context) -> int:
    """The preference, or its default where the package was not enabled as an extension."""
    entry = context.preferences.addons.get(PACKAGE)
    return 12 if entry is None or entry.preferences is None else int(entry.preferences.legend_size)
