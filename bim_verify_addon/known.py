"""Which element a person looks at."""

from __future__ import annotations

import bpy

from . import bonsai, scene
from .capabilities import CAPABILITIES


def known_object(context: bpy.types.Context) -> bpy.types.Object | None:
    """Our object of the active element: the active object itself, or ours beside Bonsai's; None if nothing is known."""
    return known_of(context, context.active_object)


def known_of(context: bpy.types.Context, item: bpy.types.Object | None) -> bpy.types.Object | None:
    """Our object of the element that ``item``, one of ours or of Bonsai's, stands for; None if nothing is known of it."""
    if item is None:
        return None
    if scene.GUID_KEY not in item:
        identifier = bonsai.global_id(item)
        item = scene.element_objects(context.scene).get(identifier) if identifier else None
    if item is None or not any(c.numbers is not None and c.numbers(item) for c in CAPABILITIES):
        return None
    return item
