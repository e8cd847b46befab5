"""A person's word over a verdict."""

from __future__ import annotations

import datetime
import getpass
from typing import Any

import bpy
from bpy.props import EnumProperty, StringProperty

from ...core.report.palette import STATUS_LABELS, STATUS_MEANINGS
from ...core.results import Decision
from .. import bonsai, paint, scene, selection, verdicts

ITEMS = [
    *((status, label, STATUS_MEANINGS[status]) for status, label in STATUS_LABELS.items()),
    ("COMPUTED", "As computed", "Take an earlier decision back"),
]


class BIMVERIFY_OT_decide(bpy.types.Operator):
    """Overrule the verdict on the selected elements, with a reason; the computed one is kept beside it."""

    bl_idname = "bim_verify.decide"
    bl_label = "Overrule Verdict"
    bl_description = "Decide on the selected elements yourself, with a reason; it is kept in the IFC file and in later runs"
    bl_options = {"REGISTER", "UNDO"}

    status: EnumProperty(name="Decide", items=ITEMS, default="CONFIRMED", description="What holds instead of the verdict")
    reason: StringProperty(name="Reason", description="Why; it is written into the IFC file")
    author: StringProperty(name="Decided by", description="Who decides; written into the IFC file")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not verdicts.verified(context.scene):
            cls.poll_message_set("Verify first")
            return False
        if not context.selected_objects:
            cls.poll_message_set("Select the elements to decide on")
            return False
        return True

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if not self.author:
            self.author = _user()
        return context.window_manager.invoke_props_dialog(self, width=420)

    def execute(self, context: bpy.types.Context) -> set[str]:
        from ...core.model.decisions import apply_decisions, remove_decision

        items = scene.element_objects(context.scene)
        chosen = {g: items[g] for g in selection.keys(context) if g in items and items[g].bim_verify.status}
        if not chosen:
            self.report({"ERROR"}, "None of the selected objects has a verdict. Select verified elements.")
            return {"CANCELLED"}
        taken_back = self.status == "COMPUTED"
        if not taken_back and not self.reason.strip():
            self.report({"ERROR"}, "A decision needs a reason. Say why the verdict does not hold.")
            return {"CANCELLED"}
        today = datetime.date.today().isoformat()
        made = {
            g: Decision(self.status, self.reason.strip(), self.author.strip() or _user(), today, item.bim_verify.status)
            for g, item in chosen.items()
        }

        def write(file: Any) -> None:
            if taken_back:
                for global_id in made:
                    remove_decision(file, global_id)
            else:
                apply_decisions(file, made)

        bonsai.change_file(context, self.bl_idname, write)
        for global_id, item in chosen.items():
            if taken_back:
                verdicts.take_back(item)
            else:
                verdicts.store(item, made[global_id])
        paint.refresh(context.scene)
        word = "as computed again" if taken_back else f"decided: {STATUS_LABELS[self.status].lower()}"
        self.report({"INFO"}, f"{len(chosen)} element{'s' if len(chosen) > 1 else ''} {word}")
        return {"FINISHED"}


def _user() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError):
        return ""
