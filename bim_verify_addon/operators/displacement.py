"""How a panelled wall moved between two scans."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy

from ...core.errors import BimVerifyError
from ...core.progress import Progress
from .. import ifc_edits, project, scene, wall_scene
from ..jobs import Job, Work
from ..session import SESSION
from ..shared_settings import WallChoice
from .file_browser import idle

if TYPE_CHECKING:
    from ...core.wall_displacement.result import DisplacementResult


class BIMVERIFY_OT_displacement(WallChoice, Job["DisplacementResult"], bpy.types.Operator):
    """Compare two scans of a panelled wall, joint by joint and between the joints, and colour the wall by it."""

    bl_idname = "bim_verify.displacement"
    bl_label = "Find Displacement"
    bl_description = "Say how a panelled wall moved between two scans: its joints, and its face between them"
    bl_options = {"REGISTER", "UNDO"}
    title = "Wall displacement"
    panel_settings = ("bim_verify_displacement", *WallChoice.__annotations__)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        settings = context.scene.bim_verify_displacement
        if not (settings.base.strip() and settings.later.strip()):
            cls.poll_message_set("Name the scans of both epochs first")
            return False
        return idle(cls)

    def prepare(self, context: bpy.types.Context) -> Work[DisplacementResult]:
        from ...core.commands.checks import parse_place
        from ...core.jobs.displacement import DisplacementOptions, displacement

        settings, own = context.scene.bim_verify, context.scene.bim_verify_displacement
        options = DisplacementOptions(
            registration_sigma=own.registration_sigma_mm / 1000, origin=project.scanner_position(settings.origin),
            threads=settings.threads, memory_gb=settings.memory_gb, near=parse_place("Near", self.near.strip()),
        )
        base, later = (bpy.path.abspath(path) for path in (own.base, own.later))
        if self.element and not project.has_model(settings):
            raise BimVerifyError("There is no model to look for the element in. Import it, or leave the element empty.")
        load, element = (project.model_loader(context.scene) if self.element else None), self.element

        def work(progress: Progress) -> DisplacementResult:
            wall = None if load is None else (load(progress.part(0.0, 0.1)), element)
            return displacement([base], [later], options, progress.part(0.1, 1.0), wall)

        return work

    def finish(self, context: bpy.types.Context, value: DisplacementResult) -> str:
        from ...core.wall_displacement.psets import apply_displacement_pset

        if self.element:
            element = self.element
            ifc_edits.put(context, self.bl_idname, lambda file: apply_displacement_pset(file, element, value))
        message = wall_scene.show_displacement(context.scene, value)
        context.scene[wall_scene.RESULT_KEY] = SESSION.walls.keep(value)
        scene.show_colors_in_views()
        self.warn(value.warnings)
        return message
