"""Voxels of a comparison in the scene, and what is left of elements that stand in part: both are made of whole voxels."""

from __future__ import annotations

from collections.abc import Collection

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.change.results import CONFIRMED, DISAPPEARED, NEW, UNKNOWN, ChangeResult
from ..core.report.palette import CHANGE_COLORS, VOXEL_COLORS, to_linear
from . import frame, materials, scene
from .point_display import show_as_voxels

VOXELS = "Voxels"
VOXEL_KEY = "bim_verify_voxels"
STATE = "bv_state"
REMAINING = "Remaining"
REMAINING_KEY = "bim_verify_remaining"
"""On a remaining shape: the GlobalId of its element."""
VOLUMES = ("planned_m3", "remaining_m3", "gone_m3")
"""On a remaining shape, where its element is a closed solid."""
MOST_POINTS = 500_000
LIFT = 0.03
"""Voxels are drawn larger by this share of their edge, so that their faces do not lie in those of elements."""
NAMES = {CONFIRMED: "Confirmed", NEW: "New", DISAPPEARED: "Disappeared", UNKNOWN: "Unknown"}


def show_voxels(target: bpy.types.Scene, result: ChangeResult) -> None:
    """New and gone voxels as surfaces; the others as points, hidden at first: they fill the building and the rooms."""
    from ..core.report.voxel_skin import voxel_skin

    remove_voxels(target)
    cloud, points = result.voxels, []
    for code, name in NAMES.items():
        index = cloud.index[cloud.state == code]
        if not len(index):
            continue
        if code in (NEW, DISAPPEARED):
            vertices, quads = voxel_skin(index, np.array(result.anchor), result.edge)
        else:
            index = index[:: max(-(-len(index) // MOST_POINTS), 1)]
            vertices, quads = np.array(result.anchor) + result.edge * (index + 0.5), np.zeros((0, 4), np.int64)
        item = _put(target, VOXELS, f"{VOXELS} {name}", vertices, quads, result.edge, VOXEL_COLORS[code])
        item[VOXEL_KEY] = code
        scene.set_attribute(item.data, STATE, "INT", np.full(len(vertices), code, np.int32))
        if not len(quads):
            show_as_voxels(item, result.edge)
            points.append(item)
    bpy.context.view_layer.update()  # until then it does not know the new objects
    for item in points:
        item.hide_render = True
        if item.name in bpy.context.view_layer.objects:
            item.hide_set(True)


def show_remaining(target: bpy.types.Scene, result: ChangeResult, only: Collection[str] | None = None) -> None:
    """A surface for what is left of each element (of the GlobalIds ``only``) that stands in part, at its place, in the colour
    of its state; those of an earlier comparison are removed."""
    from ..core.report.remaining import Shape, shape_mesh

    remove_remaining(target, only)
    for row in result.remaining:
        found, shape = result.elements[row], Shape.of(result, row)
        if (only is not None and found.global_id not in only) or not shape.left.any():
            continue
        name = f"{scene.object_name(result.model.elements[row])} remaining"
        item = _put(target, REMAINING, name, *shape_mesh(result, shape), result.edge, CHANGE_COLORS[found.state])
        item[REMAINING_KEY] = found.global_id
        if found.volume:
            for key, share in zip(VOLUMES, (1.0, shape.share, 1.0 - shape.share), strict=True):
                item[key] = share * found.volume


def remove_voxels(target: bpy.types.Scene) -> None:
    """Take all voxels away."""
    scene.remove(*(item for item in target.objects if VOXEL_KEY in item))


def remove_remaining(target: bpy.types.Scene, only: Collection[str] | None = None) -> None:
    """Take the remaining shapes away; ``only`` those of elements with these GlobalIds."""
    shapes = [item for item in target.objects if REMAINING_KEY in item]
    scene.remove(*(item for item in shapes if only is None or item[REMAINING_KEY] in only))


def hide_what_changed(target: bpy.types.Scene, hidden: bool) -> None:
    """Hide or show new and gone voxels and remaining shapes: they are those of the last epoch."""
    here = bpy.context.view_layer.objects
    for item in target.objects:
        if (item.get(VOXEL_KEY) in (NEW, DISAPPEARED) or REMAINING_KEY in item) and item.name in here:
            item.hide_set(hidden)


def _put(
    target: bpy.types.Scene, folder: str, name: str, vertices: NDArray[np.float64], quads: NDArray[np.int64], edge: float,
    srgb: NDArray[np.float64] | tuple[float, float, float],
) -> bpy.types.Object:
    """A new object of faces of voxels, or of points where there are no ``quads`` (Q, 4), in one colour."""
    if len(quads):
        vertices = vertices + LIFT * edge * _outward(vertices, quads)
    middle = np.round(vertices.mean(axis=0))
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata((vertices - middle).tolist(), [], quads.tolist())
    rgba = np.ones((len(vertices), 4), np.float32)
    rgba[:, :3] = to_linear(np.array(srgb))
    scene.set_attribute(mesh, scene.COLOR, "FLOAT_COLOR", rgba)
    scene.make_active_color(mesh)
    mesh.update_tag()
    item = bpy.data.objects.new(name, mesh)
    if len(quads):
        mesh.materials.append(materials.surface_material(scene.COLOR))
    item[frame.ORIGIN_KEY] = [float(v) for v in middle]
    frame.place(item, frame.stored(target) or frame.ViewFrame())
    scene.collection(target, folder).objects.link(item)
    return item


def _outward(vertices: NDArray[np.float64], quads: NDArray[np.int64]) -> NDArray[np.float64]:
    """(V, 3) the directions that the quads around each vertex face."""
    corner = vertices[quads]
    normal = np.sign(np.round(np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1]), 12))
    total = np.stack([
        np.bincount(quads.ravel(), weights=np.repeat(normal[:, axis], 4), minlength=len(vertices)) for axis in range(3)
    ], axis=1)
    return np.sign(total)
