"""The result as a whole: how many elements of each class, what the colours say."""

from __future__ import annotations

import bpy

from .. import bonsai
from ..capabilities import MODES
from ..text import wrapped
from .steps import TAB

BUTTONS = (
    ("select_findings", "RESTRICT_SELECT_OFF"),
    ("isolate_findings", "VIEWZOOM"),
    ("step_finding", "TRIA_LEFT"),
    ("step_finding", "TRIA_RIGHT"),
)
"""Of each class: (operator, icon)."""


class BIMVERIFY_PT_result(bpy.types.Panel):
    """Colour mode; the classes of that mode, each with its count and buttons to select, isolate and step."""

    bl_label = "Result"
    bl_idname = "BIMVERIFY_PT_result"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = TAB

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(context.scene.bim_verify.has_findings)

    def draw(self, context: bpy.types.Context) -> None:
        settings, layout = context.scene.bim_verify, self.layout
        if settings.result_summary:
            wrapped(layout, context, settings.result_summary)
        if settings.overruled:
            many = f"{settings.overruled} verdicts are" if settings.overruled > 1 else "1 verdict is"
            wrapped(layout, context, f"{many} overruled by a person")
        layout.prop(settings, "color_mode")
        if settings.color_mode == "DEVIATION":
            layout.prop(settings, "deviation_range_mm")
        row = layout.row(align=True)
        row.prop(settings, "show_legend", toggle=True)
        row.prop(settings, "show_numbers", toggle=True)
        row.prop(settings, "show_hover", toggle=True)
        mode = MODES[settings.color_mode]
        labels = {entry.identifier: entry.label for entry in mode.categories}
        column = layout.column(align=True)
        for entry in settings.counts:
            if entry.mode != mode.identifier:
                continue
            row = column.row(align=True)
            row.enabled = entry.count > 0
            row.label(text=labels[entry.category])
            row.label(text=str(entry.count))
            for name, icon in BUTTONS:
                button = row.operator(f"bim_verify.{name}", text="", icon=icon)
                button.mode, button.category = entry.mode, entry.category
                if icon == "TRIA_LEFT":
                    button.direction = "PREVIOUS"
        if any(entry.mode == mode.identifier for entry in settings.counts):
            layout.operator("bim_verify.isolate_findings", text="Show All", icon="HIDE_OFF").show_all = True
        if bonsai.live_file() is not None:
            row = layout.row(align=True)
            row.operator("bim_verify.show_results", text="Results").planned = False
            row.operator("bim_verify.show_results", text="Bonsai's Objects").planned = True
        if settings.result_note:
            wrapped(layout.box(), context, settings.result_note)
