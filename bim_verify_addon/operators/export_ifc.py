"""Write the verified IFC."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy

from ...core.files import whole_file
from ...core.progress import Progress
from .. import bonsai, ifc_edits, project, verdicts
from ..shared_settings import IfcToWrite
from .file_browser import has_result, idle
from .result_file import ResultFile, Write

if TYPE_CHECKING:
    from ...core.results import VerificationResult


class BIMVERIFY_OT_export_ifc(IfcToWrite, ResultFile, bpy.types.Operator):
    """Write a copy of the IFC file with all that was found as property sets; the imported file is never changed.

    When Bonsai holds the project the property sets are in its file already: saving there keeps them too.
    """

    bl_idname = "bim_verify.export_ifc"
    bl_label = "Export IFC"
    bl_description = (
        "Write a copy of the IFC file with verdicts, changes and scan quality, as far as they were found, as property sets; "
        "the imported file is never changed"
    )
    bl_options = {"REGISTER"}
    title = "Export IFC"
    ending, suffixes = "_verified.ifc", (".ifc",)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return (bool(ifc_edits.kept(context.scene)) or has_result(cls, context)) and idle(cls)

    def writer(self, context: bpy.types.Context) -> Write:
        from ...core.model.write_psets import write_ifc_copy, write_verdicts

        live = bonsai.live_copy()
        if live is None:
            edits, source = ifc_edits.kept(context.scene), project.model_path(context.scene.bim_verify)
            back = verdicts.taken_back(context.scene)

            def write(result: VerificationResult | None, path: Path, progress: Progress) -> str:
                progress.update(0.0, "Writing the property sets")

                def add(file: Any) -> bool:
                    found = [write_verdicts(file, result, taken_back=back)] if result is not None else []
                    return any([*found, *(edit(file) for edit in edits)])

                write_ifc_copy(result.model.path if result is not None else source, path, add)
                return str(path)

            return write

        folder, copy = live

        def hand_over(result: VerificationResult, path: Path, progress: Progress) -> str:
            with folder, whole_file(path) as temporary:
                shutil.copyfile(copy, temporary)
            return str(path)

        return hand_over
