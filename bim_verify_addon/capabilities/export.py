"""The results out of Blender."""

from __future__ import annotations

import bpy

from .. import bonsai, ifc_edits, verdicts
from ..capability import Capability, Step, StepState
from ..session import SESSION
from ..step_parts import main_button


def _state(scene: bpy.types.Scene) -> StepState:
    settings = scene.bim_verify
    if settings.exported_path:
        return StepState(True, f"Written: {settings.exported_path}")
    if settings.result_key in SESSION.results or ifc_edits.kept(scene):
        in_bonsai = bonsai.live_file() is not None
        return StepState(in_bonsai, "In Bonsai's project: save it there" if in_bonsai else "Ready")
    return StepState(False, "Verify again in this session" if verdicts.verified(scene) else "Needs a result")


def _draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    main_button(layout, "export_ifc", "EXPORT")
    column = layout.column(align=True)
    column.operator("bim_verify.export_bcf", icon="BOOKMARKS")
    column.operator("bim_verify.report", icon="TEXT")
    column.operator("bim_verify.export_table", icon="SPREADSHEET")
    column.operator("bim_verify.export_dimensions", icon="DRIVER_DISTANCE")


def _expert(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    layout.operator("bim_verify.export_ids", icon="CHECKBOX_HLT")
    layout.operator("bim_verify.export_templates", icon="PRESET")


CAPABILITY = Capability("export", Step("export", "Export", _state, _draw, _expert))
