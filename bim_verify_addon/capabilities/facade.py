"""Facade mock-ups: the step, and the rectangles that show what was found."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import StringProperty

from .. import facade_scene
from ..capability import Capability, Step, StepState


class BimVerifyFacadeSettings(bpy.types.PropertyGroup):
    """Of one scene."""

    summary: StringProperty()


def _state(scene: bpy.types.Scene) -> StepState:
    found = scene.bim_verify_facade.summary
    return StepState(bool(found), found or "Optional: a mock-up model from a photo of a facade")


def _draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    layout.operator("bim_verify.facade", icon="IMAGE_DATA")
    layout.operator("bim_verify.write_facade", icon="EXPORT")
    item = context.object
    if item is not None and facade_scene.BOX_KEY in item:
        layout.prop(item, f'["{facade_scene.KIND_KEY}"]', text="Kind")
        layout.prop(item, f'["{facade_scene.RISE_KEY}"]', text="Arch rise")


def show(scene: bpy.types.Scene, result: Any) -> bool:
    """Put a mock-up into an empty scene; False if the result is none."""
    if not facade_scene.show(scene, result):
        return False
    from ...core.facade.report import summary

    scene.bim_verify_facade.summary = summary(result)
    return True


CAPABILITY = Capability(
    "facade", Step("facade", "Facade", _state, _draw, optional=True), settings=BimVerifyFacadeSettings, show=show,
)
