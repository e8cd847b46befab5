"""Facade mock-ups: the step, and the rectangles that show what was found."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import EnumProperty, FloatProperty, StringProperty

from .. import facade_scene
from ..capability import Capability, Step, StepState
from ..shared_settings import FacadeInputs, ReportBeside
from ..step_parts import main_button, reached


def _kind(box: bpy.types.PropertyGroup) -> int:
    return facade_scene.KINDS.index(facade_scene.kind_of(box.id_data))


def _set_kind(box: bpy.types.PropertyGroup, value: int) -> None:
    facade_scene.set_kind(box.id_data, facade_scene.KINDS[value])


def _rise(box: bpy.types.PropertyGroup) -> float:
    return facade_scene.rise_of(box.id_data)


def _shape(box: bpy.types.PropertyGroup) -> int:
    return int(facade_scene.rise_of(box.id_data) > 0)


def _set_shape(box: bpy.types.PropertyGroup, value: int) -> None:
    facade_scene.set_arched(box.id_data, bool(value))


def _set_rise(box: bpy.types.PropertyGroup, value: float) -> None:
    box.id_data[facade_scene.RISE_KEY] = value


class BimVerifyFacadeBox(bpy.types.PropertyGroup):
    """A window or door, on its rectangle; kept in custom properties, so that a copy of the rectangle has them too."""

    kind: EnumProperty(
        name="Kind", get=_kind, set=_set_kind, description="What the rectangle stands for",
        items=[("WINDOW", "Window", "A window in an opening"), ("DOOR", "Door", "A door in an opening")],
    )
    shape: EnumProperty(
        name="Shape", get=_shape, set=_set_shape, description="Of the opening's top",
        items=[("RECTANGULAR", "Straight", "A straight top"), ("ARCHED", "Arched", "An arch over its sides")],
    )
    rise: FloatProperty(
        name="Arch rise", unit="LENGTH", min=0.0, get=_rise, set=_set_rise,
        description="Of the arch over its sides, metres; half of the width: a half circle",
    )


class BimVerifyFacadeSettings(FacadeInputs, ReportBeside, bpy.types.PropertyGroup):
    """Of one scene."""

    summary: StringProperty()


def _state(scene: bpy.types.Scene) -> StepState:
    settings = scene.bim_verify_facade
    known = settings.width or settings.height or settings.floor_height or settings.footprint.strip()
    lacks = "" if known else "Without a known length the scale is a guess (12 %)"
    return reached(settings.summary, "Optional: a mock-up model from a photo of a facade", lacks)


def _draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    settings = context.scene.bim_verify_facade
    column = layout.column(align=True)
    for name in ("width", "height", "floor_height", "footprint"):
        column.prop(settings, name)
    main_button(layout, "facade", "IMAGE_DATA")
    row = layout.row()
    row.operator("bim_verify.write_facade", icon="EXPORT")
    row.prop(settings, "with_report")
    item = context.object
    if item is not None and facade_scene.BOX_KEY in item:
        box = layout.box()
        box.label(text=item.name)
        box.row().prop(item.bim_verify_facade, "kind", expand=True)
        box.row().prop(item.bim_verify_facade, "shape", expand=True)
        if facade_scene.rise_of(item) > 0:
            box.prop(item.bim_verify_facade, "rise")


def _expert(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    for name in ("corners", "crs"):
        layout.prop(context.scene.bim_verify_facade, name)


def show(scene: bpy.types.Scene, result: Any) -> bool:
    """Put a mock-up into an empty scene; False if the result is none."""
    if not facade_scene.show(scene, result):
        return False
    from ...core.facade.report import summary

    scene.bim_verify_facade.summary = summary(result)
    return True


CAPABILITY = Capability(
    "facade", Step("facade", "Facade", _state, _draw, _expert, optional=True), settings=BimVerifyFacadeSettings,
    element=BimVerifyFacadeBox, show=show,
)
