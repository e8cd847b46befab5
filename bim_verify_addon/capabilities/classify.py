"""The scans, element by element: the step."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
from bpy.props import StringProperty

from .. import project
from .. import scene as scenery
from ..capability import Capability, Step, StepState
from ..shared_settings import ClassifyChoices
from ..step_parts import main_button, missing, reached


class BimVerifyClassifySettings(ClassifyChoices, bpy.types.PropertyGroup):
    """Of one scene."""

    summary: StringProperty()


def _state(scene: bpy.types.Scene) -> StepState:
    return reached(
        scene.bim_verify_classify.summary, "Optional: the scans split by element, for other programs", missing(scene)
    )


def _draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    layout.prop(context.scene.bim_verify_classify, "as_built")
    main_button(layout, "classify", "OUTLINER_OB_POINTCLOUD")


def _expert(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    layout.prop(context.scene.bim_verify_classify, "per_station")


def _forget(scene: bpy.types.Scene) -> None:
    scene.bim_verify_classify.summary = ""


def show(scene: bpy.types.Scene, result: Any) -> bool:
    """Fill an empty scene with the model whose returns were assigned; False if the result is no classification."""
    from ...core.classification.results import Classification

    if not isinstance(result, Classification):
        return False
    for path in result.source.paths:
        entry = scene.bim_verify.scans.add()
        entry.path, entry.name = str(Path(path).resolve()), Path(path).name
    project.adopt_frame(scene, result.model)
    scenery.show_model(scene, result.model)
    scene.bim_verify_classify.summary = result.summary()
    return True


CAPABILITY = Capability(
    "classify", Step("classify", "Classify", _state, _draw, _expert, optional=True), settings=BimVerifyClassifySettings,
    forget=_forget, show=show,
)
