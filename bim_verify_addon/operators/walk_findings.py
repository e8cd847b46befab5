"""Look at the elements of one class: one after the other, or all of them alone."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty
from mathutils import Vector

from .. import bonsai, scene
from ..sight import look_at, sight, views
from .select_findings import needs_findings, of_category


class BIMVERIFY_OT_step_finding(bpy.types.Operator):
    """Go to the next element of a class: select it and frame it."""

    bl_idname = "bim_verify.step_finding"
    bl_label = "Next Finding"
    bl_description = "Select the next (or previous) element of this class and frame it in the view"
    bl_options = {"REGISTER", "UNDO"}

    mode: StringProperty(name="Mode", default="STATUS", description="Colour mode that tells the classes apart")
    category: StringProperty(name="Class", description="Identifier of the class, as DEVIATING of STATUS")
    direction: EnumProperty(
        name="Direction",
        items=[("NEXT", "Next", "The one after the active element"), ("PREVIOUS", "Previous", "The one before it")],
        description="Which way to go",
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return needs_findings(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        found = of_category(self, context)
        if found is None:
            return {"CANCELLED"}
        here = context.view_layer.objects
        order = sorted((item for item in found.values() if item.name in here), key=_urgency)
        if not order:
            self.report({"INFO"}, "All of them are in collections that are excluded" if found else "There is none")
            return {"CANCELLED"}
        step = 1 if self.direction == "NEXT" else -1
        at = order.index(context.active_object) + step if context.active_object in order else (0 if step > 0 else -1)
        item = order[at % len(order)]
        for other in context.view_layer.objects.selected[:]:
            other.select_set(False)
        item.hide_set(False)
        item.select_set(True)
        context.view_layer.objects.active = item
        _frame(context, item)
        left_out = f"; {len(found) - len(order)} more are in excluded collections" if len(order) < len(found) else ""
        self.report({"INFO"}, f"{order.index(item) + 1} of {len(order)}: {item.name}{left_out}")
        return {"FINISHED"}


class BIMVERIFY_OT_isolate_findings(bpy.types.Operator):
    """Show the elements of one class alone, or everything again."""

    bl_idname = "bim_verify.isolate_findings"
    bl_label = "Isolate"
    bl_description = "Hide all elements but those of this class; press again to show everything"
    bl_options = {"REGISTER", "UNDO"}

    mode: StringProperty(name="Mode", default="STATUS", description="Colour mode that tells the classes apart")
    category: StringProperty(name="Class", description="Identifier of the class, as DEVIATING of STATUS")
    show_all: BoolProperty(name="Show all", description="Show everything again")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return needs_findings(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        items = scene.element_objects(context.scene)
        if self.show_all:
            shown = set(items)
        else:
            found = of_category(self, context)
            if found is None:
                return {"CANCELLED"}
            shown = set(found)
            if shown == {g for g, item in items.items() if not item.hide_get()}:
                shown = set(items)
        for global_id, item in items.items():
            if item.name in context.view_layer.objects:
                item.hide_set(global_id not in shown)
        for item in bonsai.objects(items):
            if item.name in context.view_layer.objects:
                item.hide_set(True)
        return {"FINISHED"}


def _urgency(item: bpy.types.Object) -> tuple[float, str]:
    shift = item.bim_verify.displacement
    return (-shift if shift == shift else 0.0, item.name)


def _frame(context: bpy.types.Context, item: bpy.types.Object) -> None:
    """Look at an object so that it is seen; without a window there is no view."""
    for area in views(context)[:1]:
        view = area.spaces.active.region_3d
        look_at(context, area, sight(context, item, view.view_rotation @ Vector((0.0, 0.0, 1.0))))
