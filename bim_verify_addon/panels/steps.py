"""Model -> Scans -> Align -> Verify -> Export: each step with its state and one main button."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import bpy

from ..jobs import duration
from ..session import SESSION
from . import state
from .text import wrapped

TAB = "BIM Verify"


class BIMVERIFY_UL_scans(bpy.types.UIList):
    """The scan files."""

    def draw_item(self, context, layout, data, item, icon, active_data, active_property, index) -> None:  # type: ignore[no-untyped-def]
        row = layout.row(align=True)
        row.prop(item, "use", text="")
        row.label(text=item.name)
        row.label(text=f"{item.points / 1e6:.2f} M")


class BIMVERIFY_PT_steps(bpy.types.Panel):
    """The frame of the steps; while a job runs, its progress."""

    bl_label = "BIM Verify"
    bl_idname = "BIMVERIFY_PT_steps"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = TAB

    def draw(self, context: bpy.types.Context) -> None:
        job = SESSION.job
        if job is None:
            return
        left = "" if job.seconds_left is None else f", {duration(job.seconds_left)} left"
        self.layout.progress(factor=job.fraction, text=f"{job.title} {100 * job.fraction:.0f} %{left}")
        self.layout.label(text=f"{job.message} (Esc cancels)")


Draw = Callable[[bpy.types.UILayout, bpy.types.Context], None]


@dataclass(frozen=True)
class Step:
    """One step of the work."""

    name: str
    label: str
    state: Callable[[bpy.types.Scene], state.StepState]
    draw: Draw


def _draw_model(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    layout.operator("bim_verify.import_ifc", icon="HOME")


def _draw_scans(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    settings = context.scene.bim_verify
    if settings.scans:
        row = layout.row()
        row.template_list("BIMVERIFY_UL_scans", "", settings, "scans", settings, "scan_index", rows=2)
        row.operator("bim_verify.remove_scan", text="", icon="REMOVE")
    layout.operator("bim_verify.import_scan", icon="ADD")
    _expert(layout, settings, "show_expert_scans", ("scan_frame", "origin", "display_points"))


def _draw_align(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    layout.operator_menu_enum("bim_verify.align", "mode", text="Align Scans", icon="ORIENTATION_GLOBAL")
    layout.prop(context.scene.bim_verify, "align", text="When verifying")


def _draw_verify(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    settings = context.scene.bim_verify
    column = layout.column(align=True)
    column.prop(settings, "loa")
    column.prop(settings, "sigma_mm")
    row = layout.row()
    row.scale_y = 1.4
    row.operator("bim_verify.verify", icon="VIEWZOOM")
    _expert(layout, settings, "show_expert", ("spacing_mm", "fusion", "threads", "memory_gb", "display_vertices"))


def _draw_export(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    layout.operator("bim_verify.export_ifc", icon="EXPORT")


def _expert(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup, toggle: str, names: tuple[str, ...]) -> None:
    shown = getattr(settings, toggle)
    layout.prop(settings, toggle, emboss=False, icon="TRIA_DOWN" if shown else "TRIA_RIGHT")
    if shown:
        column = layout.column(align=True)
        for name in names:
            column.prop(settings, name)


STEPS: tuple[Step, ...] = (
    Step("model", "1  Model", state.model, _draw_model),
    Step("scans", "2  Scans", state.scans, _draw_scans),
    Step("align", "3  Align", state.align, _draw_align),
    Step("verify", "4  Verify", state.verify, _draw_verify),
    Step("export", "5  Export", state.export, _draw_export),
)


def _panel(step: Step) -> type[bpy.types.Panel]:
    def draw_header(self: bpy.types.Panel, context: bpy.types.Context) -> None:
        self.layout.label(text="", icon="CHECKMARK" if step.state(context.scene).done else "RADIOBUT_OFF")

    def draw(self: bpy.types.Panel, context: bpy.types.Context) -> None:
        wrapped(self.layout, context, step.state(context.scene).text)
        step.draw(self.layout, context)

    identifier = f"BIMVERIFY_PT_step_{step.name}"
    return type(
        identifier,
        (bpy.types.Panel,),
        {
            "__doc__": f"{step.label}.",
            "bl_label": step.label,
            "bl_idname": identifier,
            "bl_space_type": "VIEW_3D",
            "bl_region_type": "UI",
            "bl_category": TAB,
            "bl_parent_id": "BIMVERIFY_PT_steps",
            "draw_header": draw_header,
            "draw": draw,
        },
    )


STEP_PANELS = tuple(_panel(step) for step in STEPS)
