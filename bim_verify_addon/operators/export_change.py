"""Write what a comparison found: everything that the command ``change`` writes, into one folder."""

from __future__ import annotations

import shutil
from pathlib import Path

import bpy
from bpy.props import BoolProperty, StringProperty

from ...core.errors import BimVerifyError
from ...core.files import all_or_none, make_folder, whole_file
from ...core.progress import Progress
from .. import bonsai, inputs
from ..jobs import Work
from ..session import SESSION
from .file_browser import FileJob, idle

MODEL, VOXELS, JSON, REPORT, REMAINING = "changed.ifc", "voxels.ply", "change.json", "report", "remaining"


class BIMVERIFY_OT_export_change(FileJob[str], bpy.types.Operator):
    """Write a folder with the model, the report, the voxels, the remaining shapes and the numbers of a comparison."""

    bl_idname = "bim_verify.export_change"
    bl_label = "Export Changes"
    bl_description = (
        f"Write a folder: the model with property sets ({MODEL}), a report, voxels (PLY), what remains of partly demolished "
        "elements (OBJ) and all numbers (JSON)"
    )
    bl_options = {"REGISTER"}
    title = "Export Changes"

    filepath: StringProperty(name="Folder", subtype="FILE_PATH", description="The folder to write; made if it is missing")
    filter_folder: BoolProperty(default=True, options={"HIDDEN"})
    model: BoolProperty(name="Model", default=True, description="A copy of the IFC file with a property set on every element")
    page: BoolProperty(name="Report", default=True, description="One HTML page, and a table of the elements as CSV")
    voxels: BoolProperty(name="Voxels", default=True, description="All voxels with their state, as PLY")
    remaining: BoolProperty(
        name="Remaining shapes", default=True, description="What remains of partly demolished elements, an OBJ each"
    )
    numbers: BoolProperty(name="Numbers", default=True, description="Everything but the voxels, as JSON")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.scene.bim_verify_change.result_key in SESSION.comparisons:
            return idle(cls)
        known = context.scene.bim_verify_change.summary
        cls.poll_message_set("Find changes again: they are not in memory" if known else "Find changes first")
        return False

    def proposed(self, context: bpy.types.Context) -> Path:
        source = Path(SESSION.comparisons[context.scene.bim_verify_change.result_key].model.path)
        return source.with_name(f"{source.stem}_change")

    def prepare(self, context: bpy.types.Context) -> Work[str]:
        from ...core.change.psets import write_changed_ifc
        from ...core.report.change_files import change_to_json, write_voxels
        from ...core.report.change_page import write_change_report
        from ...core.report.json_out import write_document
        from ...core.report.remaining import write_remaining

        if not self.filepath:
            raise BimVerifyError("No folder was given. Choose where to write.")
        folder = Path(bpy.path.abspath(self.filepath))
        result = SESSION.comparisons[context.scene.bim_verify_change.result_key]
        if folder.is_file():
            raise BimVerifyError(f"{folder} is a file. Give a folder.")
        inputs.refuse(context.scene, *(folder / name for name in (MODEL, VOXELS, JSON)), beside=[result.model.path])
        live = bonsai.live_copy() if self.model else None
        model, page, voxels, remaining, numbers = self.model, self.page, self.voxels, self.remaining, self.numbers

        def work(progress: Progress) -> str:
            with all_or_none():
                make_folder(folder)
                if model and live is not None:
                    with live[0], whole_file(folder / MODEL) as temporary:
                        shutil.copyfile(live[1], temporary)
                elif model:
                    write_changed_ifc(result.model.path, result, folder / MODEL, progress=progress.part(0.0, 0.3))
                progress.update(0.3, "Writing the changes")
                if voxels:
                    write_voxels(folder / VOXELS, result)
                if remaining:
                    write_remaining(folder / REMAINING, result)
                if numbers:
                    write_document(folder / JSON, change_to_json(result))
                if page:
                    write_change_report(folder / REPORT, result, progress=progress.part(0.6, 1.0))
                progress.check()
            return str(folder)

        return work

    def finish(self, context: bpy.types.Context, value: str) -> str:
        return f"Written: {value}"
