"""Write the verified IFC."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import BoolProperty, StringProperty

from ...core.errors import BimVerifyError
from ...core.files import whole_file
from .. import bonsai, project
from .file_browser import has_result, idle


class BIMVERIFY_OT_export_ifc(bpy.types.Operator):
    """Write a copy of the IFC file with the verdicts as property sets; the imported file is never changed.

    When Bonsai holds the project the property sets are in its file already: saving there keeps them too.
    """

    bl_idname = "bim_verify.export_ifc"
    bl_label = "Export IFC"
    bl_description = "Write a copy of the IFC file with the verdicts as property sets; the imported file is never changed"
    bl_options = {"REGISTER"}

    filepath: StringProperty(name="File", subtype="FILE_PATH", description="The IFC file to write")
    filter_glob: StringProperty(default="*.ifc", options={"HIDDEN"})
    check_existing: BoolProperty(default=True, options={"HIDDEN"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_result(cls, context) and idle(cls)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if not self.filepath:
            source = Path(project.result(context.scene).model.path)
            self.filepath = str(source.with_name(f"{source.stem}_verified.ifc"))
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        from ...core.model.write_psets import write_verified_ifc

        result = project.result(context.scene)
        out = Path(bpy.path.abspath(self.filepath)).with_suffix(".ifc")
        try:
            if not self.filepath:
                raise BimVerifyError("No file name was given. Choose where to write the IFC file.")
            live = bonsai.live_file()
            if live is not None:
                with whole_file(out) as temporary:
                    live.write(str(temporary))
            else:
                write_verified_ifc(result.model.path, result, out)
        except BimVerifyError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        context.scene.bim_verify.exported_path = str(out)
        self.report({"INFO"}, f"Written: {out}")
        return {"FINISHED"}
