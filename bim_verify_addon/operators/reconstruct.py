"""A building model from the scans."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import bpy
import numpy as np
from bpy.props import BoolProperty
from numpy.typing import NDArray

from ...core.errors import BimVerifyError
from ...core.files import all_or_none
from ...core.options import ReconstructOptions
from ...core.progress import Progress
from .. import bonsai, inputs, project
from ..jobs import Work
from ..shared_settings import IfcToWrite, KnownRegistration, ReconstructOutputs
from .file_browser import FileJob, has_scans, idle, named
from .import_ifc import adopt_model

if TYPE_CHECKING:
    from ...core.model.elements import BuildingModel


@dataclass(frozen=True)
class Made:
    """The file that was written, in words and, if it is to be shown, as a model."""

    path: Path
    summary: str
    notes: list[str]
    model: BuildingModel | None
    placement: NDArray[np.float64]
    """(4, 4) of the scans in the frame of that model."""


class BIMVERIFY_OT_reconstruct(IfcToWrite, KnownRegistration, ReconstructOutputs, FileJob[Made], bpy.types.Operator):
    """Make an IFC model of what was scanned from inside: storeys, rooms, walls, openings, columns, slabs."""

    bl_idname = "bim_verify.reconstruct"
    bl_label = "Reconstruct"
    bl_description = "Make an IFC4 model from the scans: storeys, rooms, walls, doors, windows, columns, slabs"
    bl_options = {"REGISTER", "UNDO"}
    title = "Reconstruct"
    panel_settings = (
        "bim_verify_reconstruct", "with_report", *ReconstructOutputs.__annotations__, *KnownRegistration.__annotations__
    )

    show: BoolProperty(
        name="Take as the model",
        default=True,
        description="Import what was made as the model of this scene; an earlier one leaves the scene, its file stays",
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_scans(cls, context) and idle(cls)

    def proposed(self, context: bpy.types.Context) -> Path:
        first = Path(project.scan_paths(context.scene.bim_verify)[0])
        return first.with_name(f"{first.stem}_reconstructed.ifc")

    def prepare(self, context: bpy.types.Context) -> Work[Made]:
        from ...core import jobs
        from ...core.dimensions.table import write_dimensions
        from ...core.reconstruction.compare import compare, comparison_lines
        from ...core.reconstruction.dimensions import dimension_rows
        from ...core.reconstruction.report import write_reconstruction_report
        from ...core.reconstruction.shapes import read_shapes, shapes_of
        from ...core.reconstruction.summary import summary_lines
        from ...core.reconstruction.write_ifc import write_building_file, written_building

        settings = context.scene.bim_verify
        if not self.filepath:
            raise BimVerifyError("No file name was given. Choose where to write the IFC file.")
        path, paths = named(self.filepath, ".ifc"), project.scan_paths(settings)
        compared = bpy.path.abspath(self.reference) if self.reference else ""
        inputs.refuse(path, beside=[compared])
        common = project.options(settings)
        options = ReconstructOptions(
            sigma=common.sigma, registration_sigma=self.known_sigma(),
            scan_frame=common.scan_frame, origin=common.origin, threads=common.threads,
            memory_gb=common.memory_gb,
        )
        show = self.show and bonsai.live_file() is None

        report = self.report_folder(path)
        table = path.with_name(f"{path.stem}_dimensions.csv") if self.with_dimensions else None

        def work(progress: Progress) -> Made:
            reference = read_shapes(compared) if compared else None
            found = jobs.reconstruct(paths, options, progress.part(0.0, 0.9))
            building, ids = written_building(found)
            first, *notes = summary_lines(found)
            comparison = None
            if reference is not None:
                comparison = compare(shapes_of(building, str(path)), reference)
                notes += comparison_lines(comparison)
            loaded = None
            if show:
                progress.update(0.9, "Reading the model")
                loaded = replace(project.model_of(building), path=str(path))
            with all_or_none():
                write_building_file(path, building)
                if table is not None:
                    write_dimensions(table, dimension_rows(found, ids))
                    notes.append(f"Dimensions: {table}")
                if report is not None:
                    write_reconstruction_report(report, found, comparison)
                    notes.append(f"Report: {report}")
                progress.check()
            return Made(path, first, notes, loaded, project.placement(loaded, paths, common))

        return work

    def finish(self, context: bpy.types.Context, value: Made) -> str:
        if value.model is not None:
            adopt_model(context, value.model, value.placement)
        context.scene.bim_verify_reconstruct.summary = value.summary
        for note in value.notes:
            self.report({"INFO"}, note)
        return f"{value.summary} Written: {value.path}"
