"""Write what was found on a panelled wall: its joints as a table, and a report."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import BoolProperty, StringProperty

from ...core.errors import BimVerifyError
from ...core.files import all_or_none
from ...core.progress import Progress
from .. import inputs, project, wall_scene
from ..jobs import Work
from ..session import SESSION
from ..shared_settings import ReportBeside
from .file_browser import FileJob, idle, named


class BIMVERIFY_OT_export_displacement(ReportBeside, FileJob[str], bpy.types.Operator):
    """Write the joints of a wall's displacement as CSV, and a report with its profiles."""

    bl_idname = "bim_verify.export_displacement"
    bl_label = "Export Displacement"
    bl_description = "Write a table with one line a joint (CSV), and a report with the wall's elevation and profiles"
    bl_options = {"REGISTER"}
    title = "Export Displacement"
    panel_settings = ("bim_verify_displacement", "with_report")

    filepath: StringProperty(name="File", subtype="FILE_PATH", description="The CSV file to write")
    filter_glob: StringProperty(default="*.csv", options={"HIDDEN"})
    check_existing: BoolProperty(default=True, options={"HIDDEN"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.scene.get(wall_scene.RESULT_KEY) in SESSION.walls:
            return idle(cls)
        known = wall_scene.SUMMARY_KEY in context.scene
        cls.poll_message_set("Find the displacement again: it is not in memory" if known else "Find the displacement first")
        return False

    def proposed(self, context: bpy.types.Context) -> Path:
        return project.folder(context.scene) / "displacement.csv"

    def prepare(self, context: bpy.types.Context) -> Work[str]:
        from ...core.report.page_frame import PAGE
        from ...core.wall_displacement.report import write_displacement_report
        from ...core.wall_displacement.tables import write_joints

        if not self.filepath:
            raise BimVerifyError("No file name was given. Choose where to write the CSV file.")
        path = named(self.filepath, ".csv")
        report = self.report_folder(path)
        found = SESSION.walls[context.scene[wall_scene.RESULT_KEY]]
        outputs = [path, *([report / PAGE] if report else [])]
        inputs.refuse(*outputs, beside=[*found.base_paths, *found.later_paths])

        def work(progress: Progress) -> str:
            with all_or_none():
                write_joints(path, found)
                if report is not None:
                    write_displacement_report(report, found)
                progress.check()
            return f"Written: {path}{f' and {report}' if report else ''}"

        return work

    def finish(self, context: bpy.types.Context, value: str) -> str:
        return value
