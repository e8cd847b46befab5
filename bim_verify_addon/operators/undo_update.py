"""The way back from an as-built model, as a file."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path

import bpy

from ...core.errors import BimVerifyError
from ...core.files import whole_file
from ...core.progress import Progress
from .. import bonsai, inputs, project
from ..jobs import Work
from ..shared_settings import IfcToWrite
from .file_browser import FileJob, has_model, idle, named


class BIMVERIFY_OT_undo_update(IfcToWrite, FileJob[str], bpy.types.Operator):
    """Write a copy of the model in which everything that an earlier update moved stands where it was planned."""

    bl_idname = "bim_verify.undo_update"
    bl_label = "Undo As-built IFC"
    bl_description = "Write a copy of the model in which everything that an update moved stands where it was before"
    bl_options = {"REGISTER"}
    title = "Undo as-built IFC"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_model(cls, context) and idle(cls)

    def proposed(self, context: bpy.types.Context) -> Path:
        source = Path(project.model_path(context.scene.bim_verify) or project.folder(context.scene) / "model.ifc")
        return source.with_name(f"{source.stem}_undone.ifc")

    def prepare(self, context: bpy.types.Context) -> Work[str]:
        from ...core.model.load import open_ifc
        from ...core.model.write_psets import write_open_file
        from ...core.update.update import undo_file, update_lines

        if not self.filepath:
            raise BimVerifyError("No file name was given. Choose where to write the IFC file.")
        path, source = named(self.filepath, ".ifc"), project.model_path(context.scene.bim_verify)
        inputs.refuse(path)
        folder, copy = bonsai.live_copy() or (nullcontext(), None)

        def work(progress: Progress) -> str:
            with folder:
                file = open_ifc(copy or source)
            (said,) = update_lines(undo_file(file), undo=True)
            with whole_file(path) as temporary:
                write_open_file(file, temporary, path)
                progress.check()
            return f"{said} Written: {path}"

        return work

    def finish(self, context: bpy.types.Context, value: str) -> str:
        context.scene.bim_verify_update.summary = value
        return value
