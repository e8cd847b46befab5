"""Photos of a model with known truth, rendered in Blender's Cycles: textures, clutter, lens distortion, noise.

    python scripts/render_photos.py MODEL.ifc --out DIR [--images 6] [--loa 40] [--seed 0]

Writes the images (one that is there is kept), ``cameras.json`` (coarse poses, 15 cm and 1 degree off) and ``truth.json``
(the exact ones). The building is not built as planned: every element stands off by the sigma of its level of accuracy.
Needs the ``bpy`` module.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from blender_lens import photograph, place_camera, save
from headless_entry import package
from numpy.typing import NDArray

PACKAGE = package()

from bim_verify.core.imagery.camera import Camera, Interior  # noqa: E402
from bim_verify.core.imagery.cameras_file import FORMAT, camera_to_plain  # noqa: E402
from bim_verify.core.model.elements import BuildingModel  # noqa: E402
from bim_verify.core.model.load import load_model  # noqa: E402
from bim_verify.core.sensing.loa import level_sigma  # noqa: E402
from bim_verify.core.simulation.campaign import place_props  # noqa: E402
from bim_verify.core.simulation.photo import view_points  # noqa: E402
from bim_verify.core.simulation.scene import build_scene  # noqa: E402

DISTORTION = (-0.12, 0.03, 0.0006, -0.0004, 0.0)
"""Of a usual wide-angle lens: 30 pixels in the corners of the image."""
MARGIN = 1.2
"""How much wider the ideal picture is rendered, so that the distorted one has no empty corners."""
FLASH_W, FLASH_ABOVE_M = 500.0, 0.25

Array = NDArray[np.float64]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--images", type=int, default=6)
    parser.add_argument("--loa", type=int, default=40, choices=(10, 20, 30, 40, 50))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--samples", type=int, default=8, help="light paths per pixel, before denoising")
    parser.add_argument("--width", type=int, default=1280)
    parser.add_argument("--clutter", type=int, default=8)
    parser.add_argument("--position-sigma", type=float, default=0.15, help="of the coarse poses, metres per axis")
    parser.add_argument("--rotation-sigma", type=float, default=1.0, help="of the coarse poses, degrees per axis")
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None)
    options.out.mkdir(parents=True, exist_ok=True)
    model = load_model(options.model)
    rng = np.random.default_rng((options.seed, 11))
    lens = Interior(
        options.width, options.width * 3 // 4, 0.72 * options.width, 0.72 * options.width,
        (options.width - 1) / 2 + 4.0, (options.width * 3 // 4 - 1) / 2 - 3.0, DISTORTION,
    )
    cameras = view_points(model, lens, options.images, rng)
    coarse_rng = np.random.default_rng((options.seed, 12))
    coarse = [
        camera.moved(
            np.radians(coarse_rng.normal(0, options.rotation_sigma, 3)), coarse_rng.normal(0, options.position_sigma, 3)
        )
        for camera in cameras
    ]
    sigmas = {"position_sigma_m": options.position_sigma, "rotation_sigma_deg": options.rotation_sigma}
    written: dict[str, Any] = {}
    for name, poses in (("cameras.json", coarse), ("truth.json", cameras)):
        entries = []
        for pose in poses:
            entry = camera_to_plain(pose)
            entry["position"] = (pose.position + model.origin).tolist()
            entries.append(entry)
        written[name] = {"format": FORMAT, "format_version": 1, "frame": "model", **sigmas, "cameras": entries}
    written["truth.json"]["shifts_m"] = build(model, options, rng).tolist()
    for name, content in written.items():
        (options.out / name).write_text(json.dumps(content, indent=1), encoding="ascii")
    for camera in cameras:
        if not (options.out / camera.name).exists():
            picture(camera, options.out / camera.name, rng)
            print(f"{camera.name} rendered", flush=True)


def build(model: BuildingModel, options: argparse.Namespace, rng: np.random.Generator) -> Array:
    """The building as it stands, its clutter and its lamps; how far each element (E, 3) stands off, metres."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = options.samples
    scene.cycles.use_denoising = True
    scene.cycles.max_bounces = 2
    scene.view_settings.view_transform = "Standard"
    materials: dict[str, Any] = {}
    shifts = np.zeros((len(model.elements), 3))
    starts = model.triangle_start
    for row, element in enumerate(model.elements):
        triangles = model.triangles[starts[row] : starts[row + 1]]
        if not len(triangles):
            continue
        used, local = np.unique(triangles, return_inverse=True)
        off = shifts[row] = rng.normal(0, level_sigma(options.loa), 3)
        mesh = bpy.data.meshes.new(element.global_id)
        mesh.from_pydata((model.vertices[used] + off).tolist(), [], local.reshape(-1, 3).tolist())
        glass = model.transparent[starts[row] : starts[row + 1]]
        keys = [f"{element.ifc_class}{element.type_name}", "glass"]
        for key in keys:
            if key not in materials:
                materials[key] = material(key, rng, key == "glass")
            mesh.materials.append(materials[key])
        mesh.polygons.foreach_set("material_index", glass.astype(np.int32))
        scene.collection.objects.link(bpy.data.objects.new(element.global_id, mesh))
    people = options.clutter // 4
    for prop in place_props(model, build_scene(model, {}), seed=options.seed, boxes=options.clutter, people=people):
        corners = prop.corners()
        mesh = bpy.data.meshes.new(prop.name)
        mesh.from_pydata(corners.reshape(-1, 3).tolist(), [], np.arange(3 * len(corners)).reshape(-1, 3).tolist())
        mesh.materials.append(material(prop.name, rng, False))
        scene.collection.objects.link(bpy.data.objects.new(prop.name, mesh))
    world = bpy.data.worlds.new("sky")
    scene.world = world
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs[0].default_value = (0.75, 0.85, 1.0, 1.0)
    world.node_tree.nodes["Background"].inputs[1].default_value = 1.0
    return shifts


def material(key: str, rng: np.random.Generator, glass: bool) -> Any:
    """Paint with grain, bricks with joints, boards with a print, or glass."""
    made = bpy.data.materials.new(key)
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    nodes.clear()
    shader = nodes.new("ShaderNodeBsdfTransparent" if glass else "ShaderNodeBsdfDiffuse")
    links.new(shader.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs[0])
    if glass:
        return made
    base = rng.uniform(0.15, 0.8) * (1.0 - 0.4 * rng.random(3))
    place = nodes.new("ShaderNodeTexCoord")
    kind = "brick" if rng.random() < 0.2 else "noise"
    texture = nodes.new("ShaderNodeTexBrick" if kind == "brick" else "ShaderNodeTexNoise")
    links.new(place.outputs["Object"], texture.inputs["Vector"])
    if kind == "brick":
        texture.inputs["Scale"].default_value = 2.0
        texture.inputs["Color1"].default_value = (*base, 1.0)
        texture.inputs["Color2"].default_value = (*(0.9 * base), 1.0)
        texture.inputs["Mortar"].default_value = (*(0.6 * base), 1.0)
        links.new(texture.outputs["Color"], shader.inputs["Color"])
        return made
    texture.inputs["Scale"].default_value = float(rng.uniform(2.0, 40.0))
    texture.inputs["Detail"].default_value = 2.0
    ramp = nodes.new("ShaderNodeValToRGB")
    ramp.color_ramp.elements[0].color = (*(0.8 * base), 1.0)
    ramp.color_ramp.elements[1].color = (*np.minimum(1.15 * base, 1.0), 1.0)
    links.new(texture.outputs["Fac"], ramp.inputs["Fac"])
    links.new(ramp.outputs["Color"], shader.inputs["Color"])
    return made


def picture(camera: Camera, path: Path, rng: np.random.Generator) -> None:
    """Render the ideal image wide enough, bend it as the lens does, add the sensor's noise."""
    item = place_camera(camera, MARGIN, 0.02)
    lamp_data = bpy.data.lights.new("lamp", "POINT")
    lamp_data.energy, lamp_data.shadow_soft_size = FLASH_W, 0.1
    lamp = bpy.data.objects.new("lamp", lamp_data)
    lamp.location = [float(v) for v in camera.position + FLASH_ABOVE_M * np.array([0.3, 0.2, 1.0])]
    bpy.context.scene.collection.objects.link(lamp)
    save(path, photograph(camera, path), 2.0, rng)
    for thing in (item, lamp):
        bpy.data.objects.remove(thing, do_unlink=True)


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    os._exit(0)
