"""What changed between epochs: the step, its settings and the slider over epochs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy

from ...core.report import palette
from .. import change_scene, project
from ..capability import Capability, Step, StepState
from ..change_properties import BimVerifyChangeSettings
from ..colors import Category, categorical
from ..step_parts import main_button, missing, reached


def _state(scene: bpy.types.Scene) -> StepState:
    return reached(
        scene.bim_verify_change.summary,
        "Optional: what is new, gone, or as before, against the model or a reference epoch",
        missing(scene),
    )


def _draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    settings = context.scene.bim_verify_change
    layout.label(text="Reference (else the model):")
    layout.prop(settings, "reference", text="")
    layout.prop(settings, "each_file")
    main_button(layout, "change", "MOD_BUILD")
    if settings.epochs:
        layout.prop(settings, "epoch", slider=True, text=f"Shown: {settings.epoch_name or 'epoch'}")


def _expert(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    settings = context.scene.bim_verify_change
    column = layout.column(align=True)
    column.prop(settings, "voxel_mm")
    column.prop(settings, "min_points")


def _numbers(item: bpy.types.Object) -> list[tuple[str, str]]:
    states = str(item.get(change_scene.STATES_KEY, "")).split()
    names = str(bpy.context.scene.get(change_scene.EPOCHS_KEY, "")).split("\n")
    return [(name or "Change", state.capitalize()) for name, state in zip(names, states, strict=False)]


def _brief(item: bpy.types.Object, vertex: int) -> list[str]:
    state = change_scene.state_now(item)
    return [f"Change: {state.lower()}"] if state else []


def show(scene: bpy.types.Scene, result: Any) -> bool:
    """Put a comparison into the scene; False if the result is none."""
    from ...core.change.results import ChangeResult

    if not isinstance(result, ChangeResult):
        return False
    settings = scene.bim_verify
    settings.model_path = str(Path(result.model.path).resolve())
    for path in result.epoch.paths:
        entry = settings.scans.add()
        entry.path, entry.name = str(Path(path).resolve()), Path(path).name
    scene.bim_verify_change.voxel_mm = 1000 * result.edge
    project.adopt_frame(scene, result.model)
    change_scene.show_change(scene, result)
    return True


MODES = (
    categorical(
        change_scene.MODE,
        "Change",
        "What became of the element: at the epoch that the slider says",
        tuple(
            Category(state, state.capitalize(), palette.CHANGE_MEANINGS[state], color)
            for state, color in palette.CHANGE_COLORS.items()
        ),
        change_scene.state_now,
    ),
)

CAPABILITY = Capability(
    "change",
    Step("change", "Change", _state, _draw, _expert, optional=True),
    MODES,
    BimVerifyChangeSettings,
    numbers=_numbers,
    brief=_brief,
    forget=change_scene.forget,
    show=show,
)
