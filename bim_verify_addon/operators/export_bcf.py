"""Findings as BCF topics."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty

from ...core.progress import Progress
from ...core.report.palette import STATUS_LABELS, STATUS_MEANINGS
from .. import selection
from .result_file import ResultFile, Write

if TYPE_CHECKING:
    from ...core.results import VerificationResult

STATUS_ITEMS = [
    (status, label, STATUS_MEANINGS[status], 1 << bit) for bit, (status, label) in enumerate(STATUS_LABELS.items())
]


class BIMVERIFY_OT_export_bcf(ResultFile, bpy.types.Operator):
    """Write one BCF topic a finding, with the camera that shows it, a picture and the element's GlobalId."""

    bl_idname = "bim_verify.export_bcf"
    bl_label = "Export BCF"
    bl_description = "Write one BCF topic a finding: camera, picture, GlobalId, numbers; any BCF tool opens it"
    bl_options = {"REGISTER"}
    title = "Export BCF"
    ending, suffixes = "_findings.bcf", (".bcf", ".bcfzip")

    filepath: StringProperty(name="File", subtype="FILE_PATH", description="The BCF file to write")
    filter_glob: StringProperty(default="*.bcf;*.bcfzip", options={"HIDDEN"})
    check_existing: BoolProperty(default=True, options={"HIDDEN"})
    version: EnumProperty(
        name="Version",
        items=[("3.0", "BCF 3.0", "The current version"), ("2.1", "BCF 2.1", "For older tools")],
        default="3.0",
        description="Version of the BCF file",
    )
    statuses: EnumProperty(
        name="Findings",
        items=STATUS_ITEMS,
        options={"ENUM_FLAG"},
        default={"DEVIATING", "ABSENT", "PARTIAL"},
        description="Which verdicts become topics",
    )
    selected_only: BoolProperty(name="Selected elements only", description="Topics for the selected elements only")
    pictures: BoolProperty(name="Pictures", default=True, description="A picture in each topic (a second or two each)")

    def writer(self, context: bpy.types.Context) -> Write:
        from ...core.exchange.bcf import write_bcf

        only = selection.chosen(context, self.selected_only)
        version, statuses, pictures = self.version, set(self.statuses), self.pictures

        def write(result: VerificationResult, path: Path, progress: Progress) -> str:
            count = write_bcf(
                path, result, version=version, statuses=statuses, global_ids=only, pictures=pictures, progress=progress
            )
            return f"{path} ({count} topics)"

        return write
