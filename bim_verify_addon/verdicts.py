"""What holds for one element: its computed verdict, or what a person decided instead."""

from __future__ import annotations

import bpy

from ..core.results import STATUSES, Decision, Status, VerificationResult
from . import scene as scenery


def status(item: bpy.types.Object) -> str:
    """The status that holds; empty where the element was never verified."""
    stored = item.bim_verify
    return str(stored.decided_status or stored.status) if stored.status else ""


def verified(scene: bpy.types.Scene) -> bool:
    """Whether elements carry verdicts; other steps count classes of their own."""
    return any(entry.mode == "STATUS" for entry in scene.bim_verify.counts)


def forget(scene: bpy.types.Scene) -> None:
    """Nothing was computed for the model that the scene shows now; what a person decided stays for the next run."""
    for item in scenery.element_objects(scene).values():
        item.bim_verify.status = ""
    settings = scene.bim_verify
    settings.result_key = settings.result_summary = settings.result_note = settings.exported_path = ""


def decisions(scene: bpy.types.Scene) -> dict[str, Decision]:
    """GlobalId -> decision, of all elements of the scene."""
    found = {}
    for global_id, item in scenery.element_objects(scene).items():
        stored = item.bim_verify
        decided: Status | None = next((s for s in STATUSES if s == stored.decided_status), None)
        if decided is not None:
            found[global_id] = Decision(
                decided, stored.decision_reason, stored.decided_by, stored.decided_on, stored.status
            )
    return found


def taken_back(scene: bpy.types.Scene) -> set[str]:
    """GlobalIds of the elements of which a person took a decision back: one that a file still holds does not count."""
    return {g for g, item in scenery.element_objects(scene).items() if item.bim_verify.taken_back}


def take_back(item: bpy.types.Object) -> None:
    """The computed verdict holds again, whatever the model's file says."""
    item.bim_verify.taken_back = True
    store(item, None)


def store(item: bpy.types.Object, decision: Decision | None) -> None:
    """Put a decision, or that there is none, on an element's object."""
    stored = item.bim_verify
    stored.taken_back = stored.taken_back and decision is None
    stored.decided_status = decision.status if decision else ""
    stored.decision_reason = decision.reason if decision else ""
    stored.decided_by = decision.author if decision else ""
    stored.decided_on = decision.date if decision else ""


def store_all(scene: bpy.types.Scene, result: VerificationResult) -> None:
    """Put the decisions of a result on its elements."""
    for global_id, item in scenery.element_objects(scene).items():
        store(item, result.decisions.get(global_id))
