"""Move the scans onto the model."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import bpy
import numpy as np
from bpy.props import EnumProperty
from numpy.typing import NDArray

from ...core.progress import Progress
from .. import project, scene
from ..jobs import Job, Work
from ..properties import ALIGN_ITEMS
from .file_browser import has_model, has_scans, idle

if TYPE_CHECKING:
    from ...core.results import AlignmentRecord


class BIMVERIFY_OT_align(Job["tuple[AlignmentRecord, NDArray[np.float64]]"], bpy.types.Operator):
    """Find how the scans lie against the model, show them there, and use it when verifying."""

    bl_idname = "bim_verify.align"
    bl_label = "Align Scans"
    bl_description = "Find how the scans lie against the model, with its uncertainty, and show them there"
    bl_options = {"REGISTER", "UNDO"}
    title = "Align"

    mode: EnumProperty(name="From", items=ALIGN_ITEMS[1:], default="fine", description="What is known about the pose")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_model(cls, context) and has_scans(cls, context) and idle(cls)

    def prepare(self, context: bpy.types.Context) -> Work[tuple[AlignmentRecord, NDArray[np.float64]]]:
        from ...core import jobs

        settings = context.scene.bim_verify
        options = replace(project.options(settings), align=self.mode)
        load, paths = project.model_loader(context.scene), project.scan_paths(settings)

        def work(progress: Progress) -> tuple[AlignmentRecord, NDArray[np.float64]]:
            model = load(progress.part(0.0, 0.2))
            record = jobs.align_scans(model, paths, options, progress.part(0.2, 1.0))
            return record, record.transform @ project.placement(model, paths, options)

        return work

    def finish(self, context: bpy.types.Context, value: tuple[AlignmentRecord, NDArray[np.float64]]) -> str:
        settings = context.scene.bim_verify
        record, placement = value
        settings.align = self.mode
        scene.move_scans(context.scene, placement)
        fit = "" if record.rms is None else f", residual {1000 * record.rms:.1f} mm"
        weakest = f" Weakest: {record.weakest_direction}" if record.weakest_direction else ""
        settings.alignment_summary = f"Aligned ({self.mode}){fit}.{weakest}"
        return settings.alignment_summary
