"""Scan the scene itself with a simulated scanner, from the station markers (or the active camera)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, IntProperty, StringProperty

from ...core.errors import BimVerifyError
from ...core.progress import Progress
from .. import frame, inputs, project
from ..jobs import Work
from .file_browser import FileJob, idle
from .plan import SCANNERS

if TYPE_CHECKING:
    from ...core.simulation.scan_scene import WrittenScan


class BIMVERIFY_OT_simulate(FileJob["WrittenScan"], bpy.types.Operator):
    """Scan all visible meshes of the scene and write an E57 file with the truth of every return."""

    bl_idname = "bim_verify.simulate"
    bl_label = "Simulate Scan"
    bl_description = "Scan the visible meshes from the station markers and write an E57 file"
    bl_options = {"REGISTER"}
    title = "Simulate"

    filepath: StringProperty(name="File", subtype="FILE_PATH", description="The E57 file to write")
    filter_glob: StringProperty(default="*.e57", options={"HIDDEN"})
    check_existing: BoolProperty(default=True, options={"HIDDEN"})
    scanner: EnumProperty(name="Scanner", items=SCANNERS[:3], default="fast", description="Preset of the scanner")
    seed: IntProperty(name="Seed", default=0, description="Of the noise")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return idle(cls)

    def proposed(self, context: bpy.types.Context) -> Path:
        return project.folder(context.scene) / "simulated.e57"

    def prepare(self, context: bpy.types.Context) -> Work[WrittenScan]:
        from ...core.simulation.scan_scene import SceneStation, scan_scene
        from ...core.simulation.scanner import PRESETS
        from ...core.simulation.scene import Scene
        from ..scene import SCAN_KEY
        from ..survey_scene import STATION_KEY, station_markers

        if not self.filepath:
            raise BimVerifyError("Name the E57 file to write.")
        path = bpy.path.abspath(self.filepath)
        inputs.refuse(path)
        place = frame.stored(context.scene) or frame.ViewFrame()
        corners, owner, names = [], [], []
        depsgraph = context.evaluated_depsgraph_get()
        for item in context.scene.objects:
            if item.type != "MESH" or not item.visible_get() or SCAN_KEY in item or STATION_KEY in item:
                continue
            evaluated = item.evaluated_get(depsgraph)
            mesh = evaluated.to_mesh()
            mesh.calc_loop_triangles()
            vertices, corner = np.empty(3 * len(mesh.vertices)), np.empty(3 * len(mesh.loop_triangles), dtype=np.int32)
            mesh.vertices.foreach_get("co", vertices)
            mesh.loop_triangles.foreach_get("vertices", corner)
            evaluated.to_mesh_clear()
            matrix = np.array(item.matrix_world)
            world = place.to_model(vertices.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3])
            corners.append(world[corner.reshape(-1, 3)])
            owner.append(np.full(len(corners[-1]), len(names), dtype=np.int32))
            names.append(item.name)
        if not names:
            raise BimVerifyError("The scene shows no mesh that could be scanned.")
        stations = station_markers(context.scene)
        camera = context.scene.camera
        if not stations and camera is not None:
            stations = [(camera.name, place.to_model(np.array(camera.matrix_world.translation)))]
        if not stations:
            raise BimVerifyError("There is no station: plan a scan, import one, or add a camera where the scanner stands.")
        whole = np.concatenate(corners)
        origin = np.round(np.median(whole.reshape(-1, 3), axis=0))
        target = Scene(whole - origin, np.concatenate(owner), names)
        scanner, seed = PRESETS[self.scanner], self.seed

        def work(progress: Progress) -> WrittenScan:
            setups = [SceneStation(name, position - origin) for name, position in stations]
            return scan_scene(target, setups, scanner, path, origin=origin, seed=seed, progress=progress)

        return work

    def finish(self, context: bpy.types.Context, value: WrittenScan) -> str:
        return f"{value.returns:,} returns written to {value.path}"
