"""Photos on the model: the step, and the cameras that show them."""

from __future__ import annotations

from typing import Any

import bpy

from .. import photo_scene
from ..capability import Capability, Step, StepState
from ..step_parts import main_button, missing, reached
from ..text import wrapped


def _state(scene: bpy.types.Scene) -> StepState:
    found = scene.get(photo_scene.SUMMARY_KEY, "")
    return reached(
        found, "Optional: put photos on the model and look through their cameras", missing(scene, scans=False)
    )


def _draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    main_button(layout, "coregister", "IMAGE_BACKGROUND")
    item = context.object
    if item is not None and photo_scene.PHOTO_KEY in item and item.type == "CAMERA":
        box = layout.box()
        wrapped(box, context, f"{item[photo_scene.PHOTO_KEY]}: {str(item['bim_verify_state']).lower()}. {item['note']}")
        row = box.row(align=True)
        for given, text in ((True, "Before"), (False, "After")):
            button = row.operator("bim_verify.look_through", text=text, icon="VIEW_CAMERA")
            button.image, button.given = item[photo_scene.PHOTO_KEY], given


def show(scene: bpy.types.Scene, result: Any) -> bool:
    """Put a co-registration into the scene; False if the result is none."""
    return photo_scene.show(scene, result)


CAPABILITY = Capability(
    "photos", Step("photos", "Photos", _state, _draw, optional=True), legend=photo_scene.legend, show=show
)
