"""What changed between epochs and against the model."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import bpy
import numpy as np
from bpy.props import BoolProperty
from numpy.typing import NDArray

from ...core.options import ChangeOptions
from ...core.progress import Progress
from .. import change_scene, ifc_edits, project, scene, selection
from ..jobs import Job, Work
from ..session import SESSION
from .file_browser import has_model, has_scans, idle

if TYPE_CHECKING:
    from ...core.change.results import ChangeResult


Placed = tuple["ChangeResult", list["NDArray[np.float64]"]]
"""A comparison, and where it put the scans of each epoch."""


class BIMVERIFY_OT_change(Job[Placed], bpy.types.Operator):
    """Say what appeared, vanished or stayed, colour the elements by it and show the voxels that changed."""

    bl_idname = "bim_verify.change"
    bl_label = "Find Changes"
    bl_description = "Compare the scans with the reference epoch, or with the model: what is new, gone, or as before"
    bl_options = {"REGISTER", "UNDO"}
    title = "Change"

    selected_only: BoolProperty(
        name="Selected elements only", default=False,
        description="Say it of the selected elements; the others keep what they have. Voxels are those of the whole scan",
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_model(cls, context) and has_scans(cls, context) and idle(cls)

    def prepare(self, context: bpy.types.Context) -> Work[Placed]:
        from ...core import jobs
        from ...core.change.planned import check_day

        self.only = selection.chosen(context, self.selected_only)
        settings, own = context.scene.bim_verify, context.scene.bim_verify_change
        options = ChangeOptions(
            voxel=own.voxel_mm / 1000, min_points=own.min_points, sigma=settings.sigma_mm / 1000,
            sample_spacing=settings.spacing_mm / 1000, scan_frame=settings.scan_frame,
            loa=None if own.loa == "NONE" else int(own.loa), date=check_day(own.date, own.bl_rna.properties["date"].name),
            registration_sigma=own.known_sigma(), align=settings.align,
            origin=project.scanner_position(settings.origin), threads=settings.threads, memory_gb=settings.memory_gb,
        )
        load, epochs = project.model_loader(context.scene), project.epochs(settings, own.grouping)
        reference = [bpy.path.abspath(scan.path) for scan in own.references] or None

        self.epochs = epochs

        def work(progress: Progress) -> Placed:
            model = load(progress.part(0.0, 0.1))
            result = jobs.change(model, epochs, reference, options, progress.part(0.1, 1.0))
            if options.align == "none":
                return result, []
            placed = zip(result.epochs, epochs, strict=True)
            return result, [e.alignment.transform @ project.placement(model, paths, options) for e, paths in placed]

        return work

    def finish(self, context: bpy.types.Context, found: Placed) -> str:
        from ...core.change.psets import PSET_NAME, change_entries
        from ...core.model.property_sets import put_property_sets

        value, placements = found
        entries = change_entries(value, self.only)
        put_entries = partial(put_property_sets, pset_name=PSET_NAME, entries=entries)
        ifc_edits.put(context, self.bl_idname, put_entries, adds=self.only is not None)
        SESSION.models[context.scene.session_uid] = value.model
        project.adopt_frame(context.scene, value.model)
        for paths, placement in zip(self.epochs, placements, strict=False):
            scene.move_scans(context.scene, placement, paths)
        change_scene.show_change(context.scene, value, self.only)
        context.scene.bim_verify_change.result_key = SESSION.comparisons.keep(value)
        scene.show_planned(context, False)
        scene.show_colors_in_views()
        self.warn(value.warnings)
        return context.scene.bim_verify_change.summary
