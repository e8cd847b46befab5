"""The settings of a comparison, and the epoch that is shown."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, FloatProperty, IntProperty, StringProperty

from ..core.options import MOST_MIN_POINTS, ChangeOptions

DEFAULTS = ChangeOptions()


def _show_epoch(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    from . import change_scene

    change_scene.color_elements(self.id_data)


class BimVerifyChangeSettings(bpy.types.PropertyGroup):
    """Of one scene."""

    reference: StringProperty(
        name="Reference", subtype="FILE_PATH",
        description="Scan of the epoch to compare with; empty: the model",
    )
    each_file: BoolProperty(
        name="Each scan is an epoch", default=False,
        description="Take every scan in the list as an epoch of its own, in the order of the list",
    )
    voxel_mm: FloatProperty(
        name="Voxel (mm)", default=1000 * DEFAULTS.voxel, min=1, soft_max=200, precision=0,
        description="Edge of a voxel, millimetres",
    )
    min_points: IntProperty(
        name="Least returns", default=DEFAULTS.min_points, min=1, max=MOST_MIN_POINTS, soft_max=50,
        description="Returns that make a voxel occupied; fewer do where the scan is sparse",
    )
    epoch: IntProperty(
        name="Epoch", default=1, min=1, update=_show_epoch,
        description="Colour the elements by their state at this epoch; the last one shows the comparison itself",
    )
    epochs: IntProperty(default=0)
    epoch_name: StringProperty()
    summary: StringProperty()
