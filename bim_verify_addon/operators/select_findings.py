"""Select the elements of one class: one verdict, one change, one level reached."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, StringProperty

from .. import bonsai, scene
from ..capabilities import MODES


class BIMVERIFY_OT_select_findings(bpy.types.Operator):
    """Select all elements of one class."""

    bl_idname = "bim_verify.select_findings"
    bl_label = "Select These"
    bl_description = "Select all elements of this class; Shift adds to the selection"
    bl_options = {"REGISTER", "UNDO"}

    mode: StringProperty(name="Mode", default="STATUS", description="Colour mode that tells the classes apart")
    category: StringProperty(name="Class", description="Identifier of the class to look for, as DEVIATING of STATUS")
    extend: BoolProperty(name="Extend", description="Keep what is selected")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return needs_findings(cls, context)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self.extend = event.shift
        return self.execute(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        chosen = of_category(self, context)
        if chosen is None:
            return {"CANCELLED"}
        found = [*chosen.values(), *bonsai.objects(chosen)]
        if not self.extend:
            for item in context.view_layer.objects.selected[:]:
                item.select_set(False)
        visible = [item for item in found if item.visible_get()]
        for item in visible:
            item.select_set(True)
        if visible:
            context.view_layer.objects.active = visible[0]
        hidden = f", {len(found) - len(visible)} are hidden" if len(visible) < len(found) else ""
        self.report({"INFO"}, f"{len(visible)} element{'s' if len(visible) != 1 else ''} selected{hidden}")
        return {"FINISHED"}


def needs_findings(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Part of ``poll``: there are results, and objects can be selected."""
    if not context.scene.bim_verify.counts:
        cls.poll_message_set("Verify first")
        return False
    if context.mode != "OBJECT":
        cls.poll_message_set("Leave edit mode first")
        return False
    return True


def of_category(operator: bpy.types.Operator, context: bpy.types.Context) -> dict[str, bpy.types.Object] | None:
    """GlobalId -> object, of the class that the operator names; None (and said so) when there is no such class."""
    mode = MODES.get(operator.mode)
    if mode is None or mode.category is None or operator.category not in {c.identifier for c in mode.categories}:
        operator.report({"ERROR"}, f"There is no class {operator.category!r} in the colour mode {operator.mode!r}.")
        return None
    items = scene.element_objects(context.scene).items()
    return {global_id: item for global_id, item in items if mode.category(item) == operator.category}
