"""How a panelled wall moved between two scans: the step, its settings, and the scene that shows it."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import EnumProperty, FloatProperty, StringProperty

from .. import wall_scene
from ..capability import Capability, Step, StepState
from ..text import wrapped


def _recolor(settings: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    wall_scene.recolor(settings.id_data)


class BimVerifyDisplacementSettings(bpy.types.PropertyGroup):
    """Of one scene."""

    base: StringProperty(name="Base", subtype="FILE_PATH", description="Scan of the base epoch")
    later: StringProperty(
        name="Later", subtype="FILE_PATH", description="Scan of the later epoch, registered to the same frame"
    )
    registration_sigma_mm: FloatProperty(
        name="Registration", default=1.0, min=0.0, max=999.0,
        description="Standard deviation of the registration between the epochs, millimetres",
    )
    direction: EnumProperty(
        name="Colours",
        items=(
            ("LATERAL", "Out of the wall", "Movement along the face's normal; pale where it is not significant"),
            ("VERTICAL", "Upwards", "Movement of the joints upwards, by proportion between them"),
        ),
        update=_recolor,
    )


def _state(scene: bpy.types.Scene) -> StepState:
    found = scene.get(wall_scene.SUMMARY_KEY, "")
    return StepState(bool(found), found or "Optional: how a panelled wall moved between two scans")


def _draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    settings = context.scene.bim_verify_displacement
    layout.prop(settings, "base")
    layout.prop(settings, "later")
    layout.operator("bim_verify.displacement", icon="MOD_ARRAY")
    if wall_scene.SUMMARY_KEY in context.scene:
        layout.row().prop(settings, "direction", expand=True)
    item = context.object
    if item is not None and wall_scene.COLUMN_KEY in item:
        box = layout.box()
        box.label(text=item.name)
        for line in str(item["note"]).splitlines():
            wrapped(box, context, line)


def _expert(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    layout.prop(context.scene.bim_verify_displacement, "registration_sigma_mm")


def show(scene: bpy.types.Scene, result: Any) -> bool:
    """Put a wall's displacement into the scene; False if the result is none."""
    from ...core.wall_displacement.result import DisplacementResult

    if not isinstance(result, DisplacementResult):
        return False
    wall_scene.show_displacement(scene, result)
    return True


CAPABILITY = Capability(
    "displacement",
    Step("displacement", "Wall Displacement", _state, _draw, _expert, optional=True),
    settings=BimVerifyDisplacementSettings,
    forget=wall_scene.forget,
    show=show,
)
