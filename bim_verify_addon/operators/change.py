"""What changed between epochs and against the model."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy

from ...core.options import ChangeOptions
from ...core.progress import Progress
from .. import change_scene, ifc_edits, project, scene
from ..jobs import Job, Work
from ..session import SESSION
from .file_browser import has_model, has_scans, idle

if TYPE_CHECKING:
    from ...core.change.results import ChangeResult


class BIMVERIFY_OT_change(Job["ChangeResult"], bpy.types.Operator):
    """Say what appeared, vanished or stayed, colour the elements by it and show the voxels that changed."""

    bl_idname = "bim_verify.change"
    bl_label = "Find Changes"
    bl_description = "Compare the scans with the reference epoch, or with the model: what is new, gone, or as before"
    bl_options = {"REGISTER", "UNDO"}
    title = "Change"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_model(cls, context) and has_scans(cls, context) and idle(cls)

    def prepare(self, context: bpy.types.Context) -> Work[ChangeResult]:
        from ...core import jobs
        from ...core.change.planned import check_day

        settings, own = context.scene.bim_verify, context.scene.bim_verify_change
        options = ChangeOptions(
            voxel=own.voxel_mm / 1000, min_points=own.min_points, sigma=settings.sigma_mm / 1000,
            sample_spacing=settings.spacing_mm / 1000, scan_frame=settings.scan_frame,
            loa=None if own.loa == "NONE" else int(own.loa), date=check_day(own.date, own.bl_rna.properties["date"].name),
            registration_sigma=own.registration_sigma_mm / 1000 if own.registration_known else None,
            origin=project.scanner_position(settings.origin), threads=settings.threads, memory_gb=settings.memory_gb,
        )
        load, epochs = project.model_loader(context.scene), project.epochs(settings, own.grouping)
        reference = [bpy.path.abspath(scan.path) for scan in own.references] or None

        def work(progress: Progress) -> ChangeResult:
            model = load(progress.part(0.0, 0.1))
            return jobs.change(model, epochs, reference, options, progress.part(0.1, 1.0))

        return work

    def finish(self, context: bpy.types.Context, value: ChangeResult) -> str:
        from ...core.change.psets import apply_changes

        ifc_edits.put(context, self.bl_idname, lambda file: apply_changes(file, value))
        SESSION.models[context.scene.name] = value.model
        project.adopt_frame(context.scene, value.model)
        change_scene.show_change(context.scene, value)
        context.scene.bim_verify_change.result_key = SESSION.keep_comparison(value)
        scene.show_planned(context, False)
        scene.show_colors_in_views()
        self.warn(value.warnings)
        return context.scene.bim_verify_change.summary
