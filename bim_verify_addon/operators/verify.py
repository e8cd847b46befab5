"""The main job."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, FloatProperty
from numpy.typing import NDArray

from ...core.progress import Progress
from .. import bonsai, paint, project, scene, selection, verdicts
from ..jobs import Job, Work
from ..properties import ALIGN_ITEMS, DEFAULTS
from ..session import SESSION
from ..shared_settings import LOA_ITEMS
from ..surface_grid import Display, make_display
from .file_browser import has_model, has_scans, idle

if TYPE_CHECKING:
    from ...core.results import Decision, VerificationResult


class BIMVERIFY_OT_verify(Job["tuple[VerificationResult, Display, NDArray[np.float64]]"], bpy.types.Operator):
    """Decide for every element whether the scans confirm it, contradict it or never saw it, and colour it."""

    bl_idname = "bim_verify.verify"
    bl_label = "Verify"
    bl_description = "Decide for every element whether the scans confirm it, contradict it, or never saw it"
    bl_options = {"REGISTER", "UNDO"}
    title = "Verify"
    panel_settings = ("bim_verify", "loa", "sigma_mm", "align", "selected_only")

    loa: EnumProperty(
        name="Level", items=LOA_ITEMS, default=str(DEFAULTS.loa), description="Level of accuracy that is required"
    )
    sigma_mm: FloatProperty(
        name="Scanner sigma (mm)",
        default=DEFAULTS.sigma * 1000,
        min=0.01,
        soft_max=50,
        precision=2,
        description="Standard deviation of one return along its ray, millimetres",
    )
    align: EnumProperty(
        name="Alignment",
        items=ALIGN_ITEMS,
        default=DEFAULTS.align,
        description="How the scans are moved onto the model",
    )

    selected_only: BoolProperty(
        name="Selected elements only",
        description="Give verdicts to the selected elements only; the others keep what they have (all are verified where no "
        "result that fits is in memory)",
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_model(cls, context) and has_scans(cls, context) and idle(cls)

    def prepare(self, context: bpy.types.Context) -> Work[tuple[VerificationResult, Display, NDArray[np.float64]]]:
        from ...core import jobs
        from ...core.model.decisions import decisions_in

        settings = context.scene.bim_verify
        options = replace(project.options(settings), loa=int(self.loa), sigma=self.sigma_mm / 1000, align=self.align)
        only = selection.chosen(context, self.selected_only)
        self.earlier = earlier = project.result(context.scene)
        self.only = only
        load, paths = project.model_loader(context.scene), project.scan_paths(settings)
        budget = settings.display_vertices
        path = "" if bonsai.live_file() is not None else project.model_path(settings)

        def work(progress: Progress) -> tuple[VerificationResult, Display, NDArray[np.float64]]:
            model = load(progress.part(0.0, 0.1))
            narrow = only is not None and selection.comparable(model, options, earlier)
            asked = replace(options, only=tuple(sorted(only or ())) if narrow else ())
            result = jobs.verify(model, paths, asked, progress.part(0.1, 0.9))
            result = replace(result, decisions=decisions_in(path) if path else {})
            placement = result.alignment.transform @ project.placement(model, paths, options)
            return result, make_display(result, budget, progress.part(0.9, 1.0)), placement

        return work

    def finish(self, context: bpy.types.Context, value: tuple[VerificationResult, Display, NDArray[np.float64]]) -> str:
        from ...core.model.write_psets import write_verdicts

        result, display, placement = value
        result = replace(result, decisions=self.decided(context, result))
        if self.only is not None and not selection.comparable(result.model, result.options, self.earlier):
            self.only = None
            self.warn(["No result that fits is in memory: all elements were verified, and all have new verdicts."])
        result = selection.merged(result, self.earlier, self.only)

        settings = context.scene.bim_verify
        project.adopt_frame(context.scene, result.model)
        scene.show_result(context.scene, result, display, self.only)
        verdicts.store_all(context.scene, result)
        bonsai.change_file(context, self.bl_idname, lambda file: write_verdicts(file, result))
        settings.result_key = SESSION.results.keep(result)
        settings.exported_path = ""
        SESSION.models[context.scene.session_uid] = result.model
        paint.refresh(context.scene)
        scene.move_scans(context.scene, placement)
        scene.show_planned(context, False)
        scene.show_colors_in_views()
        self.warn([*result.warnings, *filter(None, [display.note])])
        return settings.result_summary

    def decided(self, context: bpy.types.Context, result: VerificationResult) -> dict[str, Decision]:
        """The file's decisions and, before them, the scene's: also those made, or taken back, while the job ran."""
        from ...core.model.decisions import read_decisions

        live = bonsai.live_file()
        written = result.decisions if live is None else read_decisions(live)
        back = verdicts.taken_back(context.scene)
        return {**{g: d for g, d in written.items() if g not in back}, **verdicts.decisions(context.scene)}
