"""Bring an IFC model in."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy
from bpy.props import StringProperty

from ...core.errors import BimVerifyError
from ...core.progress import Progress
from .. import bonsai, project, scene
from ..jobs import Job, Work
from ..session import SESSION
from .file_browser import ask_or_start, idle, restart_when_closed

if TYPE_CHECKING:
    from ...core.model.elements import BuildingModel


class BIMVERIFY_OT_import_ifc(Job["BuildingModel"], bpy.types.Operator):
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

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if bonsai.live_file() is not None:
            return Job.invoke(self, context, event)
        return ask_or_start(self, context, event, lambda c, e: Job.invoke(self, c, e))

    def execute(self, context: bpy.types.Context) -> set[str]:
        return {"CANCELLED"} if restart_when_closed(self) else Job.execute(self, context)

    def prepare(self, context: bpy.types.Context) -> Work[BuildingModel]:
        from ...core.model.load import load_model

        if bonsai.live_file() is not None:
            return project.model_loader(context.scene)
        if not self.filepath:
            raise BimVerifyError("No IFC file was given. Choose one.")
        path, threads = bpy.path.abspath(self.filepath), context.scene.bim_verify.threads

        def work(progress: Progress) -> BuildingModel:
            return load_model(path, threads=threads, progress=progress)

        return work

    def finish(self, context: bpy.types.Context, value: BuildingModel) -> str:
        settings = context.scene.bim_verify
        SESSION.models[context.scene.name] = value
        settings.model_path = value.path
        project.adopt_frame(context.scene, value)
        if bonsai.live_file() is None:
            scene.show_model(context.scene, value)
        storeys = len({element.storey for element in value.elements})
        settings.model_summary = (
            f"{len(value.elements)} elements in {storeys} storey{'s' if storeys != 1 else ''}, {value.schema}"
        )
        skipped = f" {len(value.skipped)} products have no usable body." if value.skipped else ""
        return f"{settings.model_summary}.{skipped}"
