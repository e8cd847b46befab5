"""A photo of a facade to a mock-up model, and the same again after corrections by hand."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import bpy
from bpy.props import BoolProperty, FloatProperty, StringProperty

from ...core.errors import BimVerifyError
from ...core.files import whole_file
from ...core.progress import Progress
from .. import inputs, project, scene
from ..jobs import Work
from .file_browser import FileJob, idle, named

if TYPE_CHECKING:
    from ...core.facade.mockup import Mockup


@dataclass(frozen=True)
class Written:
    """The mock-up and its file."""

    path: Path
    made: Mockup


class BIMVERIFY_OT_facade(FileJob["Mockup"], bpy.types.Operator):
    """Read windows and doors from a photo of a facade."""

    bl_idname = "bim_verify.facade"
    bl_label = "Read Facade Photo"
    bl_description = "Find the windows and doors of a facade in a photo; correct them in the scene, then write the model"
    bl_options = {"REGISTER", "UNDO"}
    title = "Facade"
    panel_settings = ("bim_verify_facade", "corners", "width", "height", "floor_height")

    filepath: StringProperty(name="Photo", subtype="FILE_PATH", description="A photo of one facade")
    filter_glob: StringProperty(default="*.jpg;*.jpeg;*.png;*.tif;*.tiff", options={"HIDDEN"})
    corners: StringProperty(
        name="Corners", description="X,Y,X,Y,X,Y,X,Y of the facade in pixels of the photo; empty: found by vanishing lines"
    )
    width: FloatProperty(name="Width", unit="LENGTH", min=0.0, description="Of the facade, metres; zero: not known")
    height: FloatProperty(name="Height", unit="LENGTH", min=0.0, description="Of the facade, metres; zero: not known")
    floor_height: FloatProperty(
        name="Floor height", unit="LENGTH", min=0.0, description="Floor to floor, metres; zero: not known"
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return idle(cls)

    def prepare(self, context: bpy.types.Context) -> Work[Mockup]:
        from ...core.commands.facade import parse_corners
        from ...core.facade.mockup import mockup
        from ...core.jobs.facade import FacadeOptions, facade

        if not self.filepath:
            raise BimVerifyError("No photo was given. Choose one.")
        path = Path(bpy.path.abspath(self.filepath))
        options = FacadeOptions(
            corners=(parse_corners(self.corners),) if self.corners.strip() else (), width=self.width or None,
            height=self.height or None, floor_height=self.floor_height or None,
        )

        def work(progress: Progress) -> Mockup:
            return mockup(facade([path], options, progress))

        return work

    def finish(self, context: bpy.types.Context, value: Mockup) -> str:
        from ...core.facade.report import summary
        from ..facade_scene import show_mockup

        show_mockup(context.scene, value)
        scene.show_colors_in_views("TEXTURE")
        self.warn(warning for facade in value.facades for warning in facade.warnings)
        context.scene.bim_verify_facade.summary = summary(value)
        return summary(value)


class BIMVERIFY_OT_write_facade(FileJob[Written], bpy.types.Operator):
    """Write the mock-up that the rectangles make now."""

    bl_idname = "bim_verify.write_facade"
    bl_label = "Write Mock-up"
    bl_description = "Write the facade with its rectangles as they are now as an IFC4 model: moved, added and deleted ones too"
    bl_options = {"REGISTER"}
    title = "Mock-up"

    filepath: StringProperty(name="File", subtype="FILE_PATH", description="The IFC file to write")
    filter_glob: StringProperty(default="*.ifc", options={"HIDDEN"})
    check_existing: BoolProperty(default=True, options={"HIDDEN"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        from ..facade_scene import DATA_KEY

        if DATA_KEY not in context.scene:
            cls.poll_message_set("Read a facade photo first")
            return False
        return idle(cls)

    def proposed(self, context: bpy.types.Context) -> Path:
        return project.folder(context.scene) / "facade_mockup.ifc"

    def prepare(self, context: bpy.types.Context) -> Work[Written]:
        from ...core.facade.mockup import write_mockup
        from ..facade_scene import read_mockup

        if not self.filepath:
            raise BimVerifyError("No file name was given. Choose where to write the IFC file.")
        path = named(self.filepath, ".ifc")
        inputs.refuse(context.scene, path)
        made = read_mockup(context.scene)

        def work(progress: Progress) -> Written:
            with whole_file(path) as temporary:
                write_mockup(temporary, made, path.name)
                progress.check()
            return Written(path, made)

        return work

    def finish(self, context: bpy.types.Context, value: Written) -> str:
        from ...core.facade.report import summary

        context.scene.bim_verify_facade.summary = summary(value.made)
        return f"{summary(value.made)} Written: {value.path}"
