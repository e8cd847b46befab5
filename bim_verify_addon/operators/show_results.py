"""Switch between Bonsai's objects and the coloured surfaces."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty

from .. import bonsai, scene


class BIMVERIFY_OT_show_results(bpy.types.Operator):
    """Show the coloured surfaces in place of Bonsai's objects, or the other way round."""

    bl_idname = "bim_verify.show_results"
    bl_label = "Show Results"
    bl_description = "Show the coloured surfaces in place of Bonsai's objects, or the other way round"
    bl_options = {"REGISTER", "UNDO"}

    planned: BoolProperty(name="Bonsai's objects", description="Show Bonsai's objects and hide the coloured surfaces")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if bonsai.live_file() is None:
            cls.poll_message_set("Only needed when Bonsai holds the project")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        scene.show_planned(context, self.planned)
        return {"FINISHED"}
