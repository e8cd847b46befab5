"""How a panelled wall moved between two scans: the step, its settings, and the scene that shows it."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import EnumProperty, FloatProperty, StringProperty

from ...core.report import palette
from .. import wall_scene
from ..capability import Capability, Step, StepState
from ..colors import Legend, scale_of
from ..shared_settings import ReportBeside, WallChoice
from ..step_parts import main_button, reached
from ..text import wrapped


def _recolor(settings: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    wall_scene.recolor(settings.id_data)


class BimVerifyDisplacementSettings(WallChoice, ReportBeside, bpy.types.PropertyGroup):
    """Of one scene."""

    base: StringProperty(name="Base", subtype="FILE_PATH", description="Scan of the base epoch")
    later: StringProperty(
        name="Later", subtype="FILE_PATH", description="Scan of the later epoch, registered to the same frame"
    )
    registration_sigma_mm: FloatProperty(
        name="Registration sigma (mm)", default=1.0, min=0.0, max=999.0,
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
    settings = scene.bim_verify_displacement
    lacks = "" if settings.base.strip() and settings.later.strip() else "Needs the scans of both epochs"
    return reached(found, "Optional: how a panelled wall moved between two scans", lacks)


def _draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    settings = context.scene.bim_verify_displacement
    layout.prop(settings, "base")
    layout.prop(settings, "later")
    layout.prop(settings, "element")
    main_button(layout, "displacement", "MOD_ARRAY")
    if wall_scene.SUMMARY_KEY in context.scene:
        layout.row().prop(settings, "direction", expand=True)
        row = layout.row()
        row.operator("bim_verify.export_displacement", icon="EXPORT")
        row.prop(settings, "with_report")
    item = context.object
    if item is not None and wall_scene.COLUMN_KEY in item:
        box = layout.box()
        box.label(text=item.name)
        for line in str(item["note"]).splitlines():
            wrapped(box, context, line)


def _expert(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    for name in ("near", "registration_sigma_mm"):
        layout.prop(context.scene.bim_verify_displacement, name)


def _legend(scene: bpy.types.Scene) -> Legend | None:
    if wall_scene.SUMMARY_KEY not in scene:
        return None
    limit = float(scene[wall_scene.LIMIT_KEY])
    return Legend(
        (("Not measured", palette.UNMEASURED),),
        scale_of(-limit, limit, unit="mm", stops=palette.DEVIATION_STOPS),
    )


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
    legend=_legend,
    forget=wall_scene.forget,
    show=show,
)
