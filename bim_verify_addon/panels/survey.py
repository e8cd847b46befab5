"""Scan quality and planning: beside the steps of verification."""

from __future__ import annotations

import bpy

from ...core.quality.json_out import CAUSE_COLORS
from .. import survey_scene
from .steps import TAB
from .text import wrapped


class BIMVERIFY_PT_survey(bpy.types.Panel):
    """What the scans are worth, where to scan next, and a scan of the scene itself."""

    bl_label = "Scan Quality and Planning"
    bl_idname = "BIMVERIFY_PT_survey"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = TAB
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        if survey_scene.SUMMARY_KEY in context.scene:
            wrapped(layout, context, context.scene[survey_scene.SUMMARY_KEY])
        layout.operator("bim_verify.quality", icon="SHADING_TEXTURE")
        layout.operator("bim_verify.plan", icon="OUTLINER_OB_LIGHTPROBE")
        layout.operator("bim_verify.simulate", icon="OUTLINER_OB_POINTCLOUD")
        item = context.object
        if item is not None and "bim_verify_quality" in item:
            wrapped(layout.box(), context, item["bim_verify_quality"])
        elif item is not None and survey_scene.STATION_KEY in item:
            wrapped(layout.box(), context, f"{item[survey_scene.STATION_KEY]}: {item['note']}")
        wrapped(layout, context, f"Colours: {', '.join(CAUSE_COLORS)}.")
