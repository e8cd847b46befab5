"""The model with displaced elements where they were found: the step, and the scene that shows what moved."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import StringProperty

from .. import scene as scenery
from .. import update_scene, verdicts
from ..capability import Capability, Step, StepState
from ..colors import Category, categorical
from ..session import SESSION
from ..step_parts import main_button, reached
from ..text import signed_millimetres


class BimVerifyUpdateSettings(bpy.types.PropertyGroup):
    """Of one scene."""

    summary: StringProperty()


def _state(scene: bpy.types.Scene) -> StepState:
    purpose = "Optional: a copy of the model with displaced elements where they were found"
    if scene.bim_verify.result_key not in SESSION.results:
        return reached(scene.bim_verify_update.summary, purpose, "Needs a verification")
    items = scenery.element_objects(scene).values()
    displaced = sum(verdicts.status(item) == "DEVIATING" and item.bim_verify.significant for item in items)
    said = f"{displaced} element{'s' if displaced != 1 else ''} found displaced" if displaced else "Nothing was found displaced"
    return reached(scene.bim_verify_update.summary, purpose, said)


def _draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    main_button(layout, "update_model", "MOD_ARRAY")
    layout.operator("bim_verify.undo_update", icon="LOOP_BACK")


def _kind(item: bpy.types.Object) -> str:
    return str(item.get(update_scene.KIND_KEY, ""))


def _numbers(item: bpy.types.Object) -> list[tuple[str, str]]:
    if not _kind(item):
        return []
    went = zip("XYZ", item[update_scene.SHIFT_KEY], strict=True)
    return [("Update", _kind(item).capitalize()), *((f"Moved {axis}", signed_millimetres(v)) for axis, v in went)]


def _forget(scene: bpy.types.Scene) -> None:
    scene.bim_verify_update.summary = ""
    scenery.remove(*(item for item in scene.objects if update_scene.PLANNED_KEY in item))
    for item in scenery.element_objects(scene).values():
        for key in (update_scene.KIND_KEY, update_scene.SHIFT_KEY):
            item.pop(key, None)


def show(scene: bpy.types.Scene, result: Any) -> bool:
    """Put an updated model into an empty scene; False if the result is none."""
    from ...core.update.update import UpdatedFile, update_lines

    if not isinstance(result, UpdatedFile):
        return False
    update_scene.show_update(scene, result)
    scene.bim_verify_update.summary = update_lines(result.result)[0]
    return True


MODES = (
    categorical(
        update_scene.MODE,
        "Update",
        "What was moved to its as-built place; wires show where it was",
        (
            Category("MOVED", "Moved", "To where it was found", (0.84, 0.37, 0.0)),
            Category("FOLLOWS", "Followed", "What it belongs to was moved", (0.34, 0.71, 0.91)),
            Category("KEPT", "Kept", "Its place, though what it hangs on was moved", (0.0, 0.62, 0.45)),
        ),
        _kind,
    ),
)

CAPABILITY = Capability(
    "update",
    Step("update", "Update", _state, _draw, optional=True),
    MODES,
    settings=BimVerifyUpdateSettings,
    numbers=_numbers,
    forget=_forget,
    show=show,
)
