"""Write what a survey of the scans found, or a plan of new ones: everything that ``quality`` and ``plan`` write."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy
from bpy.props import BoolProperty

from .. import survey_scene
from ..session import SESSION
from .result_folder import Part, ResultFolder, model_part

if TYPE_CHECKING:
    from ...core.planning.results import PlanResult
    from ...core.quality.results import QualityResult

SURVEYED, PATCHES, SAMPLES, QUALITY, REPORT = "surveyed.ifc", "patches.csv", "samples.ply", "quality.json", "report"
STATIONS, TABLE, PLANNED = "stations.json", "stations.csv", "planned.ifc"


class BIMVERIFY_OT_export_quality(ResultFolder, bpy.types.Operator):
    """Write a folder with the model, the report, the patches, the query positions and the numbers of a survey."""

    bl_idname = "bim_verify.export_quality"
    bl_label = "Export Quality"
    bl_description = (
        f"Write a folder: the model with property sets ({SURVEYED}), a report, the quality of every patch (CSV), the query "
        "positions by the cause of what is missing (PLY) and all numbers (JSON)"
    )
    bl_options = {"REGISTER"}
    title = "Export Quality"
    ending, first = "_quality", "Find the scan quality"

    model: BoolProperty(name="Model", default=True, description="A copy of the IFC file with a property set on every element")
    page: BoolProperty(name="Report", default=True, description="One HTML page")
    patches: BoolProperty(name="Patches", default=True, description="A line for each patch of surface, as CSV")
    samples: BoolProperty(name="Query positions", default=True, description="Coloured by the cause of what is missing, as PLY")
    numbers: BoolProperty(name="Numbers", default=True, description="Everything but patches and positions, as JSON")

    @classmethod
    def found(cls, scene: bpy.types.Scene) -> QualityResult | None:
        return SESSION.surveys.get(scene.get(survey_scene.SURVEY_KEY, ""))

    @classmethod
    def shown(cls, scene: bpy.types.Scene) -> bool:
        return survey_scene.SURVEY_KEY in scene

    def parts(self, found: QualityResult) -> list[Part]:
        from ...core.quality.json_out import quality_to_json, write_patches, write_quality_samples
        from ...core.quality.report import write_quality_report
        from ...core.quality.write_ifc import write_quality_ifc
        from ...core.report.json_out import write_document

        return [
            model_part(SURVEYED, lambda p, on: write_quality_ifc(found.model.path, found, p, progress=on), self.model),
            Part(PATCHES, lambda path, _: write_patches(path, found), self.patches),
            Part(SAMPLES, lambda path, _: write_quality_samples(path, found), self.samples),
            Part(QUALITY, lambda path, _: write_document(path, quality_to_json(found)), self.numbers),
            Part(REPORT, lambda path, _: write_quality_report(path, found), self.page),
        ]


class BIMVERIFY_OT_export_plan(ResultFolder, bpy.types.Operator):
    """Write a folder with the set-ups of a plan, the model with them as annotations, and the report."""

    bl_idname = "bim_verify.export_plan"
    bl_label = "Export Plan"
    bl_description = (
        f"Write a folder: the set-ups as found, for bim-verify simulate ({STATIONS}) and as a table (CSV), the model with "
        "them as annotations, and a report"
    )
    bl_options = {"REGISTER"}
    title = "Export Plan"
    ending, first = "_plan", "Plan a scan"

    model: BoolProperty(name="Model", default=True, description="A copy of the IFC file with an annotation for each set-up")
    page: BoolProperty(name="Report", default=True, description="One HTML page")

    @classmethod
    def found(cls, scene: bpy.types.Scene) -> PlanResult | None:
        return SESSION.plans.get(scene.get(survey_scene.PLAN_KEY, ""))

    @classmethod
    def shown(cls, scene: bpy.types.Scene) -> bool:
        return survey_scene.PLAN_KEY in scene

    def parts(self, found: PlanResult) -> list[Part]:
        from ...core.planning.outputs import write_plan_csv, write_plan_ifc, write_plan_json
        from ...core.planning.report import write_plan_report

        return [
            Part(STATIONS, lambda path, _: write_plan_json(path, found)),
            Part(TABLE, lambda path, _: write_plan_csv(path, found)),
            Part(PLANNED, lambda path, _: write_plan_ifc(found.model.path, found, path), self.model),
            Part(REPORT, lambda path, _: write_plan_report(path, found), self.page),
        ]
