"""The colours are in a render, too: of elements, of point clouds and of voxels, in Cycles on the processor.

EEVEE needs a graphics card or minutes of emulation, so it is not run here; it shades the same material.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray

from bim_verify.bim_verify_addon import point_display, scene
from bim_verify.core.report import palette
from bim_verify.core.results import VerificationResult

ops = bpy.ops.bim_verify
Verification = Callable[[Callable[..., VerificationResult]], None]
SIZE = 64


def render(found: bpy.types.Scene, toward: tuple[float, float, float], width: float, path: Path) -> NDArray[np.float64]:
    """(SIZE, SIZE, 3) linear, seen from the south through a parallel camera, evenly lit from everywhere."""
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.type, camera.data.ortho_scale = "ORTHO", width
    camera.location = (toward[0], toward[1] - 20.0, toward[2])
    camera.rotation_euler = (np.pi / 2, 0.0, 0.0)
    found.collection.objects.link(camera)
    found.camera = camera
    world = found.world or bpy.data.worlds.new("world")
    found.world = world
    if world.node_tree is None:
        world.use_nodes = True
    world.node_tree.nodes.clear()
    light = world.node_tree.nodes.new("ShaderNodeBackground")
    light.inputs["Strength"].default_value = 1.0
    light.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    output = world.node_tree.nodes.new("ShaderNodeOutputWorld")
    world.node_tree.links.new(light.outputs[0], output.inputs["Surface"])
    found.render.engine = "CYCLES"
    found.cycles.device, found.cycles.samples, found.cycles.use_denoising = "CPU", 16, False
    found.render.resolution_x = found.render.resolution_y = SIZE
    found.render.film_transparent = True
    found.view_settings.view_transform = "Raw"
    found.render.image_settings.file_format, found.render.image_settings.color_depth = "PNG", "16"
    found.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(path))
    image.colorspace_settings.name = "Non-Color"
    pixels = np.array(image.pixels[:]).reshape(SIZE, SIZE, 4)
    assert pixels[..., 3].max() > 0.9, "nothing was drawn"
    return pixels


def hue(rgb: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shares of red, green and blue: what is left when the strength of the light does not count."""
    return rgb / rgb.sum(axis=-1, keepdims=True)


def test_elements_have_the_colour_of_their_verdict(
    blender: bpy.types.Scene, house: Path, scan: Path, result: VerificationResult, verification: Verification, tmp_path: Path
) -> None:
    verification(lambda *_: result)
    blender.bim_verify.display_vertices = 10_000
    ops.import_ifc(filepath=str(house))
    ops.import_scan(filepath=str(scan))
    ops.verify()
    for cloud in scene.scan_objects(blender):
        cloud.hide_render = True
    south = next(o for o in scene.element_objects(blender).values() if o.bim_verify.element_name == "South")
    pixels = render(blender, (2.0, 0.0, 1.3), 1.5, tmp_path / "elements.png")
    expected = hue(palette.to_linear(np.array(palette.STATUS_COLORS[south.bim_verify.status])))
    middle = pixels[SIZE // 4 : -SIZE // 4, SIZE // 4 : -SIZE // 4, :3].mean(axis=(0, 1))
    assert hue(middle) == pytest.approx(expected, abs=0.06)


@pytest.mark.parametrize("kind", ["points", "voxels"])
def test_clouds_have_the_colours_of_their_points(blender: bpy.types.Scene, tmp_path: Path, kind: str) -> None:
    colors = np.array([(0.9, 0.05, 0.05, 1.0), (0.05, 0.05, 0.9, 1.0)])
    mesh = bpy.data.meshes.new("cloud")
    mesh.vertices.add(2)
    mesh.attributes["position"].data.foreach_set("vector", np.array([-0.5, 0, 0, 0.5, 0, 0], dtype=np.float32))
    scene.set_attribute(mesh, scene.COLOR, "FLOAT_COLOR", colors)
    item = bpy.data.objects.new("cloud", mesh)
    blender.collection.objects.link(item)
    if kind == "points":
        point_display.show_as_points(item, 0.8)
    else:
        point_display.show_as_voxels(item, 0.8)
    pixels = render(blender, (0.0, 0.0, 0.0), 2.0, tmp_path / f"{kind}.png")
    for column, color in ((SIZE // 4, colors[0]), (3 * SIZE // 4, colors[1])):
        seen = pixels[SIZE // 2, column]
        assert seen[3] > 0.9
        assert hue(seen[:3]) == pytest.approx(hue(color[:3]), abs=0.08)
