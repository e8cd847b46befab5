"""The results out of Blender."""

from __future__ import annotations

import bpy

from .. import bonsai
from ..capability import Capability, Step, StepState
from ..session import SESSION


def _state(scene: bpy.types.Scene) -> StepState:
    settings = scene.bim_verify
    if settings.exported_path:
        return StepState(True, f"Written: {settings.exported_path}")
    if scene.name in SESSION.results:
        in_bonsai = bonsai.live_file() is not None
        return StepState(in_bonsai, "In Bonsai's project: save it there" if in_bonsai else "Ready")
    return StepState(False, "Verify again in this session" if settings.counts else "Needs a result")


def _draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    layout.operator("bim_verify.export_ifc", icon="EXPORT")


CAPABILITY = Capability("export", Step("export", "Export", _state, _draw))
