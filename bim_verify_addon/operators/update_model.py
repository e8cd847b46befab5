"""The model with displaced elements at their as-built place, as a file."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

import bpy

from ...core.progress import Progress
from .. import bonsai, verdicts
from ..shared_settings import IfcToWrite
from .result_file import ResultFile, Write

if TYPE_CHECKING:
    from typing import Any

    from ...core.results import VerificationResult


class BIMVERIFY_OT_update_model(IfcToWrite, ResultFile, bpy.types.Operator):
    """Write a copy of the IFC file in which displaced elements stand where they were found; nothing else is changed.

    Decisions count before verdicts. Openings, fillings and parts follow. The copy can be put back (bim-verify update --undo).
    """

    bl_idname = "bim_verify.update_model"
    bl_label = "Export As-built IFC"
    bl_description = "Write a copy of the IFC file in which displaced elements stand where they were found"
    bl_options = {"REGISTER"}
    title = "Export as-built IFC"
    ending, suffixes = "_updated.ifc", (".ifc",)

    def finish(self, context: bpy.types.Context, value: str) -> str:
        context.scene.bim_verify_update.summary = f"Written: {value}"
        return super().finish(context, value)

    def writer(self, context: bpy.types.Context) -> Write:
        from ...core.model.write_psets import write_ifc_copy, write_verdicts
        from ...core.update.update import update_file, update_lines

        folder, copy = bonsai.live_copy() or (nullcontext(), None)
        back = verdicts.taken_back(context.scene)

        def write(result: VerificationResult, path: Path, progress: Progress) -> str:
            said: list[str] = []

            def change(file: Any) -> bool:
                write_verdicts(file, result, taken_back=back, progress=progress)
                said.extend(update_lines(update_file(file)))
                return True

            with folder:
                write_ifc_copy(copy or result.model.path, path, change)
            return f"{path}. {said[0]}"

        return write
