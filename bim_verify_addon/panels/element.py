"""The active element: what each capability knows of it, and why."""

from __future__ import annotations

import bpy

from ..capabilities import CAPABILITIES
from ..known import known_object
from ..text import table, wrapped
from .steps import TAB


class BIMVERIFY_PT_element(bpy.types.Panel):
    """The active element."""

    bl_label = "Active Element"
    bl_idname = "BIMVERIFY_PT_element"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = TAB

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return known_object(context) is not None

    def draw(self, context: bpy.types.Context) -> None:
        item = known_object(context)
        if item is None:
            return
        layout, stored = self.layout, item.bim_verify
        layout.label(text=f"{stored.ifc_class}  {stored.element_name or 'unnamed'}")
        if stored.storey:
            layout.label(text=stored.storey)
        layout.operator("bim_verify.decide", icon="USER")
        for capability in CAPABILITIES:
            rows = capability.numbers(item) if capability.numbers is not None else []
            if not rows:
                continue
            box = layout.box()
            if capability.why is not None:
                wrapped(box, context, capability.why(item))
            table(box, context, rows)
