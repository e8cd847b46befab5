"""What lies under the mouse in a 3D view: the element, what is known of it, and of the very place that is pointed at.

A gizmo without a shape learns where the mouse is. It is no modal operator, so Esc, undo and automatic saving work as
always, and nothing is drawn again unless the text changes.
"""

from __future__ import annotations

import textwrap
import time
from dataclasses import dataclass, field

import bpy
import numpy as np
from bpy_extras import view3d_utils
from mathutils import Vector

from .capabilities import shown_first
from .known import known_of
from .sight import is_cut_away

LINE_LENGTH = 60
"""Characters."""
MOST_LAYERS = 16
"""Things in front of an element that are looked through: clouds, voxels, station markers."""
PAST_M = 1e-4
"""A ray goes on this far behind what it hit."""
SHARE = 0.2
"""Of the time that may be spent on looking while the mouse moves."""
SHOWN_S = 10.0
"""After this time without a movement the text goes: the mouse may have left the view in one leap."""
EDGE_PX = 6
"""Seen last so close to the border of a view, the mouse has left it."""


@dataclass
class Hover:
    """What is shown beside the mouse."""

    region: int = 0
    """The region it belongs to (its address)."""
    place: tuple[int, int] = (0, 0)
    """Of the mouse in it, pixels."""
    lines: list[str] = field(default_factory=list)
    shown_until: float = 0.0
    """Time (``time.perf_counter``) after which the lines go."""
    rest_until: float = 0.0
    """Time (``time.perf_counter``) before which nothing is looked up."""


HOVER = Hover()


class BIMVERIFY_GT_hover(bpy.types.Gizmo):
    """Has no shape; is told where the mouse is."""

    bl_idname = "BIMVERIFY_GT_hover"

    def draw(self, context: bpy.types.Context) -> None:
        """Nothing."""

    def test_select(self, context: bpy.types.Context, location: tuple[int, int]) -> int:
        """The mouse is at ``location`` of the region; never taken, so clicks go to the view."""
        pointed_at(context, context.area, context.region, (int(location[0]), int(location[1])))
        return -1


class BIMVERIFY_GGT_hover(bpy.types.GizmoGroup):
    """Holds the gizmo in every 3D view while the read-out is wanted."""

    bl_idname = "BIMVERIFY_GGT_hover"
    bl_label = "BIM Verify under the mouse"
    bl_space_type = "VIEW_3D"
    bl_region_type = "WINDOW"
    bl_options = {"PERSISTENT", "SHOW_MODAL_ALL"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        settings = context.scene.bim_verify
        return bool(settings.has_findings and settings.show_hover)

    def setup(self, context: bpy.types.Context) -> None:
        gizmo = self.gizmos.new(BIMVERIFY_GT_hover.bl_idname)
        gizmo.use_draw_modal = True


CLASSES = (BIMVERIFY_GT_hover, BIMVERIFY_GGT_hover)


def forget() -> None:
    """Show nothing until the mouse moves again."""
    HOVER.lines = []
    for timer in (_look_again, _hide):
        if bpy.app.timers.is_registered(timer):
            bpy.app.timers.unregister(timer)


def pointed_at(
    context: bpy.types.Context, area: bpy.types.Area, region: bpy.types.Region, place: tuple[int, int]
) -> None:
    """Look what is there, unless the last look was too recent for its cost; then look a little later."""
    HOVER.region, HOVER.place = region.as_pointer(), place
    now = time.perf_counter()
    if now < HOVER.rest_until:
        if not bpy.app.timers.is_registered(_look_again):
            bpy.app.timers.register(_look_again, first_interval=HOVER.rest_until - now)
        return
    inside = EDGE_PX < place[0] < region.width - EDGE_PX and EDGE_PX < place[1] < region.height - EDGE_PX
    found = _look(context, area, region, place) if inside else []
    took = time.perf_counter() - now
    HOVER.rest_until = now + took / SHARE
    if found or HOVER.lines:
        HOVER.lines, HOVER.shown_until = found, now + SHOWN_S
        region.tag_redraw()
        if not bpy.app.timers.is_registered(_hide):
            bpy.app.timers.register(_hide, first_interval=SHOWN_S)


def _hide() -> float | None:
    """Take the text away when its time is over."""
    left = HOVER.shown_until - time.perf_counter()
    if left > 0 and HOVER.lines:
        return left
    HOVER.lines = []
    if (found := _region()) is not None:
        found[2].tag_redraw()
    return None


def _look_again() -> None:
    """The mouse has come to rest before the last place was looked at."""
    if (found := _region()) is not None:
        window, area, region = found
        with bpy.context.temp_override(window=window, area=area, region=region):
            pointed_at(bpy.context, area, region, HOVER.place)


def _region() -> tuple[bpy.types.Window, bpy.types.Area, bpy.types.Region] | None:
    """The region that the mouse was in, if it is still there."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            for region in area.regions:
                if area.type == "VIEW_3D" and region.as_pointer() == HOVER.region:
                    return window, area, region
    return None


def _look(
    context: bpy.types.Context, area: bpy.types.Area, region: bpy.types.Region, place: tuple[int, int]
) -> list[str]:
    view, space = region.data, area.spaces.active
    origin = view3d_utils.region_2d_to_origin_3d(region, view, place)
    direction = view3d_utils.region_2d_to_vector_3d(region, view, place)
    found = element_on_ray(context, origin, direction, space)
    return [] if found is None else lines(*found)


def element_on_ray(
    context: bpy.types.Context, origin: Vector, direction: Vector, space: bpy.types.SpaceView3D | None = None
) -> tuple[bpy.types.Object, int] | None:
    """The first visible element that anything is known of, and its vertex nearest to where the ray meets it.

    ``origin``, ``direction``: in Blender's world. The vertex is -1 where the ray met one of Bonsai's objects.
    """
    depsgraph = context.evaluated_depsgraph_get()
    start = Vector(origin)
    for _ in range(MOST_LAYERS):
        hit, where, _normal, face, item, matrix = context.scene.ray_cast(depsgraph, start, direction)
        if not hit:
            return None
        item = item.original if item is not None else None
        if space is not None and is_cut_away(space.region_3d, where):
            item = None
        element = known_of(context, item) if item is not None and item.visible_get(viewport=space) else None
        if element is not None:
            return element, _nearest_vertex(item, face, matrix.inverted() @ where) if element == item else -1
        start = where + PAST_M * direction
    return None


def _nearest_vertex(item: bpy.types.Object, face: int, where: Vector) -> int:
    mesh = item.data
    if not 0 <= face < len(mesh.polygons):
        return -1
    corner = list(mesh.polygons[face].vertices)
    return int(corner[int(np.argmin([(mesh.vertices[v].co - where).length_squared for v in corner]))])


def lines(item: bpy.types.Object, vertex: int) -> list[str]:
    """Which element, what the capability of the colours shown says of it in short, and a line of each other one."""
    stored = item.bim_verify
    said = [f"{stored.ifc_class}  {stored.element_name or 'unnamed'}"]
    whole = True
    for capability in shown_first(bpy.context.scene.bim_verify.color_mode):
        if capability.brief is not None and (brief := capability.brief(item, vertex)):
            for line in brief if whole else brief[:1]:
                said += textwrap.wrap(line, LINE_LENGTH)
            whole = False
    return said
