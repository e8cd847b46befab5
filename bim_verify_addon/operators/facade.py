"""A photo of a facade to a mock-up model, and the same again after corrections by hand."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import bpy
from bpy.props import CollectionProperty, StringProperty

from ...core.errors import BimVerifyError
from ...core.files import all_or_none
from ...core.progress import Progress
from .. import inputs, project, scene
from ..jobs import Work
from ..shared_settings import FacadeInputs, IfcToWrite, ReportBeside
from .file_browser import FileJob, chosen, idle, named

if TYPE_CHECKING:
    from ...core.facade.mockup import Mockup


@dataclass(frozen=True)
class Read:
    """What photos gave, and what a person should know of their footprint."""

    made: Mockup
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Written:
    """The mock-up and its file."""

    path: Path
    made: Mockup


class BIMVERIFY_OT_facade(FacadeInputs, FileJob[Read], bpy.types.Operator):
    """Read windows and doors from photos of facades."""

    bl_idname = "bim_verify.facade"
    bl_label = "Read Facade Photo"
    bl_description = "Find windows and doors in a photo, or in several on a footprint; correct them in the scene"
    bl_options = {"REGISTER", "UNDO"}
    title = "Facade"
    panel_settings = ("bim_verify_facade", *FacadeInputs.__annotations__)

    filepath: StringProperty(name="Photo", subtype="FILE_PATH", description="A photo of one facade")
    directory: StringProperty(subtype="DIR_PATH", options={"HIDDEN"})
    files: CollectionProperty(type=bpy.types.OperatorFileListElement, options={"HIDDEN"})
    filter_glob: StringProperty(default="*.jpg;*.jpeg;*.png;*.tif;*.tiff", options={"HIDDEN"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return idle(cls)

    def prepare(self, context: bpy.types.Context) -> Work[Read]:
        from ...core.commands.facade import parse_corners
        from ...core.jobs.facade import FacadeOptions, facade_mockup

        paths = chosen(self)
        if not paths:
            raise BimVerifyError("No photo was given. Choose one.")
        common = context.scene.bim_verify
        options = FacadeOptions(
            corners=tuple(parse_corners(text) for text in self.corners.split(";") if text.strip()), width=self.width or None,
            height=self.height or None, floor_height=self.floor_height or None, threads=common.threads,
            memory_gb=common.memory_gb,
        )
        outline, crs = self.footprint.strip(), self.crs.strip()
        if outline.lower().endswith("json"):
            outline = bpy.path.abspath(outline)

        def work(progress: Progress) -> Read:
            return Read(*facade_mockup(paths, options, outline, crs, progress))

        return work

    def finish(self, context: bpy.types.Context, value: Read) -> str:
        from ...core.facade.report import summary
        from ..facade_scene import show_mockup

        show_mockup(context.scene, value.made)
        scene.show_colors_in_views("TEXTURE")
        self.warn([*(warning for facade in value.made.facades for warning in facade.warnings), *value.notes])
        context.scene.bim_verify_facade.summary = summary(value.made)
        return summary(value.made)


class BIMVERIFY_OT_write_facade(IfcToWrite, ReportBeside, FileJob[Written], bpy.types.Operator):
    """Write the mock-up that the rectangles make now."""

    bl_idname = "bim_verify.write_facade"
    bl_label = "Write Mock-up"
    bl_description = "Write the facade with its rectangles as they are now as an IFC4 model: moved, added and deleted ones too"
    bl_options = {"REGISTER"}
    title = "Mock-up"
    panel_settings = ("bim_verify_facade", "with_report")

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
        from ...core.facade.correct import with_pictures
        from ...core.facade.mockup import write_mockup
        from ...core.facade.report import write_facade_report
        from ...core.report.page_frame import PAGE
        from ..facade_scene import read_mockup, read_pictures

        if not self.filepath:
            raise BimVerifyError("No file name was given. Choose where to write the IFC file.")
        path = named(self.filepath, ".ifc")
        report = self.report_folder(path)
        made = read_mockup(context.scene)
        inputs.refuse(path, *([report / PAGE] if report else []), beside=[f.image for f in made.facades])
        pictures = read_pictures(context.scene) if report else []

        def work(progress: Progress) -> Written:
            with all_or_none():
                write_mockup(path, made)
                if report is not None:
                    write_facade_report(report, with_pictures(made, pictures))
                progress.check()
            return Written(path, made)

        return work

    def finish(self, context: bpy.types.Context, value: Written) -> str:
        from ...core.facade.report import summary

        context.scene.bim_verify_facade.summary = summary(value.made)
        return f"{summary(value.made)} Written: {value.path}"
