"""The steps of the work, one sub-panel each, made from the capabilities: state, what is missing, one main button."""

from __future__ import annotations

import bpy

from ..capabilities import CAPABILITIES
from ..capability import Step
from ..jobs import rough_duration
from ..session import SESSION
from ..text import wrapped

TAB = "BIM Verify"


class BIMVERIFY_PT_steps(bpy.types.Panel):
    """The frame of the steps; while a job runs, its progress."""

    bl_label = "BIM Verify"
    bl_idname = "BIMVERIFY_PT_steps"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = TAB

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        """In the header, whose height never changes: the steps below stay where they are."""
        job = SESSION.job
        if job is None:
            return
        left = "" if job.seconds_left is None else f", {rough_duration(job.seconds_left)} left"
        self.layout.progress(factor=job.fraction, text=f"{100 * job.fraction:.0f} %{left}")

    def draw(self, context: bpy.types.Context) -> None:
        """Nothing but the steps, which are panels of their own."""


def _panel(number: int, step: Step) -> type[bpy.types.Panel]:
    identifier = f"BIMVERIFY_PT_step_{step.name}"

    def draw_header(self: bpy.types.Panel, context: bpy.types.Context) -> None:
        self.layout.label(text="", icon="CHECKMARK" if step.state(context.scene).done else "RADIOBUT_OFF")

    def draw(self: bpy.types.Panel, context: bpy.types.Context) -> None:
        wrapped(self.layout, context, step.state(context.scene).text)
        step.draw(self.layout, context)
        if step.expert is None:
            return
        header, body = self.layout.panel(f"{identifier}_expert", default_closed=True)
        header.label(text="Expert settings")
        if body is not None:
            step.expert(body.column(align=True), context)

    return type(
        identifier,
        (bpy.types.Panel,),
        {
            "__doc__": f"{step.label}.",
            "bl_label": f"{number}  {step.label}",
            "bl_idname": identifier,
            "bl_space_type": "VIEW_3D",
            "bl_region_type": "UI",
            "bl_category": TAB,
            "bl_parent_id": "BIMVERIFY_PT_steps",
            "bl_options": {"DEFAULT_CLOSED"} if step.optional else set(),
            "draw_header": draw_header,
            "draw": draw,
        },
    )


STEPS: tuple[Step, ...] = tuple(c.step for c in CAPABILITIES if c.step is not None)
STEP_PANELS = tuple(_panel(number, step) for number, step in enumerate(STEPS, start=1))
