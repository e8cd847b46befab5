"""Colour all elements of a scene by its colour mode. The colours are a mesh attribute: saved, rendered, exported."""

from __future__ import annotations

from collections import Counter

import bpy
import numpy as np

from ..core.report import palette
from . import materials
from . import scene as scenery
from .capabilities import MODES
from .colors import Mode, Surface


def refresh(scene: bpy.types.Scene) -> None:
    """After something new is known of elements: count the classes again and colour."""
    counts, items = scene.bim_verify.counts, scenery.element_objects(scene).values()
    counts.clear()
    for mode in MODES.values():
        if mode.category is None:
            continue
        found = Counter(mode.category(item) for item in items)
        if not any(found[c.identifier] for c in mode.categories):
            continue
        for category in mode.categories:
            entry = counts.add()
            entry.mode, entry.category, entry.count = mode.identifier, category.identifier, found[category.identifier]
    scene.bim_verify.has_findings = any(mode.known(item) for item in items for mode in MODES.values())
    scene.bim_verify.overruled = sum(bool(item.bim_verify.decided_status) for item in items)
    recolor(scene)


def recolor(scene: bpy.types.Scene) -> None:
    """Colour every element from what is stored on it; one that nothing is known of is grey if it was coloured before."""
    scenery.leave_edit_mode(bpy.context)
    mode = MODES[scene.bim_verify.color_mode]
    for item in scenery.element_objects(scene).values():
        if mode.known(item) or scenery.COLOR in item.data.attributes:
            _paint(item, mode, scene)


def _paint(item: bpy.types.Object, mode: Mode, scene: bpy.types.Scene) -> None:
    mesh, surface = item.data, Surface(item)
    color = np.ones((len(surface), 4), dtype=np.float32)
    srgb = mode.color(surface, scene) if mode.known(item) else np.array(palette.UNMEASURED)
    color[:, :3] = palette.to_linear(srgb)
    new = scenery.COLOR not in mesh.attributes
    scenery.set_attribute(mesh, scenery.COLOR, "FLOAT_COLOR", color)
    if new:
        scenery.make_active_color(mesh)
    if not mesh.materials:
        mesh.materials.append(materials.surface_material(scenery.COLOR))
    mesh.update_tag()
