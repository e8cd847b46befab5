"""The report, the tables, the IDS and the property set templates."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import bpy
from bpy.props import BoolProperty, StringProperty

from ...core.errors import BimVerifyError
from ...core.progress import Progress
from .. import bonsai
from .file_browser import idle
from .result_file import ResultFile, SelectionFile, Write

if TYPE_CHECKING:
    from ...core.dimensions.table import Dimension
    from ...core.results import VerificationResult


def dimensions_reader() -> Callable[[VerificationResult], list[Dimension]]:
    """What finds the dimensions as built, from Bonsai's file in memory where it holds one. Call this on the main thread."""
    from ...core.jobs import dimensions

    if (live := bonsai.live_copy()) is None:
        return dimensions
    folder, copy = live

    def of_live(result: VerificationResult) -> list[Dimension]:
        with folder:
            return dimensions(result, copy)

    return of_live


class BIMVERIFY_OT_report(SelectionFile, bpy.types.Operator):
    """Write the report: one page with pictures, charts and every element, and the table beside it."""

    bl_idname = "bim_verify.report"
    bl_label = "Write Report"
    bl_description = "Write a folder with the report: one HTML page with pictures, charts and every element, and a CSV table"
    bl_options = {"REGISTER"}
    title = "Write Report"
    ending = "_report"

    filepath: StringProperty(name="Folder", subtype="FILE_PATH", description="The folder to write; made if it is missing")
    filter_folder: BoolProperty(default=True, options={"HIDDEN"})
    dimensions: BoolProperty(
        name="Dimensions as built",
        description="With a table of rooms and openings: clear widths and heights as planned and as built, millimetres",
    )

    def inside(self) -> tuple[str, ...]:
        from ...core.report.html import PAGE, TABLE

        return PAGE, TABLE

    def writer(self, context: bpy.types.Context) -> Write:
        from ...core.report.html import write_report

        read = dimensions_reader() if self.dimensions else None

        def write(result: VerificationResult, path: Path, progress: Progress) -> str:
            progress.update(0.0, "Writing the report")
            rows = read(result) if read is not None else ()
            return str(write_report(path, result, dimensions=rows, progress=progress.part(0.3, 1.0)))

        return write


class BIMVERIFY_OT_export_dimensions(SelectionFile, bpy.types.Operator):
    """Write the clear widths and heights of rooms and openings as planned and as built, with their uncertainty."""

    bl_idname = "bim_verify.export_dimensions"
    bl_label = "Export Dimensions"
    bl_description = (
        "Write clear widths and heights of rooms and openings, planned and as built, with 95 % intervals, and tests for plumb, "
        "square, parallel and flat (CSV, millimetres)"
    )
    bl_options = {"REGISTER"}
    title = "Export Dimensions"
    ending, suffixes = "_dimensions.csv", (".csv",)

    filepath: StringProperty(name="File", subtype="FILE_PATH", description="The .csv file to write")
    filter_glob: StringProperty(default="*.csv", options={"HIDDEN"})
    check_existing: BoolProperty(default=True, options={"HIDDEN"})

    def writer(self, context: bpy.types.Context) -> Write:
        from ...core.dimensions.table import write_dimensions

        read = dimensions_reader()

        def write(result: VerificationResult, path: Path, progress: Progress) -> str:
            progress.update(0.0, "Measuring rooms and openings")
            rows = read(result)
            if not rows:
                raise BimVerifyError(
                    "No room or opening of the model was seen on two facing sides, so there is nothing to measure. "
                    "Dimensions need IfcSpace or IfcOpeningElement, and scans of what bounds them."
                )
            write_dimensions(path, rows)
            return f"{path}, {len(rows)} lines"

        return write


class BIMVERIFY_OT_export_table(SelectionFile, bpy.types.Operator):
    """Write one line an element, as an Excel workbook or as CSV."""

    bl_idname = "bim_verify.export_table"
    bl_label = "Export Table"
    bl_description = "Write one line an element: an Excel workbook (.xlsx), or CSV if the name ends so; lengths in mm"
    bl_options = {"REGISTER"}
    title = "Export Table"
    ending, suffixes = "_elements.xlsx", (".xlsx", ".csv")

    filepath: StringProperty(name="File", subtype="FILE_PATH", description="The .xlsx or .csv file to write")
    filter_glob: StringProperty(default="*.xlsx;*.csv", options={"HIDDEN"})
    check_existing: BoolProperty(default=True, options={"HIDDEN"})

    def writer(self, context: bpy.types.Context) -> Write:
        from ...core.exchange.xlsx import write_xlsx
        from ...core.report.csv_out import write_csv

        def write(result: VerificationResult, path: Path, progress: Progress) -> str:
            (write_csv if path.suffix.lower() == ".csv" else write_xlsx)(path, result)
            return str(path)

        return write


class BIMVERIFY_OT_export_ids(SelectionFile, bpy.types.Operator):
    """Write an IDS that checks a deliverable: property sets are there, levels are reached."""

    bl_idname = "bim_verify.export_ids"
    bl_label = "Export IDS"
    bl_description = "Write an IDS that checks a deliverable: the property sets are there, the required levels are reached"
    bl_options = {"REGISTER"}
    title = "Export IDS"
    ending, suffixes = "_check.ids", (".ids",)

    filepath: StringProperty(name="File", subtype="FILE_PATH", description="The IDS file to write")
    filter_glob: StringProperty(default="*.ids", options={"HIDDEN"})
    check_existing: BoolProperty(default=True, options={"HIDDEN"})

    def writer(self, context: bpy.types.Context) -> Write:
        from ...core.exchange.ids import write_ids

        def write(result: VerificationResult, path: Path, progress: Progress) -> str:
            write_ids(path, result)
            return str(path)

        return write


class BIMVERIFY_OT_export_templates(ResultFile, bpy.types.Operator):
    """Write the property set templates as an IFC library."""

    bl_idname = "bim_verify.export_templates"
    bl_label = "Export Property Set Templates"
    bl_description = "Write an IFC library that tells other tools what each of our properties means, and its kind of measure"
    bl_options = {"REGISTER"}
    title = "Export Property Set Templates"
    ending, suffixes = "_templates.ifc", (".ifc",)

    filepath: StringProperty(name="File", subtype="FILE_PATH", description="The IFC library to write")
    filter_glob: StringProperty(default="*.ifc", options={"HIDDEN"})
    check_existing: BoolProperty(default=True, options={"HIDDEN"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return idle(cls)

    def writer(self, context: bpy.types.Context) -> Write:
        from ...core.model.pset_templates import write_templates

        def write(result: VerificationResult, path: Path, progress: Progress) -> str:
            write_templates(path)
            return str(path)

        return write
