"""From where an object in the scene is seen: the side that the view has already, if nothing stands in between there."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from ..core.exchange.viewpoint import MOST_REACH_M, best_side, free_sight

AROUND = 2.2
"""Distance of the viewer from an element's middle, in sizes of it: with its surroundings."""
LEAST_SIZE_M = 0.5
PLACES = 24
"""So many places on an element are looked at from each side."""
FREE = 0.9
"""The side that the view has is kept when this share of the places that face it is seen."""
WHOLE, HALF_WIDTH_MM = 1.7, 36.0
"""Distance of the viewer, in those from which a ball around all things fills the width of a view; half the width of what
a view shows at a distance of its focal length."""
PAST_M = 1e-3
CLIP_PLANES = 6
"""Of a view; a point is shown that lies on the inner side of all."""


class Sight(NamedTuple):
    """How to look at an object; metres in Blender's world."""

    toward: Vector
    """Unit vector to the viewer."""
    middle: Vector
    distance: float
    """Of the viewer from the middle."""
    begins: float
    """Distance of a plane before the middle: what lies nearer to the viewer hides the object."""


def sight(context: bpy.types.Context, item: bpy.types.Object, toward: Vector) -> Sight:
    """From where to look at an object so that it is seen with its surroundings, in a small room, too.

    ``toward``: the side that the view has now; it is kept unless something hides the object there. Else the side is chosen
    as for the camera of a BCF topic.
    """
    low, high = bounds([item])
    middle, size = 0.5 * (low + high), max((high - low).length, LEAST_SIZE_M)
    place, normal = _places(item)
    at, now = np.array(middle), np.array(toward)

    def free(start: NDArray[np.float64], side: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.array([_free(context, Vector(one), Vector(side), MOST_REACH_M) for one in start])

    distance = AROUND * size
    facing = free_sight(place, normal, at, size, now, lambda start, _: np.full(len(start), np.inf))
    for (reach, seen), (_, whole) in zip(free_sight(place, normal, at, size, now, free), facing, strict=True):
        if distance <= reach and seen > 0 and seen >= FREE * whole:
            return Sight(toward, middle, distance, distance)
    side, begins = best_side(place, normal, at, size, free)
    return Sight(Vector(side), middle, distance, min(begins, distance))


def look_at(context: bpy.types.Context, area: bpy.types.Area, seen: Sight) -> None:
    """Turn a 3D view so; what would hide the object is cut away (*Clipping Region*, Alt B, shows it again)."""
    view = area.spaces.active.region_3d
    if view.view_perspective == "CAMERA":
        view.view_perspective = "PERSP"
    view.view_rotation = seen.toward.to_track_quat("Z", "Y")
    view.view_location, view.view_distance = seen.middle, seen.distance
    view.update()
    region = next(region for region in area.regions if region.type == "WINDOW")
    with context.temp_override(area=area, region=region):
        if _is_cut(view):
            bpy.ops.view3d.clip_border("INVOKE_DEFAULT")  # ends it
        if seen.begins < seen.distance and not view.use_clip_planes:
            bpy.ops.view3d.clip_border(xmin=0, xmax=region.width, ymin=0, ymax=region.height)
            view.clip_planes = [(*-seen.toward, seen.toward.dot(seen.middle) + seen.begins)] * CLIP_PLANES


def is_cut_away(view: bpy.types.RegionView3D, where: Vector) -> bool:
    """Whether a view's clipping hides what is at a place (Blender's world)."""
    return view.use_clip_planes and any(Vector(plane[:3]).dot(where) + plane[3] < 0 for plane in view.clip_planes)


def views(context: bpy.types.Context) -> list[bpy.types.Area]:
    """The 3D views of the window; without a window there is none."""
    if bpy.app.background or context.window is None:
        return []
    return [area for area in context.window.screen.areas if area.type == "VIEW_3D"]


def look_at_all(context: bpy.types.Context, items: Iterable[bpy.types.Object]) -> None:
    """Move each 3D view, as it is turned, so far that it shows these; without a window there is none."""
    low, high = bounds(items)
    size = max((high - low).length, LEAST_SIZE_M)
    for area in views(context):
        space = area.spaces.active
        view = space.region_3d
        if view.view_perspective == "CAMERA":
            view.view_perspective = "PERSP"
        view.view_location, view.view_distance = 0.5 * (low + high), WHOLE * 0.5 * size * space.lens / HALF_WIDTH_MM
        space.clip_end = max(space.clip_end, 10.0 * size)


def through_camera(context: bpy.types.Context) -> None:
    """Let each 3D view look through the scene's camera; without a window there is none."""
    for area in views(context):
        area.spaces.active.region_3d.view_perspective = "CAMERA"


def bounds(items: Iterable[bpy.types.Object]) -> tuple[Vector, Vector]:
    """The lowest and the highest corner of a box around objects [m, Blender's world]; of nothing, the origin."""
    corners = [item.matrix_world @ Vector(corner) for item in items for corner in item.bound_box] or [Vector()]
    low, high = (Vector([pick(c[axis] for c in corners) for axis in range(3)]) for pick in (min, max))
    return low, high


def _is_cut(view: bpy.types.RegionView3D) -> bool:
    """Whether the clipping is one plane of ours, not the box that a person drew."""
    planes = np.array(view.clip_planes)
    return bool(view.use_clip_planes and np.all(planes == planes[0]))


def _places(item: bpy.types.Object) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places (N, 3) on an object's surface and the outward normals (N, 3) there, Blender's world."""
    faces = item.data.polygons
    chosen = range(0, len(faces), max(len(faces) // PLACES, 1))
    turn = item.matrix_world.to_3x3().inverted_safe().transposed()
    place = np.array([item.matrix_world @ faces[k].center for k in chosen]).reshape(-1, 3)
    normal = np.array([(turn @ faces[k].normal).normalized() for k in chosen]).reshape(-1, 3)
    return place, normal


def _free(context: bpy.types.Context, start: Vector, side: Vector, reach: float) -> float:
    """How far one sees from ``start`` before something that is shown, metres; infinity if nothing comes within ``reach``."""
    depsgraph, gone = context.evaluated_depsgraph_get(), 0.0
    while gone < reach:
        hit, where, _normal, _face, found, _matrix = context.scene.ray_cast(
            depsgraph, start + gone * side, side, distance=reach - gone
        )
        if not hit:
            break
        gone += (where - (start + gone * side)).length
        if found.visible_get():
            return gone
        gone += PAST_M
    return math.inf
