"""Move the scans onto the model."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import bpy
from bpy.props import EnumProperty

from ...core.progress import Progress
from .. import project, scene
from ..jobs import Job, Work
from ..properties import ALIGN_ITEMS
from ..session import SESSION
from .file_browser import idle

if TYPE_CHECKING:
    from ...core.results import AlignmentRecord


class BIMVERIFY_OT_align(Job["AlignmentRecord"], bpy.types.Operator):
    """Find how the scans lie against the model, show them there, and use it when verifying."""

    bl_idname = "bim_verify.align"
    bl_label = "Align Scans"
    bl_description = "Find how the scans lie against the model, with its uncertainty, and show them there"
    bl_options = {"REGISTER", "UNDO"}
    title = "Align"

    mode: EnumProperty(name="From", items=ALIGN_ITEMS[1:], default="fine", description="What is known about the pose")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        settings = context.scene.bim_verify
        if not project.has_model(settings):
            cls.poll_message_set("Import an IFC model first")
            return False
        if not any(scan.use for scan in settings.scans):
            cls.poll_message_set("Add at least one scan first")
            return False
        return idle(cls)

    def prepare(self, context: bpy.types.Context) -> Work[AlignmentRecord]:
        from ...core import jobs

        settings = context.scene.bim_verify
        options = replace(project.options(settings), align=self.mode)
        load, paths = project.model_loader(context.scene), project.scan_paths(settings)

        def work(progress: Progress) -> AlignmentRecord:
            return jobs.align(load(progress.part(0.0, 0.2)), paths, options, progress.part(0.2, 1.0))

        return work

    def finish(self, context: bpy.types.Context, value: AlignmentRecord) -> str:
        settings = context.scene.bim_verify
        SESSION.alignments[context.scene.name] = value
        settings.align = self.mode
        scene.move_scans(context.scene, value.transform)
        fit = "" if value.rms is None else f", residual {1000 * value.rms:.1f} mm"
        weakest = f" Weakest: {value.weakest_direction}." if value.weakest_direction else ""
        settings.alignment_summary = f"Aligned ({self.mode}){fit}.{weakest}"
        return settings.alignment_summary
