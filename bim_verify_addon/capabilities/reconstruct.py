"""A building model from the scans: the step, and the scene that shows it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
from bpy.props import StringProperty

from .. import project
from .. import scene as scenery
from ..capability import Capability, Step, StepState
from ..shared_settings import KnownRegistration, ReconstructOutputs
from ..step_parts import main_button, missing, reached, registration


class BimVerifyReconstructSettings(KnownRegistration, ReconstructOutputs, bpy.types.PropertyGroup):
    """Of one scene."""

    summary: StringProperty()


def _state(scene: bpy.types.Scene) -> StepState:
    return reached(
        scene.bim_verify_reconstruct.summary,
        "Optional: a model from scans of the building's inside",
        missing(scene, model=False),
    )


def _draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    settings = context.scene.bim_verify_reconstruct
    row = layout.row()
    for name in ("with_report", "with_dimensions"):
        row.prop(settings, name)
    main_button(layout, "reconstruct", "MOD_SOLIDIFY")


def _expert(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    settings = context.scene.bim_verify_reconstruct
    layout.prop(settings, "reference")
    registration(layout, settings)


def _forget(scene: bpy.types.Scene) -> None:
    scene.bim_verify_reconstruct.summary = ""


def show(scene: bpy.types.Scene, result: Any) -> bool:
    """Fill an empty scene with what was reconstructed; False if the result is none."""
    from ...core.reconstruction.building import Reconstruction

    if not isinstance(result, Reconstruction):
        return False
    from ...core.reconstruction.summary import summary_lines
    from ...core.reconstruction.write_ifc import building_file

    model = project.model_of(building_file(result))
    for scan in result.scan_paths:
        entry = scene.bim_verify.scans.add()
        entry.path, entry.name = str(Path(scan).resolve()), Path(scan).name
    project.adopt_frame(scene, model)
    scenery.show_model(scene, model)
    scene.bim_verify_reconstruct.summary = summary_lines(result)[0]
    return True


CAPABILITY = Capability(
    "reconstruct",
    Step("reconstruct", "Reconstruct", _state, _draw, _expert, optional=True),
    settings=BimVerifyReconstructSettings,
    forget=_forget,
    show=show,
)
