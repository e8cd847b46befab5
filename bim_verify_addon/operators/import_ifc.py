"""Bring an IFC model in."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy
import numpy as np
from bpy.props import StringProperty
from numpy.typing import NDArray

from ...core.errors import BimVerifyError
from ...core.progress import Progress
from .. import bonsai, paint, project, scene
from ..capabilities import CAPABILITIES
from ..jobs import Work
from ..session import SESSION
from ..sight import look_at_all
from .file_browser import FileJob, idle

if TYPE_CHECKING:
    from ...core.model.elements import BuildingModel


class BIMVERIFY_OT_import_ifc(FileJob["tuple[BuildingModel, NDArray[np.float64]]"], bpy.types.Operator):
    """Import an IFC model: one object an element, one collection a storey, in metres.

    When Bonsai holds a project, that is taken instead and no second set of objects is made.
    """

    bl_idname = "bim_verify.import_ifc"
    bl_label = "Import IFC"
    bl_description = "Bring an IFC model in: one object an element, a collection a storey, in metres"
    bl_options = {"REGISTER", "UNDO"}
    title = "Import IFC"

    filepath: StringProperty(name="File", subtype="FILE_PATH", description="IFC file (IFC2X3, IFC4 or IFC4X3)")
    filter_glob: StringProperty(default="*.ifc", options={"HIDDEN"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return idle(cls)

    def needs_no_file(self, context: bpy.types.Context) -> bool:
        return bonsai.live_file() is not None

    def prepare(self, context: bpy.types.Context) -> Work[tuple[BuildingModel, NDArray[np.float64]]]:
        settings = context.scene.bim_verify
        if bonsai.live_file() is None and not self.filepath:
            raise BimVerifyError("No IFC file was given. Choose one.")
        load = project.model_loader(context.scene, self.filepath)
        options, scans = project.options(settings), project.scan_paths(settings)

        def work(progress: Progress) -> tuple[BuildingModel, NDArray[np.float64]]:
            model = load(progress)
            return model, project.placement(model, scans, options)

        return work

    def finish(self, context: bpy.types.Context, value: tuple[BuildingModel, NDArray[np.float64]]) -> str:
        return adopt_model(context, *value)


def adopt_model(context: bpy.types.Context, model: BuildingModel, placement: NDArray[np.float64]) -> str:
    """Take ``model`` as the scene's and show it, with the scans where ``placement`` (4, 4) puts them; one sentence."""
    settings = context.scene.bim_verify
    SESSION.models[context.scene.session_uid] = model
    if settings.edited_model != model.content_hash:
        settings.edits.clear()
        settings.edited_model = model.content_hash
    settings.model_path = model.path
    project.adopt_frame(context.scene, model)
    if bonsai.live_file() is None:
        first = not scene.element_objects(context.scene) and not scene.scan_objects(context.scene)
        scene.show_model(context.scene, model)
        if first:
            context.view_layer.update()
            look_at_all(context, scene.element_objects(context.scene).values())
        if settings.verified_model != model.content_hash:
            for capability in CAPABILITIES:
                if capability.forget is not None:
                    capability.forget(context.scene)
        paint.refresh(context.scene)
    scene.move_scans(context.scene, placement)
    settings.alignment_summary = ""
    settings.model_summary = project.in_words(model)
    skipped = f" {len(model.skipped)} products have no usable body." if model.skipped else ""
    return f"{settings.model_summary}.{skipped}"
