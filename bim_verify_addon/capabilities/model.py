"""The model to verify."""

from __future__ import annotations

import bpy

from .. import bonsai
from ..capability import Capability, Step, StepState
from ..step_parts import main_button


def _state(scene: bpy.types.Scene) -> StepState:
    settings = scene.bim_verify
    if bonsai.live_file() is not None:
        return StepState(True, settings.model_summary or "Bonsai's project")
    if settings.model_path:
        return StepState(True, settings.model_summary)
    return StepState(False, "No model yet")


def _draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    main_button(layout, "import_ifc", "HOME")


CAPABILITY = Capability("model", Step("model", "Model", _state, _draw))
