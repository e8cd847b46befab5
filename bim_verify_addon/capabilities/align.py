"""Scans onto the model."""

from __future__ import annotations

import bpy

from ..capability import Capability, Step, StepState
from ..step_parts import MAIN_HEIGHT, missing, reached


def _state(scene: bpy.types.Scene) -> StepState:
    settings = scene.bim_verify
    aligns = settings.align != "none"
    said = f"Verify and Find Changes align the scans first: {settings.align}"
    way = said if aligns else "Optional: scans are taken as they are"
    return reached(settings.alignment_summary, way, missing(scene))


def _draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    row = layout.row()
    row.scale_y = MAIN_HEIGHT
    row.operator_menu_enum("bim_verify.align", "mode", text="Align Scans", icon="ORIENTATION_GLOBAL")
    layout.prop(context.scene.bim_verify, "align", text="In Verify, Change")


CAPABILITY = Capability("align", Step("align", "Align", _state, _draw, optional=True))
