"""The settings of a comparison, the scans of its reference epoch, and the epoch that is shown."""

from __future__ import annotations

import bpy
from bpy.props import CollectionProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from ..core.options import MOST_MIN_POINTS, MOST_VOXEL_M, ChangeOptions
from .shared_settings import LOA_ITEMS, KnownRegistration

DEFAULTS = ChangeOptions()
GROUPING_ITEMS = [
    ("ONE", "One epoch", "All scans in the list are one epoch"),
    ("EACH", "Each scan", "Every scan in the list is an epoch of its own, in the order of the list"),
    ("NUMBERED", "Numbered", "Scans with the same number are one epoch; lower numbers are earlier"),
]
ASKED_ITEMS = [("NONE", "None", "No level is asked for"), *LOA_ITEMS]


def _show_epoch(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    from . import change_scene

    change_scene.color_elements(self.id_data)


class BimVerifyReferenceScan(bpy.types.PropertyGroup):
    """One scan file of the reference epoch."""

    path: StringProperty(name="File", subtype="FILE_PATH", description="Scan of the epoch to compare with")


class BimVerifyChangeSettings(KnownRegistration, bpy.types.PropertyGroup):
    """Of one scene."""

    references: CollectionProperty(type=BimVerifyReferenceScan)
    """None: compared with the model."""
    grouping: EnumProperty(
        name="Epochs", items=GROUPING_ITEMS, default="ONE", description="Which scans in the list belong to one epoch"
    )
    date: StringProperty(
        name="Day of the last epoch",
        description="Like 2025-03-31, for scans that do not say it; what is planned is what should stand on that day",
    )
    loa: EnumProperty(
        name="Level asked for", items=ASKED_ITEMS, default="NONE",
        description="Level of accuracy that the result is wanted for: warns when voxels cannot support it",
    )
    voxel_mm: FloatProperty(
        name="Voxel (mm)", default=1000 * DEFAULTS.voxel, min=1, max=1000 * MOST_VOXEL_M, soft_max=200,
        precision=0,
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
    result_key: StringProperty(description="Names the comparison in memory; undo brings an earlier one back")
