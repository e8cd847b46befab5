"""An updated model in the scene: what moved, what followed, and a wire copy of each where it was planned."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy
import numpy as np

from . import frame, project, scene

if TYPE_CHECKING:
    from ..core.update.update import Update, UpdatedFile

MODE = "UPDATE"
KIND_KEY, SHIFT_KEY = "bim_verify_update", "bim_verify_update_shift"
"""On element objects: what happened to it; how far it went in this update, metres, axes of the model frame."""
PLANNED_KEY = "bim_verify_planned"
"""On the wire copies: the GlobalId of the element."""
PLANNED = "Place before"


def show_update(target: bpy.types.Scene, updated: UpdatedFile) -> None:
    """Fill an empty scene with the updated model; a wire copy stands where each moved element was."""
    from ..core.update.update import FOLLOWS, OWN

    model = project.model_of(updated.file)
    project.adopt_frame(target, model)
    scene.show_model(target, model)
    objects = scene.element_objects(target)
    for update in updated.result.updates:
        item = objects.get(update.global_id)
        if item is None:
            continue
        item[KIND_KEY], item[SHIFT_KEY] = update.kind, [float(v) for v in update.shift]
        if update.kind in (OWN, FOLLOWS):
            _wire_copy(target, item, update)
    target.bim_verify.color_mode = MODE


def _wire_copy(target: bpy.types.Scene, item: bpy.types.Object, update: Update) -> None:
    copy = bpy.data.objects.new(f"{item.name} before", item.data)
    copy[PLANNED_KEY] = update.global_id
    copy[frame.ORIGIN_KEY] = [float(v) for v in np.array(item[frame.ORIGIN_KEY][:]) - np.array(update.shift)]
    copy.display_type, copy.hide_select, copy.hide_render = "WIRE", True, True
    frame.place(copy, frame.stored(target) or frame.ViewFrame())
    scene.collection(target, PLANNED).objects.link(copy)
