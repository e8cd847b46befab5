"""Bring scans in."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import bpy
import numpy as np
from bpy.props import CollectionProperty, StringProperty
from numpy.typing import NDArray

from ...core.errors import BimVerifyError
from ...core.files import same_file
from ...core.progress import Progress
from .. import project, scene
from ..jobs import Work
from ..point_display import points_shown
from ..session import SESSION
from ..sight import look_at_all
from .file_browser import FileJob, chosen, idle

if TYPE_CHECKING:
    from ...core.model.elements import BuildingModel

SCAN_FILES = "*.e57;*.las;*.laz;*.ply;*.pcd;*.pts;*.ptx;*.xyz;*.txt;*.asc;*.csv;*.npy;*.json;*.out"
"""What the file browser shows."""


@dataclass(frozen=True)
class Cloud:
    """One scan file, thinned for display."""

    path: str
    points: int
    stations: int
    xyz: NDArray[np.float64]
    station: NDArray[np.int32]
    color: NDArray[np.uint8] | None


@dataclass(frozen=True)
class Clouds:
    """What was read, and where the whole campaign lies in the model frame."""

    clouds: list[Cloud]
    model: BuildingModel | None
    placement: NDArray[np.float64]
    warnings: list[str]


class BIMVERIFY_OT_import_scan(FileJob[Clouds], bpy.types.Operator):
    """Add scan files to the campaign and show each as a thinned cloud; verification reads the whole files."""

    bl_idname = "bim_verify.import_scan"
    bl_label = "Add Scans"
    bl_description = (
        "Add scan files (E57, LAS, LAZ, PLY, PCD, PTS, PTX, XYZ, CSV) or projects of photos, and show each as a thinned cloud"
    )
    bl_options = {"REGISTER", "UNDO"}
    title = "Add Scans"

    filepath: StringProperty(name="File", subtype="FILE_PATH", description="Scan file")
    directory: StringProperty(subtype="DIR_PATH", options={"HIDDEN"})
    files: CollectionProperty(type=bpy.types.OperatorFileListElement, options={"HIDDEN"})
    filter_glob: StringProperty(default=SCAN_FILES, options={"HIDDEN"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return idle(cls)

    def prepare(self, context: bpy.types.Context) -> Work[Clouds]:
        from ...core.scans.open import open_scans
        from ...core.scans.thin import thin

        paths = chosen(self)
        if not paths:
            raise BimVerifyError("No scan file was given. Choose at least one.")
        settings = context.scene.bim_verify
        options, most = project.options(settings), points_shown(settings)
        known = SESSION.models.get(context.scene.session_uid)
        load = project.model_loader(context.scene) if known is None and project.has_model(settings) else None
        campaign = project.without_repeats([*project.scan_paths(settings), *paths])
        paths = project.without_repeats(paths)

        def work(progress: Progress) -> Clouds:
            clouds = []
            for number, path in enumerate(paths):
                progress.update(number / len(paths), f"Reading {Path(path).name}")
                source = open_scans([path], origin=options.origin)
                part = progress.part(number / len(paths), (number + 1) / len(paths))
                xyz, station, color = thin(source, most, progress=part)
                clouds.append(Cloud(path, source.point_count, len(source.stations), xyz, station, color))
            model, warnings = known, list[str]()
            if load is not None:
                try:
                    model = load(progress)
                except BimVerifyError as error:
                    warnings.append(f"The scans are shown where their files put them, without the model: {error}")
            return Clouds(clouds, model, project.placement(model, campaign, options), warnings)

        return work

    def finish(self, context: bpy.types.Context, value: Clouds) -> str:
        settings = context.scene.bim_verify
        if value.model is not None:
            SESSION.models[context.scene.session_uid] = value.model
        first = not scene.element_objects(context.scene) and not scene.scan_objects(context.scene)
        for cloud in value.clouds:
            known = (scan for scan in settings.scans if same_file(bpy.path.abspath(scan.path), cloud.path))
            entry = next(known, None) or settings.scans.add()
            entry.path = entry.path or cloud.path
            entry.name = Path(cloud.path).name
            entry.points, entry.stations = cloud.points, cloud.stations
            project.adopt_frame(context.scene, value.model, cloud.xyz)
            scene.show_scan(context.scene, entry.path, entry.name, cloud.xyz, cloud.station, cloud.color)
        scene.move_scans(context.scene, value.placement)
        scene.show_colors_in_views()
        if first:
            context.view_layer.update()
            look_at_all(context, scene.scan_objects(context.scene))
        settings.alignment_summary = ""
        settings.scan_index = len(settings.scans) - 1
        self.warn(value.warnings)
        points = sum(cloud.points for cloud in value.clouds)
        return f"{points:,} points in {len(value.clouds)} scan file{'s' if len(value.clouds) > 1 else ''}."


class BIMVERIFY_OT_remove_scan(bpy.types.Operator):
    """Take the active scan out of the campaign, with its cloud; the file stays."""

    bl_idname = "bim_verify.remove_scan"
    bl_label = "Remove Scan"
    bl_description = "Take the active scan out of the campaign, with its cloud; the file on disk stays"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        settings = context.scene.bim_verify
        if not 0 <= settings.scan_index < len(settings.scans):
            cls.poll_message_set("Add a scan first")
            return False
        return idle(cls)

    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.bim_verify
        scene.remove_scan(context.scene, settings.scans[settings.scan_index].path)
        settings.scans.remove(settings.scan_index)
        settings.scan_index = min(settings.scan_index, len(settings.scans) - 1)
        return {"FINISHED"}
