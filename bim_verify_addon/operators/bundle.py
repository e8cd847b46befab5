"""A bundle of photos adjusted."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty

from ...core.errors import BimVerifyError
from ...core.progress import Progress
from .. import inputs, project
from ..jobs import Work
from ..shared_settings import LOA_ITEMS
from .file_browser import FileJob, idle, named

if TYPE_CHECKING:
    from ...core.jobs.bundle import AdjustedBundle


@dataclass(frozen=True)
class Adjusted:
    """An adjusted project, the file it was written to, and where its images lie by camera."""

    found: AdjustedBundle
    path: Path
    images: list[Path | None]


class BIMVERIFY_OT_bundle(FileJob[Adjusted], bpy.types.Operator):
    """Adjust cameras and tie points of a project of photos."""

    bl_idname = "bim_verify.bundle"
    bl_label = "Adjust Bundle"
    bl_description = "Adjust cameras and tie points of a project of photos, write the adjusted project, and show it"
    bl_options = {"REGISTER", "UNDO"}
    title = "Bundle"

    filepath: StringProperty(
        name="Project", subtype="FILE_PATH", description="Project (JSON, which may import a COLMAP folder) or Bundler file"
    )
    filter_glob: StringProperty(default="*.json;*.out", options={"HIDDEN"})
    adjusted: StringProperty(
        name="Write to", subtype="FILE_PATH",
        description="The adjusted project to write; empty: beside the project, with _adjusted in its name",
    )
    on_model: BoolProperty(
        name="Tie to the model", description="Look for the model's edges in the images that lie beside the project"
    )
    loa: EnumProperty(name="Level", items=LOA_ITEMS, default="30", description="Level of accuracy of the model's edges")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return idle(cls)

    def prepare(self, context: bpy.types.Context) -> Work[Adjusted]:
        from ...core.commands.checks import check_outputs
        from ...core.files import all_or_none
        from ...core.imagery.bundle_project import adjusted_project, imported_files, read_project
        from ...core.imagery.image_names import image_beside
        from ...core.jobs.bundle import ModelEdges, bundle
        from ...core.report.json_out import write_document

        if not self.filepath:
            raise BimVerifyError("No project was given. Choose one.")
        source = Path(bpy.path.abspath(self.filepath))
        target = named(self.adjusted, ".json") if self.adjusted else source.with_name(f"{source.stem}_adjusted.json")
        inputs.refuse(target, beside=[str(source)])
        settings, on_model, loa = context.scene.bim_verify, self.on_model, int(self.loa)
        if on_model and not project.has_model(settings):
            raise BimVerifyError("There is no model to tie the photos to. Import one first, or leave Tie to the model off.")
        load = project.model_loader(context.scene) if on_model else None
        threads, memory_gb = settings.threads, settings.memory_gb

        def work(progress: Progress) -> Adjusted:
            check_outputs([str(source), *imported_files(source)], [str(target)])
            problem = read_project(source)
            images = [image_beside(source.parent, camera.name) for camera in problem.cameras]
            edges = None
            if load is not None:
                beside = [path for path in images if path is not None]
                if not beside:
                    raise BimVerifyError(f"None of the images of {source.name} lies beside it; put them into its folder.")
                edges = ModelEdges(model=load(progress.part(0.0, 0.2)), images=beside, loa=loa)
            found = bundle(problem, threads=threads, memory_gb=memory_gb, edges=edges, progress=progress.part(0.2, 1.0))
            with all_or_none():
                write_document(target, adjusted_project(found.problem, found.result, found.method, found.left_out))
            return Adjusted(found, target, images)

        return work

    def finish(self, context: bpy.types.Context, value: Adjusted) -> str:
        from ..bundle_scene import show_bundle

        message = show_bundle(context.scene, value.found, value.images)
        if len(value.found.left_out):
            self.warn([f"{len(value.found.left_out)} points that fewer than two images show were left out"])
        return f"{message} Written: {value.path}"
