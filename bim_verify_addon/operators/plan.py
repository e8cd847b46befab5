"""Planning: where to stand a scanner."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty

from ...core.progress import Progress
from .. import project, scene, selection
from ..forecast_scene import show_plan
from ..jobs import Job, Work
from ..session import SESSION
from ..shared_settings import LOA_ITEMS
from ..survey_scene import PLAN_KEY
from .file_browser import has_model, idle

if TYPE_CHECKING:
    from ...core.planning.results import PlanResult

SCANNERS = (
    ("medium", "Medium", "0.09 degrees"), ("fast", "Fast", "0.18 degrees"), ("fine", "Fine", "0.045 degrees"),
    ("auto", "Least time", "The preset that takes the least time"),
)


class BIMVERIFY_OT_plan(Job["PlanResult"], bpy.types.Operator):
    """Find the fewest stations that bring the chosen elements to a level of accuracy, and mark them."""

    bl_idname = "bim_verify.plan"
    bl_label = "Plan Scan"
    bl_description = "Find the fewest stations that bring the elements to a level of accuracy, and mark them"
    bl_options = {"REGISTER", "UNDO"}
    title = "Plan"
    panel_settings = ("bim_verify", "loa")

    loa: EnumProperty(name="Level", items=LOA_ITEMS, default="30", description="Level of accuracy to reach")
    scanner: EnumProperty(name="Scanner", items=SCANNERS, default="medium", description="Preset of the scanner")
    coverage: FloatProperty(
        name="Coverage", default=0.9, min=0.01, max=1.0, subtype="FACTOR",
        description="Share of what can be reached of each element",
    )
    selected_only: BoolProperty(name="Selected elements only", description="Plan for the elements that are selected")
    add: BoolProperty(name="Add to the scans", description="Plan the set-ups that the scans of this scene lack")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_model(cls, context) and idle(cls)

    def prepare(self, context: bpy.types.Context) -> Work[PlanResult]:
        from ...core import jobs
        from ...core.planning.options import PlanOptions

        settings = context.scene.bim_verify
        common = project.options(settings)
        chosen = tuple(sorted(selection.chosen(context, self.selected_only) or ()))
        options = PlanOptions(
            loa=int(self.loa), scanner=self.scanner, coverage=self.coverage, elements=chosen,
            scan_frame=common.scan_frame, origin=common.origin, threads=common.threads, memory_gb=common.memory_gb,
        )
        load = project.model_loader(context.scene)
        paths = project.scan_paths(settings) if self.add else []

        def work(progress: Progress) -> PlanResult:
            return jobs.plan(load(progress.part(0.0, 0.1)), options, progress.part(0.1, 1.0), paths)

        return work

    def finish(self, context: bpy.types.Context, value: PlanResult) -> str:
        project.adopt_frame(context.scene, value.model)
        message = show_plan(context.scene, value)
        context.scene[PLAN_KEY] = SESSION.plans.keep(value)
        scene.show_colors_in_views()
        self.warn(value.warnings)
        return message
