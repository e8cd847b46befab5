"""From where an object in the scene is seen: the side that the view has already, if nothing stands in between there."""

from __future__ import annotations

import math
from collections.abc import Iterable

import bpy
from mathutils import Vector

AROUND, WELL, NEAREST = 2.2, 1.0, 0.55
"""Distance of the viewer from an element's middle, in sizes of it: with its surroundings; so that no other side need be
looked for; at the least."""
LEAST_SIZE_M = 0.5
SIDES = [(azimuth, elevation) for elevation in (25, 55, -25, 80, -80) for azimuth in range(15, 375, 30)]
"""Degrees."""
PROBES = 0.3
"""Besides the middle, places so far towards the corners of the bounding box are looked at."""
WHOLE, HALF_WIDTH_MM = 1.7, 36.0
"""Distance of the viewer, in those from which a ball around all things fills the width of a view; half the width of what
a view shows at a distance of its focal length."""
PAST_M = 1e-3
BEFORE = 0.97
"""The viewer stands so far towards what comes next."""


def sight(context: bpy.types.Context, item: bpy.types.Object, toward: Vector) -> tuple[Vector, Vector, float]:
    """From which side (unit vector towards the viewer), at which place, from how far [m, Blender's world] to look.

    ``toward``: the side that the view has now; it is kept unless something hides the object there and not elsewhere.
    """
    low, high = bounds([item])
    corners = [item.matrix_world @ Vector(corner) for corner in item.bound_box]
    middle, size = 0.5 * (low + high), max((high - low).length, LEAST_SIZE_M)
    probes = [middle, *(middle + PROBES * (corner - middle) for corner in corners)]
    reach = AROUND * size

    def free(side: Vector) -> float:
        return sum(_free(context, item, probe, side, reach) for probe in probes) / len(probes)

    best = toward
    if free(toward) < WELL * size:
        best = max([toward, *(_side(*angles) for angles in SIDES)], key=free)
    before_the_next = BEFORE * _free(context, item, middle, best, reach)
    return best, middle, min(max(before_the_next, NEAREST * size), reach)


def look_at_all(context: bpy.types.Context, items: Iterable[bpy.types.Object]) -> None:
    """Move each 3D view, as it is turned, so far that it shows these; without a window there is none."""
    if bpy.app.background or context.window is None:
        return
    low, high = bounds(items)
    for area in context.window.screen.areas:
        if area.type == "VIEW_3D":
            space = area.spaces.active
            view, size = space.region_3d, max((high - low).length, LEAST_SIZE_M)
            if view.view_perspective == "CAMERA":
                view.view_perspective = "PERSP"
            view.view_location, view.view_distance = 0.5 * (low + high), WHOLE * 0.5 * size * space.lens / HALF_WIDTH_MM
            space.clip_end = max(space.clip_end, 10.0 * size)


def through_camera(context: bpy.types.Context) -> None:
    """Let each 3D view look through the scene's camera; without a window there is none."""
    if bpy.app.background or context.window is None:
        return
    for area in context.window.screen.areas:
        if area.type == "VIEW_3D":
            area.spaces.active.region_3d.view_perspective = "CAMERA"


def bounds(items: Iterable[bpy.types.Object]) -> tuple[Vector, Vector]:
    """The lowest and the highest corner of a box around objects [m, Blender's world]; of nothing, the origin."""
    corners = [item.matrix_world @ Vector(corner) for item in items for corner in item.bound_box] or [Vector()]
    low, high = (Vector([pick(c[axis] for c in corners) for axis in range(3)]) for pick in (min, max))
    return low, high


def _free(context: bpy.types.Context, item: bpy.types.Object, start: Vector, side: Vector, reach: float) -> float:
    """How far one sees from ``start`` before something other than the object itself, metres, at most ``reach``."""
    depsgraph, gone = context.evaluated_depsgraph_get(), 0.0
    while gone < reach:
        hit, where, _normal, _face, found, _matrix = context.scene.ray_cast(
            depsgraph, start + gone * side, side, distance=reach - gone
        )
        if not hit:
            return reach
        gone += (where - (start + gone * side)).length
        if found.original != item and found.visible_get():
            return gone
        gone += PAST_M
    return reach


def _side(azimuth: float, elevation: float) -> Vector:
    a, e = math.radians(azimuth), math.radians(elevation)
    return Vector((math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)))
