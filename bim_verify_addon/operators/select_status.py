"""Select the elements of one verdict."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, EnumProperty

from ...core.report.palette import STATUS_LABELS, STATUS_MEANINGS
from .. import bonsai, scene

STATUS_ITEMS = [(status, label, STATUS_MEANINGS[status]) for status, label in STATUS_LABELS.items()]


class BIMVERIFY_OT_select_status(bpy.types.Operator):
    """Select all elements with one status."""

    bl_idname = "bim_verify.select_status"
    bl_label = "Select These"
    bl_description = "Select all elements with this status; Shift adds to the selection"
    bl_options = {"REGISTER", "UNDO"}

    status: EnumProperty(name="Status", items=STATUS_ITEMS, description="The verdict to look for")
    extend: BoolProperty(name="Extend", description="Keep what is selected")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not context.scene.bim_verify.counts:
            cls.poll_message_set("Verify first")
            return False
        if context.mode != "OBJECT":
            cls.poll_message_set("Leave edit mode first")
            return False
        return True

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self.extend = event.shift
        return self.execute(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        chosen = {g: o for g, o in scene.element_objects(context.scene).items() if o.bim_verify.status == self.status}
        found = [*chosen.values(), *bonsai.objects(chosen)]
        if not self.extend:
            for item in context.view_layer.objects.selected[:]:
                item.select_set(False)
        visible = [item for item in found if item.visible_get()]
        for item in visible:
            item.select_set(True)
        if visible:
            context.view_layer.objects.active = visible[0]
        self.report({"INFO"}, f"{len(chosen)} elements are {STATUS_LABELS[self.status].lower()}")
        return {"FINISHED"}
