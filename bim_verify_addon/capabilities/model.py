"""The model to verify."""

from __future__ import annotations

import bpy

from .. import bonsai
from ..capability import Capability, Step, StepState


def _state(scene: bpy.types.Scene) -> StepState:
    settings = scene.bim_verify
    if bonsai.live_file() is not None:
        return StepState(True, settings.model_summary or "Bonsai's project")
    if settings.model_path:
        return StepState(True, settings.model_summary)
    return StepState(False, "No model yet")


def _draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    layout.operator("bim_verify.import_ifc", icon="HOME")


CAPABILITY = Capability("model", Step("model", "Model", _state, _draw))
