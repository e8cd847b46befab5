"""How good the scans are and where to scan next: the step, and the scene that shows it."""

from __future__ import annotations

from typing import Any

import bpy

from .. import survey_scene
from ..capability import Capability, Step, StepState
from ..text import wrapped


def _state(scene: bpy.types.Scene) -> StepState:
    found = scene.get(survey_scene.SUMMARY_KEY, "")
    return StepState(bool(found), found or "How good the scans are, what is missing and why, and where to scan next")


def _draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    layout.operator("bim_verify.quality", icon="SHADING_TEXTURE")
    layout.operator("bim_verify.plan", icon="OUTLINER_OB_LIGHTPROBE")
    layout.operator("bim_verify.simulate", icon="OUTLINER_OB_POINTCLOUD")
    item = context.object
    if item is not None and "bim_verify_quality" in item:
        wrapped(layout.box(), context, item["bim_verify_quality"])
    elif item is not None and survey_scene.STATION_KEY in item:
        wrapped(layout.box(), context, f"{item[survey_scene.STATION_KEY]}: {item['note']}")


def show(scene: bpy.types.Scene, result: Any) -> bool:
    """Put a survey or a plan into the scene; False if the result is neither."""
    return survey_scene.show_any(scene, result, scene.bim_verify.display_vertices)


CAPABILITY = Capability("quality", Step("quality", "Quality", _state, _draw, optional=True), show=show)
