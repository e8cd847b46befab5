"""The scans of the reference epoch: named here, read when changes are looked for."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import CollectionProperty, IntProperty, StringProperty

from .file_browser import chosen, has_model, idle
from .import_scan import SCAN_FILES


class BIMVERIFY_OT_add_reference(bpy.types.Operator):
    """Name scan files of the epoch that the scans are compared with."""

    bl_idname = "bim_verify.add_reference"
    bl_label = "Add Reference Scans"
    bl_description = "Name scan files of an earlier epoch that the scans are compared with; without any, the model is"
    bl_options = {"REGISTER", "UNDO"}

    filepath: StringProperty(name="File", subtype="FILE_PATH", description="Scan file")
    directory: StringProperty(subtype="DIR_PATH", options={"HIDDEN"})
    files: CollectionProperty(type=bpy.types.OperatorFileListElement, options={"HIDDEN"})
    filter_glob: StringProperty(default=SCAN_FILES, options={"HIDDEN"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_model(cls, context) and idle(cls)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event | None) -> set[str]:
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        paths = chosen(self)
        if not paths or not all(Path(path).is_file() for path in paths):
            self.report({"ERROR"}, "No scan file was given. Choose at least one.")
            return {"CANCELLED"}
        references = context.scene.bim_verify_change.references
        for path in paths:
            if path not in {entry.path for entry in references}:
                entry = references.add()
                entry.name, entry.path = Path(path).name, path
        return {"FINISHED"}


class BIMVERIFY_OT_remove_reference(bpy.types.Operator):
    """Take a scan out of the reference epoch; the file stays."""

    bl_idname = "bim_verify.remove_reference"
    bl_label = "Remove Reference Scan"
    bl_description = "Take this scan out of the reference epoch; the file on disk stays"
    bl_options = {"REGISTER", "UNDO"}

    index: IntProperty(name="Number", min=0, description="Place in the list, from 0")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not context.scene.bim_verify_change.references:
            cls.poll_message_set("Add a reference scan first")
            return False
        return idle(cls)

    def execute(self, context: bpy.types.Context) -> set[str]:
        references = context.scene.bim_verify_change.references
        if self.index >= len(references):
            self.report({"ERROR"}, f"The reference epoch has {len(references)} scans.")
            return {"CANCELLED"}
        references.remove(self.index)
        return {"FINISHED"}
