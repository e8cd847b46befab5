"""Photos of facades with known truth, rendered in Blender's Cycles: stone and glass, sun, trees, perspective, a real lens.

    python scripts/render_facades.py --out DIR [--images 60] [--first 0] [--size 800]

Writes ``facade_NN.jpg`` and beside it ``facade_NN.json`` with the truth: elements in metres, their types, the homography
from the wall to the image, what is hidden. Those that are there are kept. Needs the ``bpy`` module.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from blender_lens import photograph, place_camera, save
from headless_entry import package
from mathutils import Vector
from mathutils.geometry import tessellate_polygon

PACKAGE = package()

from bim_verify.core.imagery.camera import Camera  # noqa: E402
from bim_verify.core.simulation.facade_photo import arch, street_camera, truth_of  # noqa: E402
from bim_verify.core.simulation.facade_plan import ElementType, FacadePlan, facade_plan  # noqa: E402

MARGIN = 1.06
"""How much wider the ideal picture is rendered, so that the distorted one has no empty corners."""
GRID = 16
"""Pixels between the rays that find what plants hide."""
WALLS = {
    "plaster": ((0.75, 0.68, 0.5), (0.8, 0.78, 0.72), (0.6, 0.42, 0.3), (0.52, 0.55, 0.5), (0.7, 0.5, 0.4)),
    "brick": ((0.35, 0.13, 0.08), (0.42, 0.22, 0.14), (0.5, 0.38, 0.25)),
    "stone": ((0.55, 0.5, 0.4), (0.45, 0.43, 0.4), (0.62, 0.55, 0.45)),
    "concrete": ((0.45, 0.45, 0.44), (0.58, 0.57, 0.54)),
}
FRAMES = ((0.8, 0.8, 0.78), (0.8, 0.8, 0.78), (0.05, 0.05, 0.055), (0.15, 0.08, 0.04), (0.25, 0.27, 0.28))
DOORS = ((0.12, 0.05, 0.025), (0.03, 0.08, 0.05), (0.2, 0.03, 0.03), (0.1, 0.11, 0.13), (0.3, 0.18, 0.08))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--images", type=int, default=60)
    parser.add_argument("--first", type=int, default=0, help="seed of the first")
    parser.add_argument("--size", type=int, default=800, help="pixels along the longer side")
    parser.add_argument("--samples", type=int, default=2, help="light paths per pixel, before denoising")
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None)
    options.out.mkdir(parents=True, exist_ok=True)
    for seed in range(options.first, options.first + options.images):
        image, truth = options.out / f"facade_{seed:02d}.jpg", options.out / f"facade_{seed:02d}.json"
        if image.exists() and truth.exists():
            continue
        plan = facade_plan(seed)
        rng = np.random.default_rng((seed, 32))
        camera = street_camera(plan, options.size, rng)
        plants = Street(plan, rng, options.samples).build()
        data = truth_of(plan, camera)
        hidden, mask = look(plan, camera, plants)
        for entry, share in zip(data["elements"], hidden, strict=True):
            entry["hidden"] = round(share, 3)
        data["vegetation"] = {"step_px": GRID, "rows": ["".join("01"[int(v)] for v in row) for row in mask]}
        picture(camera, image, rng)
        truth.write_text(json.dumps(data), encoding="ascii")
        print(f"{image.name}: {plan.style}, {plan.finish}, {len(plan.elements)} openings", flush=True)


class Street:
    """One facade, what is around it, and the light."""

    def __init__(self, plan: FacadePlan, rng: np.random.Generator, samples: int) -> None:
        self.plan, self.rng = plan, rng
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.scene = bpy.context.scene
        scene = self.scene
        scene.render.engine = "CYCLES"
        scene.cycles.device, scene.cycles.samples, scene.cycles.use_denoising = "CPU", samples, True
        # quicker; the picture differs by about a grey value
        scene.cycles.denoising_prefilter, scene.cycles.denoising_quality = "FAST", "BALANCED"
        scene.cycles.max_bounces, scene.cycles.use_persistent_data = 2, False
        scene.view_settings.view_transform = "Filmic"
        scene.view_settings.look = "Medium High Contrast"
        self.depth = float(rng.uniform(0.08, 0.24))
        """Of the reveals."""

    def pick(self, colors: Any) -> Any:
        return np.array(colors[int(self.rng.integers(len(colors)))]) * self.rng.uniform(0.85, 1.1)

    def build(self) -> list[Any]:
        """Everything; the plants are given back."""
        plan, rng = self.plan, self.rng
        self.light()
        wall_color = self.pick(WALLS[plan.finish])
        self.wall_paint = wall(plan.finish, wall_color, rng)
        base_paint = (
            self.wall_paint
            if plan.base_finish == plan.finish
            else wall(plan.base_finish, self.pick(WALLS[plan.base_finish]), rng)
        )
        self.trim = plain(
            "trim",
            np.minimum(wall_color * rng.uniform(0.7, 1.5), 0.85) if rng.random() < 0.5 else np.array([0.72, 0.7, 0.65]),
            0.8,
        )
        self.frame, self.leaf = plain("frame", self.pick(FRAMES), 0.4), plain("door", self.pick(DOORS), 0.45)
        self.metal = plain("metal", np.array([0.06, 0.06, 0.06]), 0.5)
        split = plan.levels[1] - 0.15 if plan.base_finish != plan.finish else None
        self.front(base_paint, split)
        looks = [self.glass(k) for k in range(4)]
        for element in plan.elements:
            self.opening(element.x, element.z, plan.types[element.type], looks)
        w, h = plan.width, plan.height
        for level in plan.courses:
            self.box(0.0, w, -0.06, 0.02, level, level + 0.16, self.trim)
        if plan.cornice:
            self.box(-0.05, w + 0.05, -0.28, 0.0, h - 0.12, h, self.trim)
            self.box(-0.03, w + 0.03, -0.14, 0.0, h - 0.26, h - 0.12, self.trim)
        else:
            self.box(-0.02, w + 0.02, -0.05, 0.02, h - 0.06, h, self.metal)
        self.box(0.0, w, 6.0, 6.2, 0.0, h, self.wall_paint)
        for x in (0.0, w):
            self.box(x - 0.001, x + 0.001, 0.3, 6.0, 0.0, h, self.wall_paint)
        if rng.random() < 0.5:
            roof = plain("roof", np.array([0.22, 0.09, 0.06]) if rng.random() < 0.5 else np.array([0.1, 0.1, 0.11]), 0.8)
            self.mesh(
                "roof", [(-0.1, -0.2, h), (w + 0.1, -0.2, h), (w + 0.1, 4.0, h + 3), (-0.1, 4.0, h + 3)], [(0, 1, 2, 3)], roof
            )
        self.around()
        return self.plants()

    def light(self) -> None:
        rng = self.rng
        overcast = rng.random() < 0.25
        world = bpy.data.worlds.new("sky")
        self.scene.world = world
        world.use_nodes = True
        world.cycles.sampling_method = "NONE"
        nodes, links = world.node_tree.nodes, world.node_tree.links
        background = nodes["Background"]
        place, split, ramp = (
            nodes.new("ShaderNodeTexCoord"),
            nodes.new("ShaderNodeSeparateXYZ"),
            nodes.new("ShaderNodeValToRGB"),
        )
        clouds, mix = nodes.new("ShaderNodeTexNoise"), nodes.new("ShaderNodeMixRGB")
        links.new(place.outputs["Generated"], split.inputs[0])
        links.new(split.outputs["Z"], ramp.inputs["Fac"])
        low, high = ((0.75, 0.77, 0.8), (0.6, 0.63, 0.68)) if overcast else ((0.6, 0.72, 0.85), (0.16, 0.34, 0.7))
        ramp.color_ramp.elements[0].color, ramp.color_ramp.elements[1].color = (*low, 1.0), (*high, 1.0)
        links.new(place.outputs["Generated"], clouds.inputs["Vector"])
        clouds.inputs["Scale"].default_value, clouds.inputs["Detail"].default_value = 3.0, 3.0
        contrast = nodes.new("ShaderNodeValToRGB")
        contrast.color_ramp.elements[0].position, contrast.color_ramp.elements[1].position = 0.5, 0.75
        links.new(clouds.outputs["Fac"], contrast.inputs["Fac"])
        links.new(contrast.outputs["Color"], mix.inputs["Fac"])
        links.new(ramp.outputs["Color"], mix.inputs[1])
        mix.inputs[2].default_value = (0.9, 0.9, 0.92, 1.0)
        links.new(mix.outputs["Color"], background.inputs[0])
        background.inputs[1].default_value = 1.1 if overcast else 0.75
        if not overcast:
            data = bpy.data.lights.new("sun", "SUN")
            data.energy, data.angle, data.color = float(rng.uniform(2.0, 4.0)), 0.01, (1.0, 0.93, 0.82)
            item = bpy.data.objects.new("sun", data)
            item.rotation_euler = (math.radians(rng.uniform(30, 65)), 0.0, math.radians(rng.uniform(-65, 65)))
            self.scene.collection.objects.link(item)

    def mesh(self, name: str, vertices: Any, faces: Any, paint: Any) -> Any:
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata([tuple(float(c) for c in v) for v in vertices], [], [tuple(int(i) for i in f) for f in faces])
        mesh.materials.append(paint)
        item = bpy.data.objects.new(name, mesh)
        self.scene.collection.objects.link(item)
        return item

    def box(self, x0: float, x1: float, y0: float, y1: float, z0: float, z1: float, paint: Any) -> Any:
        corners = [(x, y, z) for x in (x0, x1) for y in (y0, y1) for z in (z0, z1)]
        faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        return self.mesh("box", corners, faces, paint)

    def front(self, base_paint: Any, split: float | None) -> None:
        """The wall's face with its holes and their reveals; below ``split`` it has the paint of the ground floor."""
        plan = self.plan
        parts = [(0.0, plan.height, self.wall_paint)]
        if split is not None:
            parts = [(0.0, split, base_paint), (split, plan.height, self.wall_paint)]
        for low, high, paint in parts:
            outline = [(0.0, low), (plan.width, low), (plan.width, high), (0.0, high)]
            rings = [outline]
            for element in plan.elements:
                if low <= element.z + 0.01 < high:
                    ring = arch(plan.types[element.type], 0.0)
                    rings.append([(element.x + x, max(element.z + z, low + 0.002)) for x, z in ring])
            points = [p for ring in rings for p in ring]
            faces = tessellate_polygon([[Vector((x, z, 0.0)) for x, z in ring] for ring in rings])
            self.mesh("wall", [(x, 0.0, z) for x, z in points], faces, paint)
            for ring in rings[1:]:
                n = len(ring)
                vertices = [(x, 0.0, z) for x, z in ring] + [(x, self.depth + 0.1, z) for x, z in ring]
                self.mesh("reveal", vertices, [(k, (k + 1) % n, n + (k + 1) % n, n + k) for k in range(n)], paint)

    def glass(self, number: int) -> Any:
        """A pane over a room that is dark, or has curtains."""
        rng = self.rng
        made = bpy.data.materials.new(f"glass {number}")
        made.use_nodes = True
        nodes, links = made.node_tree.nodes, made.node_tree.links
        shader = nodes["Principled BSDF"]
        shader.inputs["Roughness"].default_value = 0.02
        shader.inputs["IOR"].default_value = float(rng.uniform(1.5, 2.1))
        place, noise, ramp = nodes.new("ShaderNodeTexCoord"), nodes.new("ShaderNodeTexNoise"), nodes.new("ShaderNodeValToRGB")
        links.new(place.outputs["Object"], noise.inputs["Vector"])
        noise.inputs["Scale"].default_value = 0.8
        dark = rng.uniform(0.004, 0.03)
        light = (0.02, 0.04, 0.1, 0.25)[number] * rng.uniform(0.7, 1.3)
        ramp.color_ramp.elements[0].color = (dark, dark, 1.1 * dark, 1.0)
        ramp.color_ramp.elements[1].color = (light, light, 0.95 * light, 1.0)
        links.new(noise.outputs["Fac"], ramp.inputs["Fac"])
        links.new(ramp.outputs["Color"], shader.inputs["Base Color"])
        return made

    def opening(self, x: float, z: float, kind: ElementType, looks: list[Any]) -> None:
        rng, y, w, h = self.rng, self.depth, kind.width, kind.height
        pane = looks[int(rng.choice(4, p=[0.45, 0.3, 0.15, 0.1]))]
        if kind.kind == "door" and not kind.glazed:
            pane = self.leaf
        ring = arch(kind, 0.0)
        self.mesh("pane", [(x + a, y + 0.035, z + b) for a, b in ring], [tuple(range(len(ring)))], pane)
        if pane is not self.leaf and rng.random() < 0.35:
            drop = h * rng.uniform(0.15, 0.6)
            cloth = plain("blind", self.pick(((0.7, 0.7, 0.66), (0.6, 0.5, 0.4), (0.4, 0.42, 0.45))), 0.9)
            if kind.rise == 0:
                self.box(x + 0.06, x + w - 0.06, y + 0.02, y + 0.034, z + h - drop, z + h - 0.06, cloth)
        self.strip(x, y, z, ring, arch(kind, 0.065), self.frame if kind.kind == "window" or kind.glazed else self.leaf, 0.05)
        bar = 0.06
        paint = self.frame if pane is not self.leaf else self.metal
        top = h - kind.rise if kind.rise and kind.rise < 0.3 * w else h - 0.03
        for k in range(1, kind.casements):
            middle = x + w * k / kind.casements
            high = top if kind.rise == 0 or abs(middle - x - w / 2) < 0.05 else h - kind.rise
            self.box(middle - bar / 2, middle + bar / 2, y - 0.01, y + 0.04, z + 0.02, z + high, paint)
        if kind.transom:
            self.box(x + 0.02, x + w - 0.02, y - 0.012, y + 0.04, z + h - kind.transom - bar, z + h - kind.transom, paint)
        elif kind.rise:
            self.box(x + 0.02, x + w - 0.02, y - 0.012, y + 0.04, z + h - kind.rise - bar, z + h - kind.rise, paint)
        if kind.kind == "door":
            self.box(x - 0.02, x + w + 0.02, -0.1, y + 0.05, 0.0, 0.04, self.trim)
            if not kind.glazed:
                for a in range(kind.casements):
                    left, wide = x + w * a / kind.casements + 0.16, w / kind.casements - 0.32
                    for low, high in ((0.2, 0.85), (1.0, 1.9)):
                        self.box(left, left + wide, y + 0.01, y + 0.036, z + low, z + high, self.leaf)
            self.box(x + 0.82 * w, x + 0.82 * w + 0.03, y - 0.05, y + 0.03, 1.0, 1.15, self.metal)
        elif self.plan.sills and kind.kind == "window":
            self.box(x - 0.07 - kind.surround, x + w + 0.07 + kind.surround, -0.07, y, z - 0.06, z, self.trim)
        if kind.surround:
            outer = arch(kind, -kind.surround)
            if kind.kind == "door":
                outer = [(a, max(b, 0.0)) for a, b in outer]
            self.strip(x, -0.03, z, outer, ring, self.trim, 0.03)
        if kind.railing:
            self.box(x - 0.05, x + w + 0.05, -0.14, -0.11, z + 0.95, z + 0.99, self.metal)
            for a in np.arange(x, x + w + 0.01, 0.12):
                self.box(a - 0.008, a + 0.008, -0.135, -0.119, z + 0.02, z + 0.97, self.metal)

    def strip(self, x: float, y: float, z: float, outer: Any, inner: Any, paint: Any, deep: float) -> None:
        """Between two rings, extruded."""
        n = len(outer)
        vertices = [(x + a, y, z + b) for a, b in outer] + [(x + a, y, z + b) for a, b in inner]
        vertices += [(a, b + deep, c) for a, b, c in vertices]
        faces = []
        for k in range(n):
            j = (k + 1) % n
            faces += [(k, j, n + j, n + k), (n + k, n + j, 3 * n + j, 3 * n + k), (k, 2 * n + k, 2 * n + j, j)]
        self.mesh("strip", vertices, faces, paint)

    def around(self) -> None:
        """Street, pavement, neighbours, and houses opposite that the panes reflect."""
        rng, w = self.rng, self.plan.width
        asphalt = grain("asphalt", np.array([0.09, 0.09, 0.095]), 6.0)
        stones = wall("stone", np.array([0.32, 0.31, 0.3]), rng, flat=True)
        self.mesh(
            "street", [(-80, -90, -0.12), (w + 80, -90, -0.12), (w + 80, 30, -0.12), (-80, 30, -0.12)], [(0, 1, 2, 3)], asphalt
        )
        self.box(-80, w + 80, -rng.uniform(2.5, 4.0), 0.3, -0.2, 0.0, stones)
        if rng.random() < 0.6:
            for side in (-1, 1):
                if rng.random() < 0.6:
                    high = self.plan.height * rng.uniform(0.5, 1.25)
                    back = rng.uniform(0.3, 3.0)
                    finish = str(rng.choice(list(WALLS)))
                    gap = rng.uniform(0.0, 2.5)
                    x0, x1 = (-20.0, -gap) if side < 0 else (w + gap, w + 20.0)
                    self.box(x0, x1, back, 8.0, 0.0, high, wall(finish, self.pick(WALLS[finish]), rng))
        for k in range(-3, 6):
            finish = str(rng.choice(list(WALLS)))
            x = w / 2 + (k - 1) * 14 + rng.uniform(-2, 2)
            house = self.box(x, x + 12.5, -62, -58, 0, rng.uniform(6, 17), wall(finish, self.pick(WALLS[finish]), rng))
            house.visible_shadow = False
        if rng.random() < 0.4:
            x = float(rng.choice([0.12, w - 0.12]))
            self.box(x - 0.05, x + 0.05, -0.13, -0.03, 0.0, self.plan.height - 0.2, self.metal)
        if rng.random() < 0.4:
            x = rng.uniform(0, w)
            self.box(x - 0.05, x + 0.05, -2.6, -2.5, 0.0, 5.5, self.metal)
        if rng.random() < 0.35:
            x, color = rng.uniform(-1, w - 2), plain("car", rng.uniform(0.05, 0.5, 3), 0.2)
            self.box(x, x + 4.2, -6.2, -4.5, 0.1, 0.75, color)
            self.box(x + 0.8, x + 3.4, -6.1, -4.6, 0.75, 1.35, color)

    def plants(self) -> list[Any]:
        """Trees and bushes before the wall: clouds of leaves on trunks."""
        rng, plan, made = self.rng, self.plan, []
        trunk = grain("bark", np.array([0.12, 0.08, 0.05]), 15.0)
        for _ in range(int(rng.choice([0, 1, 2, 3], p=[0.3, 0.35, 0.25, 0.1]))):
            green = np.array([rng.uniform(0.04, 0.1), rng.uniform(0.1, 0.2), 0.025])
            leaves = grain("leaves", green, 2.0)
            x, y = rng.uniform(0.0, plan.width), -rng.uniform(1.8, 3.5)
            if rng.random() < 0.4:
                size, middle = np.array([rng.uniform(0.5, 1.2), 0.5, rng.uniform(0.4, 0.7)]), np.array([x, y + 1.0, 0.5])
            else:
                size = np.array([rng.uniform(0.8, 1.6), rng.uniform(0.8, 1.4), rng.uniform(1.0, 1.8)])
                middle = np.array([x, y, rng.uniform(2.8, 4.0) + 0.5 * size[2]])
                made.append(self.box(x - 0.09, x + 0.09, y - 0.09, y + 0.09, 0, middle[2], trunk))
            count = int(1500 * size.prod() ** 0.67)
            place = rng.normal(0, 1, (count, 3))
            place *= (rng.random((count, 1)) ** 0.4) / np.linalg.norm(place, axis=1, keepdims=True)
            lumps = rng.uniform(-0.6, 0.6, (8, 3))
            near = np.linalg.norm(place[:, None] - lumps, axis=2).min(axis=1) < 0.55
            place = middle + place[near] * size
            a, b = rng.normal(0, 1, (2, len(place), 3))
            a /= np.linalg.norm(a, axis=1, keepdims=True)
            b = np.cross(a, b)
            b /= np.linalg.norm(b, axis=1, keepdims=True)
            quads = (place[:, None] + 0.07 * np.stack([a, b, -a, -b], axis=1)).reshape(-1, 3)
            made.append(self.mesh("leaves", quads, np.arange(len(quads)).reshape(-1, 4), leaves))
        return made


def plain(name: str, color: Any, roughness: float) -> Any:
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    shader = made.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*[float(c) for c in color], 1.0)
    shader.inputs["Roughness"].default_value = roughness
    return made


def grain(name: str, color: Any, scale: float) -> Any:
    """One colour, patchy."""
    made = plain(name, color, 0.85)
    nodes, links = made.node_tree.nodes, made.node_tree.links
    stain(nodes, links, nodes["Principled BSDF"], None, color, scale)
    return made


def stain(nodes: Any, links: Any, shader: Any, under: Any, color: Any, scale: float, strong: float = 0.4) -> None:
    place, noise, mix = nodes.new("ShaderNodeTexCoord"), nodes.new("ShaderNodeTexNoise"), nodes.new("ShaderNodeMixRGB")
    links.new(place.outputs["Object"], noise.inputs["Vector"])
    noise.inputs["Scale"].default_value, noise.inputs["Detail"].default_value = scale, 3.0
    mix.blend_type = "MULTIPLY"
    mix.inputs["Fac"].default_value = strong
    if under is None:
        mix.inputs[1].default_value = (*[float(min(1.25 * c, 1.0)) for c in color], 1.0)
    else:
        links.new(under, mix.inputs[1])
    links.new(noise.outputs["Fac"], mix.inputs[2])
    links.new(mix.outputs["Color"], shader.inputs["Base Color"])


def wall(finish: str, color: Any, rng: np.random.Generator, flat: bool = False) -> Any:
    """Plaster with stains, bricks, ashlar or slabs of concrete."""
    made = plain(finish, color, 0.9)
    nodes, links = made.node_tree.nodes, made.node_tree.links
    shader = nodes["Principled BSDF"]
    if finish == "plaster":
        stain(nodes, links, shader, None, color, float(rng.uniform(0.4, 3.0)), float(rng.uniform(0.2, 0.5)))
        return made
    wide, high, joint = {
        "brick": (0.24, 0.075, 0.01),
        "stone": (rng.uniform(0.5, 0.9), rng.uniform(0.25, 0.4), 0.008),
        "concrete": (3.0, 1.4, 0.015),
    }[finish]
    place, turn, texture = nodes.new("ShaderNodeTexCoord"), nodes.new("ShaderNodeMapping"), nodes.new("ShaderNodeTexBrick")
    turn.vector_type = "POINT"
    if not flat:
        turn.inputs["Rotation"].default_value = (-math.pi / 2, 0.0, 0.0)
    links.new(place.outputs["Object"], turn.inputs["Vector"])
    links.new(turn.outputs["Vector"], texture.inputs["Vector"])
    for name, value in (("Scale", 1.0), ("Brick Width", wide), ("Row Height", high), ("Mortar Size", joint), ("Bias", 0.0)):
        texture.inputs[name].default_value = float(value)
    spread = 0.25 if finish == "brick" else 0.1
    light = np.minimum(color * (1 + spread), 1.0)
    texture.inputs["Color1"].default_value = (*[float(c) for c in light], 1.0)
    texture.inputs["Color2"].default_value = (*[float(c) for c in color * (1 - spread)], 1.0)
    mortar = np.array([0.5, 0.48, 0.44]) if finish == "brick" and rng.random() < 0.6 else 0.55 * color
    texture.inputs["Mortar"].default_value = (*[float(c) for c in mortar], 1.0)
    stain(nodes, links, shader, texture.outputs["Color"], color, 1.0, 0.3)
    return made


def look(plan: FacadePlan, camera: Camera, plants: list[Any]) -> tuple[list[float], Any]:
    """Per element the share that something before the wall hides; where plants are, every ``GRID`` pixels."""
    bpy.context.view_layer.update()
    graph = bpy.context.evaluated_depsgraph_get()
    eye = Vector([float(v) for v in camera.position])
    names = {item.name for item in plants}
    hidden = []
    for element in plan.elements:
        kind, count = plan.types[element.type], 0
        steps = (np.arange(8) + 0.5) / 8
        for a in steps:
            for b in steps:
                target = Vector((element.x + a * kind.width, 0.0, element.z + b * kind.height))
                way = target - eye
                hit, *_ = bpy.context.scene.ray_cast(graph, eye, way.normalized(), distance=max(way.length - 0.4, 0.1))
                count += bool(hit)
        hidden.append(count / 64)
    lens = camera.interior
    mask = np.zeros((lens.height // GRID, lens.width // GRID), dtype=bool)
    y, x = np.mgrid[: mask.shape[0], : mask.shape[1]]
    pixel = np.column_stack([(x.ravel() + 0.5) * GRID, (y.ravel() + 0.5) * GRID])
    for k, way in enumerate(camera.rays(pixel)):
        hit, _, _, _, item, _ = bpy.context.scene.ray_cast(graph, eye, Vector([float(v) for v in way]))
        mask.flat[k] = bool(hit and item.name in names)
    return hidden, mask


def picture(camera: Camera, path: Path, rng: np.random.Generator) -> None:
    """Render the ideal image wide enough, bend it as the lens does, add the sensor's noise."""
    place_camera(camera, MARGIN, 0.1)
    bpy.context.scene.view_settings.exposure = float(rng.uniform(0.2, 0.9))
    seen = photograph(camera, path)
    save(path, seen, rng.uniform(1.0, 4.0), rng)


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    os._exit(0)
