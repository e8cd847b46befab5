"""Scan quality: what the scans are worth for every element, what is missing, and why."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty

from ...core.progress import Progress
from .. import ifc_edits, project, scene, selection
from ..jobs import Job, Work
from ..session import SESSION
from ..shared_settings import LOA_ITEMS
from .file_browser import has_model, has_scans, idle

if TYPE_CHECKING:
    from ...core.quality.results import QualityResult
    from ..survey_scene import SurveyDisplay


class BIMVERIFY_OT_quality(Job["tuple[QualityResult, SurveyDisplay]"], bpy.types.Operator):
    """Measure spacing, noise and coverage of the scans on every element, and colour what is missing by its cause."""

    bl_idname = "bim_verify.quality"
    bl_label = "Scan Quality"
    bl_description = "Measure spacing, noise and coverage on every element, and colour what is missing by its cause"
    bl_options = {"REGISTER", "UNDO"}
    title = "Scan quality"
    panel_settings = ("bim_verify", "loa")

    loa: EnumProperty(name="Level", items=LOA_ITEMS, default="30", description="Level that the scans should support")
    coverage: FloatProperty(
        name="Coverage", default=0.8, min=0.01, max=1.0, subtype="FACTOR",
        description="Share of an element's surface that should have returns",
    )
    selected_only: BoolProperty(
        name="Selected elements only", default=False,
        description="Say it of the selected elements; the others keep what they have, and go on hiding what is behind them",
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_model(cls, context) and has_scans(cls, context) and idle(cls)

    def prepare(self, context: bpy.types.Context) -> Work[tuple[QualityResult, SurveyDisplay]]:
        from ...core import jobs
        from ...core.quality.options import QualityOptions
        from ..survey_scene import make_survey_display

        self.only = selection.chosen(context, self.selected_only)
        settings = context.scene.bim_verify
        common = project.options(settings)
        options = QualityOptions(
            loa=int(self.loa), target_coverage=self.coverage, scan_frame=common.scan_frame, origin=common.origin,
            threads=common.threads, memory_gb=common.memory_gb,
        )
        load, paths, budget = (
            project.model_loader(context.scene), project.scan_paths(settings), settings.display_vertices,
        )
        spacing = common.sample_spacing

        def work(progress: Progress) -> tuple[QualityResult, SurveyDisplay]:
            model = load(progress.part(0.0, 0.1))
            result = jobs.quality(model, paths, options, progress.part(0.1, 0.9))
            return result, make_survey_display(result, budget, progress.part(0.9, 1.0), spacing)

        return work

    def finish(self, context: bpy.types.Context, value: tuple[QualityResult, SurveyDisplay]) -> str:
        from ...core.model.property_sets import put_property_sets
        from ...core.quality.write_ifc import PSET_NAME, quality_entries
        from ..survey_scene import SURVEY_KEY, show_quality

        (result, display), only = value, self.only
        entries = quality_entries(result, only)
        put_entries = partial(put_property_sets, pset_name=PSET_NAME, entries=entries)
        ifc_edits.put(context, self.bl_idname, put_entries, adds=only is not None)
        project.adopt_frame(context.scene, result.model)
        message = show_quality(context.scene, result, display, only)
        context.scene[SURVEY_KEY] = SESSION.surveys.keep(result)
        scene.show_colors_in_views()
        self.warn(result.warnings)
        return message
