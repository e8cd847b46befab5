"""Every return of the scans to its element, written as a cloud."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import BoolProperty, StringProperty

from ...core.errors import BimVerifyError
from ...core.options import ClassifyOptions
from ...core.progress import Progress
from .. import inputs, project
from ..jobs import Work
from ..shared_settings import ClassifyChoices
from .file_browser import FileJob, has_model, has_scans, idle, named

SUFFIXES = (".e57", ".las", ".laz")


class BIMVERIFY_OT_classify(ClassifyChoices, FileJob["tuple[str, str]"], bpy.types.Operator):
    """Assign every return to the element that it met and write the cloud: E57 element by element, LAS/LAZ with codes."""

    bl_idname = "bim_verify.classify"
    bl_label = "Classify Scans"
    bl_description = "Assign every return to the element that it met and write the cloud, element by element"
    bl_options = {"REGISTER"}
    title = "Classify"
    panel_settings = ("bim_verify_classify", *ClassifyChoices.__annotations__)

    filepath: StringProperty(name="File", subtype="FILE_PATH", description="The E57, LAS or LAZ file to write")
    filter_glob: StringProperty(default="*.e57;*.las;*.laz", options={"HIDDEN"})
    check_existing: BoolProperty(default=True, options={"HIDDEN"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_model(cls, context) and has_scans(cls, context) and idle(cls)

    def proposed(self, context: bpy.types.Context) -> Path:
        first = Path(project.scan_paths(context.scene.bim_verify)[0])
        return first.with_name(f"{first.stem}_classified.e57")

    def prepare(self, context: bpy.types.Context) -> Work[tuple[str, str]]:
        from ...core import jobs
        from ...core.classification.write import write_classified

        settings = context.scene.bim_verify
        if not self.filepath:
            raise BimVerifyError("No file name was given. Choose where to write the cloud.")
        path, paths = named(self.filepath, *SUFFIXES), project.scan_paths(settings)
        inputs.refuse(path)
        common = project.options(settings)
        options = ClassifyOptions(
            loa=common.loa, sigma=common.sigma, as_built=self.as_built, scan_frame=common.scan_frame, origin=common.origin,
            threads=common.threads, memory_gb=common.memory_gb,
        )
        load, per_station = project.model_loader(context.scene), self.per_station and path.suffix.lower() == SUFFIXES[0]

        def work(progress: Progress) -> tuple[str, str]:
            found = jobs.classify(load(progress.part(0.0, 0.1)), paths, options, progress.part(0.1, 0.6))
            write_classified(path, found, options.memory_gb, progress.part(0.6, 1.0), per_station=per_station)
            return found.summary(), str(path)

        return work

    def finish(self, context: bpy.types.Context, value: tuple[str, str]) -> str:
        summary, path = value
        context.scene.bim_verify_classify.summary = summary
        return f"{summary} Written: {path}"
