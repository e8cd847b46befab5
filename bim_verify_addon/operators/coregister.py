"""Photos onto the model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty

from ...core.errors import BimVerifyError
from ...core.progress import Progress
from .. import project
from ..jobs import Work
from ..session import SESSION
from ..shared_settings import LOA_ITEMS
from .file_browser import FileJob, has_model, idle

if TYPE_CHECKING:
    from ...core.imagery.coregistration import CoregistrationResult


class BIMVERIFY_OT_coregister(FileJob["CoregistrationResult"], bpy.types.Operator):
    """Place photos on the model by straight lines that lie on its edges."""

    bl_idname = "bim_verify.coregister"
    bl_label = "Place Photos"
    bl_description = "Place the images of a cameras file on the model by lines that lie on its edges"
    bl_options = {"REGISTER", "UNDO"}
    title = "Photos"

    filepath: StringProperty(
        name="Cameras", subtype="FILE_PATH", description="cameras.json or Metashape XML, with its images beside it"
    )
    filter_glob: StringProperty(default="*.json;*.xml", options={"HIDDEN"})
    loa: EnumProperty(name="Level", items=LOA_ITEMS, default="30", description="Level of accuracy of the model's edges")
    focal: BoolProperty(name="Focal length", description="Estimate the focal length too")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_model(cls, context) and idle(cls)

    def prepare(self, context: bpy.types.Context) -> Work[CoregistrationResult]:
        from ...core.imagery.cameras_file import read_cameras
        from ...core.imagery.coregistration import CoregisterOptions
        from ...core.imagery.image_names import image_beside
        from ...core.jobs.coregister import coregister

        if not self.filepath:
            raise BimVerifyError("No cameras file was given. Choose one; its images must lie beside it.")
        source = Path(bpy.path.abspath(self.filepath))
        cameras = read_cameras(source)
        beside = [image_beside(source.parent, known.camera.name) for known in cameras.cameras]
        images = [path for path in beside if path is not None]
        if not images:
            raise BimVerifyError(f"None of the images that {source.name} names lies beside it; put them into its folder.")
        options = CoregisterOptions(loa=int(self.loa), focal=self.focal, threads=context.scene.bim_verify.threads)
        load = project.model_loader(context.scene)

        def work(progress: Progress) -> CoregistrationResult:
            return coregister(load(progress.part(0.0, 0.2)), images, cameras, options, progress.part(0.2, 1.0))

        return work

    def finish(self, context: bpy.types.Context, value: CoregistrationResult) -> str:
        from ..photo_scene import CAMERAS_KEY, RESULT_KEY, show_photos

        project.adopt_frame(context.scene, value.model)
        message = show_photos(context.scene, value)
        context.scene[RESULT_KEY] = SESSION.photos.keep(value)
        context.scene[CAMERAS_KEY] = bpy.path.abspath(self.filepath)
        context.view_layer.objects.active = context.scene.camera  # the panel says how well it is placed
        self.warn(value.warnings)
        return message
