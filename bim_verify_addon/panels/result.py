"""The result as a whole: counts per status, what the colours say."""

from __future__ import annotations

import bpy

from ...core.report.palette import STATUS_LABELS
from .. import bonsai
from .steps import TAB
from .text import wrapped


class BIMVERIFY_PT_result(bpy.types.Panel):
    """Counts per status, each with a button that selects these elements; colour mode and legend."""

    bl_label = "Result"
    bl_idname = "BIMVERIFY_PT_result"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = TAB

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(context.scene.bim_verify.counts)

    def draw(self, context: bpy.types.Context) -> None:
        settings, layout = context.scene.bim_verify, self.layout
        wrapped(layout, context, settings.result_summary)
        column = layout.column(align=True)
        for entry in settings.counts:
            row = column.row(align=True)
            row.enabled = entry.count > 0
            row.label(text=STATUS_LABELS[entry.status])
            row.label(text=str(entry.count))
            row.operator("bim_verify.select_status", text="", icon="RESTRICT_SELECT_OFF").status = entry.status
        layout.prop(settings, "color_mode")
        if settings.color_mode == "DEVIATION":
            layout.prop(settings, "deviation_range_mm")
        layout.prop(settings, "show_legend")
        if bonsai.live_file() is not None:
            row = layout.row(align=True)
            row.operator("bim_verify.show_results", text="Results").planned = False
            row.operator("bim_verify.show_results", text="Bonsai's Objects").planned = True
        if settings.result_note:
            wrapped(layout.box(), context, settings.result_note)
