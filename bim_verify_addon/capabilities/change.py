"""What changed between epochs: the step, its settings and the slider over epochs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy

from ...core.report import palette
from .. import change_scene, project
from ..capability import Capability, Step, StepState
from ..change_properties import BimVerifyChangeSettings, BimVerifyReferenceScan
from ..colors import Category, categorical
from ..step_parts import main_button, missing, reached, registration


def _state(scene: bpy.types.Scene) -> StepState:
    return reached(
        scene.bim_verify_change.summary,
        "Optional: what is new, gone, or as before, against the model or a reference epoch",
        missing(scene),
    )


def _draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    settings, scans = context.scene.bim_verify_change, context.scene.bim_verify.scans
    row = layout.row()
    row.label(text="Reference:" if settings.references else "Reference: the model")
    row.operator("bim_verify.add_reference", text="", icon="ADD")
    for index, scan in enumerate(settings.references):
        row = layout.row()
        row.label(text=scan.name, icon="FILE")
        row.operator("bim_verify.remove_reference", text="", icon="REMOVE").index = index
    if len(scans) > 1:
        layout.prop(settings, "grouping")
        if settings.grouping == "NUMBERED":
            column = layout.column(align=True)
            for scan in scans:
                if scan.use and not scan.dense:
                    column.prop(scan, "epoch", text=scan.name)
    layout.prop(settings, "date", text="Day")
    main_button(layout, "change", "MOD_BUILD")
    if settings.epochs > 1:
        layout.prop(settings, "epoch", slider=True, text=f"Shown: {settings.epoch_name or 'epoch'}")
    if settings.summary:
        layout.operator("bim_verify.export_change", icon="EXPORT")


def _expert(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    settings = context.scene.bim_verify_change
    column = layout.column(align=True)
    column.prop(settings, "voxel_mm")
    column.prop(settings, "min_points")
    layout.prop(settings, "loa")
    registration(layout, settings)


def _numbers(item: bpy.types.Object) -> list[tuple[str, str]]:
    states = str(item.get(change_scene.STATES_KEY, "")).split()
    names = str(bpy.context.scene.get(change_scene.EPOCHS_KEY, "")).split("\n")
    lines = str(item.get(change_scene.NUMBERS_KEY, "")).splitlines()
    return [
        *((name or "Change", state.capitalize()) for name, state in zip(names, states, strict=False)),
        *((name, value) for name, _, value in (line.partition("\t") for line in lines)),
    ]


def _why(item: bpy.types.Object) -> str:
    return str(item.get(change_scene.REASON_KEY, ""))


def _brief(item: bpy.types.Object, vertex: int) -> list[str]:
    state = change_scene.state_now(item)
    return [f"Change: {state.lower()}"] if state else []


def show(scene: bpy.types.Scene, result: Any) -> bool:
    """Put a comparison into the scene; False if the result is none."""
    from ...core.change.results import ChangeResult

    if not isinstance(result, ChangeResult):
        return False
    settings, own = scene.bim_verify, scene.bim_verify_change
    settings.model_path, settings.align = str(Path(result.model.path).resolve()), result.options.align
    for number, epoch in enumerate(result.epochs, start=1):
        for path in epoch.paths:
            entry = settings.scans.add()
            entry.path, entry.name, entry.epoch = str(Path(path).resolve()), Path(path).name, number
    for path in result.reference.paths if result.reference else ():
        entry = own.references.add()
        entry.path, entry.name = str(Path(path).resolve()), Path(path).name
    own.grouping = "ONE" if len(result.epochs) == 1 else "NUMBERED"
    own.voxel_mm, own.min_points, own.date = 1000 * result.edge, result.options.min_points, result.options.date
    own.loa = "NONE" if result.options.loa is None else str(result.options.loa)
    own.take_sigma(result.options.registration_sigma)
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
    classes=(BimVerifyReferenceScan,),
    numbers=_numbers,
    brief=_brief,
    why=_why,
    forget=change_scene.forget,
    show=show,
)
