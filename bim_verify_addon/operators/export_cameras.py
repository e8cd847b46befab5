"""Write photos that were placed on the model: the refined cameras, all numbers and the report, as ``coregister`` does."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy
from bpy.props import BoolProperty

from .. import photo_scene
from ..session import SESSION
from .result_folder import Part, ResultFolder

if TYPE_CHECKING:
    from ...core.imagery.coregistration import CoregistrationResult

CAMERAS, NUMBERS, REPORT = "cameras_refined.json", "coregistration.json", "report"


class BIMVERIFY_OT_export_cameras(ResultFolder, bpy.types.Operator):
    """Write a folder with the refined cameras of placed photos, the lines that fixed them, and the report."""

    bl_idname = "bim_verify.export_cameras"
    bl_label = "Export Cameras"
    bl_description = (
        f"Write a folder: the cameras as placed, a cameras file again ({CAMERAS}), a report with the model's edges over the "
        "photos, and every matched line (JSON)"
    )
    bl_options = {"REGISTER"}
    title = "Export Cameras"
    ending, first = "_photos", "Place photos"

    page: BoolProperty(name="Report", default=True, description="One HTML page with the edges over the photos")
    numbers: BoolProperty(name="Numbers", default=True, description="The cameras with every matched line, as JSON")

    @classmethod
    def found(cls, scene: bpy.types.Scene) -> CoregistrationResult | None:
        return SESSION.photos.get(scene.get(photo_scene.RESULT_KEY, ""))

    @classmethod
    def shown(cls, scene: bpy.types.Scene) -> bool:
        return photo_scene.SUMMARY_KEY in scene

    def sources(self, scene: bpy.types.Scene, found: CoregistrationResult) -> list[str]:
        return [found.model.path, *found.images, *([given] if (given := scene.get(photo_scene.CAMERAS_KEY)) else [])]

    def parts(self, found: CoregistrationResult) -> list[Part]:
        from ...core.imagery.coregistration import findings, refined_cameras
        from ...core.imagery.report import write_coregistration_report
        from ...core.report.json_out import write_document

        return [
            Part(CAMERAS, lambda path, _: write_document(path, refined_cameras(found))),
            Part(NUMBERS, lambda path, _: write_document(path, findings(found)), self.numbers),
            Part(REPORT, lambda path, _: write_coregistration_report(path, found), self.page),
        ]
