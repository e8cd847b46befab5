"""Through the camera of a photo, before and after it was placed."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, StringProperty

from .. import photo_scene
from ..sight import through_camera


class BIMVERIFY_OT_look_through(bpy.types.Operator):
    """Look at the model and the edges over the photo, from where it was given or from where it was placed."""

    bl_idname = "bim_verify.look_through"
    bl_label = "Look Through"
    bl_description = "Look over the photo at the model, from the pose that was given or from the one that was found"
    bl_options = {"REGISTER", "UNDO"}

    image: StringProperty(name="Image", description="Name of the image; empty: that of the active camera")
    given: BoolProperty(name="As given", description="From the pose of the cameras file, before the image was placed")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not any(photo_scene.PHOTO_KEY in item for item in context.scene.objects):
            cls.poll_message_set("Place photos first")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        active = context.view_layer.objects.active
        name = self.image or (active.get(photo_scene.PHOTO_KEY, "") if active is not None else "")
        item = photo_scene.pose_of(context.scene, name, given=self.given)
        if item is None:
            self.report({"ERROR"}, f"The scene has no camera of {name or 'a photo'}; select one, or place the photos anew.")
            return {"CANCELLED"}
        context.scene.camera = context.view_layer.objects.active = item
        through_camera(context)
        return {"FINISHED"}
