"""The active element: its verdict, its numbers and why."""

from __future__ import annotations

import bpy

from ...core.report.palette import STATUS_LABELS
from ...core.results import LEVELS
from .. import bonsai, scene
from .steps import TAB
from .text import millimetres, percent, wrapped


def verified_object(context: bpy.types.Context) -> bpy.types.Object | None:
    """The object with the verdict on the active element: the active object, or ours beside Bonsai's."""
    item = context.active_object
    if item is None:
        return None
    if not item.bim_verify.status:
        identifier = bonsai.global_id(item)
        item = scene.element_objects(context.scene).get(identifier) if identifier else None
    return item if item is not None and item.bim_verify.status else None


class BIMVERIFY_PT_element(bpy.types.Panel):
    """The active element."""

    bl_label = "Active Element"
    bl_idname = "BIMVERIFY_PT_element"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = TAB

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return verified_object(context) is not None

    def draw(self, context: bpy.types.Context) -> None:
        item = verified_object(context)
        if item is None:
            return
        verdict, layout = item.bim_verify, self.layout
        layout.label(text=f"{verdict.ifc_class}  {verdict.element_name or 'unnamed'}")
        layout.label(text=f"{STATUS_LABELS[verdict.status]}  ({verdict.achieved_loa} of {verdict.required_loa})")
        wrapped(layout.box(), context, verdict.reason)
        shift = millimetres(verdict.displacement)
        if verdict.displacement == verdict.displacement:
            shift += f" ± {millimetres(1.96 * verdict.displacement_sigma)}"
            shift += ", significant" if verdict.significant else ", not significant"
        confirmed = dict(zip(LEVELS, verdict.confirmed_ratio, strict=True))[int(verdict.required_loa.removeprefix("LOA"))]
        column = layout.column(align=True)
        column.scale_y = 0.8
        for name, value in (
            ("Storey", verdict.storey),
            ("Coverage", percent(verdict.coverage)),
            ("Occupied", percent(verdict.belief_occupied)),
            ("Empty", percent(verdict.belief_empty)),
            ("Unknown", percent(verdict.belief_unknown)),
            ("Conflict", percent(verdict.conflict)),
            (f"Within {verdict.required_loa}", percent(confirmed)),
            ("Median deviation", millimetres(verdict.deviation_median)),
            ("95 % deviation", millimetres(verdict.deviation_p95)),
            ("Shift", shift),
            ("Measurement sigma", millimetres(verdict.measurement_sigma)),
            ("Registration sigma", millimetres(verdict.registration_sigma)),
            ("Samples", f"{verdict.observed_count} of {verdict.sample_count} observed"),
            ("Seen by", verdict.stations),
        ):
            split = column.split(factor=0.45)
            split.label(text=name)
            split.label(text=value)
