"""The model against another IFC file."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import bpy
from bpy.props import StringProperty

from ...core.errors import BimVerifyError
from ...core.files import all_or_none
from ...core.progress import Progress
from .. import bonsai, paint, project
from ..jobs import Work
from ..shared_settings import ReportBeside
from .file_browser import FileJob, has_model, idle

if TYPE_CHECKING:
    from ...core.reconstruction.compare import Comparison


@dataclass(frozen=True)
class Compared:
    """What was found, and where the report is, if one was asked for."""

    comparison: Comparison
    report: Path | None


class BIMVERIFY_OT_compare(ReportBeside, FileJob[Compared], bpy.types.Operator):
    """Compare the model with another IFC file: what is in both, and the differences of places and sizes."""

    bl_idname = "bim_verify.compare"
    bl_label = "Compare with IFC"
    bl_description = "Compare the model with another IFC file: what is in both, and differences of places and sizes"
    bl_options = {"REGISTER", "UNDO"}
    title = "Compare"
    panel_settings = ("bim_verify_compare", "with_report")

    filepath: StringProperty(name="File", subtype="FILE_PATH", description="The IFC file that the model is compared with")
    filter_glob: StringProperty(default="*.ifc", options={"HIDDEN"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_model(cls, context) and idle(cls)

    def prepare(self, context: bpy.types.Context) -> Work[Compared]:
        from ...core.reconstruction.compare import compare
        from ...core.reconstruction.compare_report import write_comparison_report
        from ...core.reconstruction.shapes import read_shapes

        if not self.filepath:
            raise BimVerifyError("No file name was given. Choose the IFC file to compare the model with.")
        reference = Path(bpy.path.abspath(self.filepath))
        own = Path(project.model_path(context.scene.bim_verify) or "unsaved.ifc")
        folder, copy = bonsai.live_copy() or (nullcontext(), None)
        report = project.folder(context.scene) / f"{own.stem}_comparison" if self.with_report else None

        def work(progress: Progress) -> Compared:
            progress.update(0.0, "Reading the model")
            with folder:
                found = read_shapes(copy or own)
            progress.update(0.5, "Reading the reference")
            comparison = compare(found, read_shapes(reference))
            with all_or_none():
                if report is not None:
                    write_comparison_report(report, comparison, str(own), str(reference))
                progress.check()
            return Compared(comparison, report)

        return work

    def finish(self, context: bpy.types.Context, value: Compared) -> str:
        from ...core.reconstruction.compare import comparison_lines
        from ..capabilities.compare import mark

        mark(context.scene, value.comparison)
        paint.refresh(context.scene)
        *lines, quality = comparison_lines(value.comparison)
        context.scene.bim_verify_compare.summary = "\n".join([quality, *lines])
        return f"{quality} Report: {value.report}" if value.report else quality
