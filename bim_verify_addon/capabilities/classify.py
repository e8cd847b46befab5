"""The scans, element by element: the step."""

from __future__ import annotations

import bpy
from bpy.props import StringProperty

from ..capability import Capability, Step, StepState


class BimVerifyClassifySettings(bpy.types.PropertyGroup):
    """Of one scene."""

    summary: StringProperty()


def _state(scene: bpy.types.Scene) -> StepState:
    found = scene.bim_verify_classify.summary
    return StepState(bool(found), found or "Optional: the scans split by element, for other programs")


def _draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    layout.operator("bim_verify.classify", icon="OUTLINER_OB_POINTCLOUD")


def _forget(scene: bpy.types.Scene) -> None:
    scene.bim_verify_classify.summary = ""


CAPABILITY = Capability(
    "classify", Step("classify", "Classify", _state, _draw, optional=True), settings=BimVerifyClassifySettings,
    forget=_forget,
)
