"""Write what a comparison found: everything that the command ``change`` writes, into one folder."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy
from bpy.props import BoolProperty

from ..session import SESSION
from .result_folder import Part, ResultFolder, model_part

if TYPE_CHECKING:
    from ...core.change.results import ChangeResult

MODEL, VOXELS, JSON, REPORT, REMAINING = "changed.ifc", "voxels.ply", "change.json", "report", "remaining"


class BIMVERIFY_OT_export_change(ResultFolder, bpy.types.Operator):
    """Write a folder with the model, the report, the voxels, the remaining shapes and the numbers of a comparison."""

    bl_idname = "bim_verify.export_change"
    bl_label = "Export Changes"
    bl_description = (
        f"Write a folder: the model with property sets ({MODEL}), a report, voxels (PLY), what remains of partly demolished "
        "elements (OBJ) and all numbers (JSON)"
    )
    bl_options = {"REGISTER"}
    title = "Export Changes"
    ending, first = "_change", "Find changes"

    model: BoolProperty(name="Model", default=True, description="A copy of the IFC file with a property set on every element")
    page: BoolProperty(name="Report", default=True, description="One HTML page, and a table of the elements as CSV")
    voxels: BoolProperty(name="Voxels", default=True, description="All voxels with their state, as PLY")
    remaining: BoolProperty(
        name="Remaining shapes", default=True, description="What remains of partly demolished elements, an OBJ each"
    )
    numbers: BoolProperty(name="Numbers", default=True, description="Everything but the voxels, as JSON")

    @classmethod
    def found(cls, scene: bpy.types.Scene) -> ChangeResult | None:
        return SESSION.comparisons.get(scene.bim_verify_change.result_key)

    @classmethod
    def shown(cls, scene: bpy.types.Scene) -> bool:
        return bool(scene.bim_verify_change.summary)

    def parts(self, found: ChangeResult) -> list[Part]:
        from ...core.change.psets import write_changed_ifc
        from ...core.report.change_files import change_to_json, write_voxels
        from ...core.report.change_page import write_change_report
        from ...core.report.json_out import write_document
        from ...core.report.remaining import write_remaining

        return [
            model_part(MODEL, lambda p, on: write_changed_ifc(found.model.path, found, p, progress=on), self.model),
            Part(VOXELS, lambda path, _: write_voxels(path, found), self.voxels),
            Part(REMAINING, lambda path, _: write_remaining(path, found), self.remaining),
            Part(JSON, lambda path, _: write_document(path, change_to_json(found)), self.numbers),
            Part(REPORT, lambda path, on: write_change_report(path, found, progress=on), self.page),
        ]
