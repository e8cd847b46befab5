"""Photos on the model: the step, and the cameras that show them."""

from __future__ import annotations

from typing import Any

import bpy

from .. import bundle_scene, photo_scene
from ..capability import Capability, Step, StepState
from ..colors import Legend
from ..step_parts import main_button, missing, reached
from ..text import wrapped


def _state(scene: bpy.types.Scene) -> StepState:
    found = " ".join(scene[key] for key in (photo_scene.SUMMARY_KEY, bundle_scene.SUMMARY_KEY) if key in scene)
    return reached(
        found, "Optional: put photos on the model and look through their cameras", missing(scene, scans=False)
    )


def _draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    main_button(layout, "coregister", "IMAGE_BACKGROUND")
    layout.operator("bim_verify.bundle", icon="OUTLINER_OB_POINTCLOUD")
    if photo_scene.RESULT_KEY in context.scene:
        layout.operator("bim_verify.export_cameras", icon="EXPORT")
    item = context.object
    if item is not None and bundle_scene.BUNDLE_KEY in item and item.type == "CAMERA":
        wrapped(layout.box(), context, f"{item[bundle_scene.BUNDLE_KEY]}: {item['note']}")
    if item is not None and photo_scene.PHOTO_KEY in item and item.type == "CAMERA":
        box = layout.box()
        wrapped(box, context, f"{item[photo_scene.PHOTO_KEY]}: {str(item['bim_verify_state']).lower()}. {item['note']}")
        row = box.row(align=True)
        for given, text in ((True, "Before"), (False, "After")):
            button = row.operator("bim_verify.look_through", text=text, icon="VIEW_CAMERA")
            button.image, button.given = item[photo_scene.PHOTO_KEY], given


def show(scene: bpy.types.Scene, result: Any) -> bool:
    """Put a co-registration or an adjusted bundle into the scene; False if the result is none."""
    return photo_scene.show(scene, result) or bundle_scene.show(scene, result)


def _legend(scene: bpy.types.Scene) -> Legend | None:
    return photo_scene.legend(scene) or bundle_scene.legend(scene)


CAPABILITY = Capability("photos", Step("photos", "Photos", _state, _draw, optional=True), legend=_legend, show=show)
