"""A comparison in the scene: elements coloured by state, epoch by epoch; with it voxels and remaining shapes."""

from __future__ import annotations

from collections.abc import Collection

import bpy

from ..core.change.results import ChangeResult, ElementChange
from . import scene, voxel_scene

STATES_KEY = "bim_verify_states"
"""On element objects: their state at each epoch, joined by spaces; the last one is that of the comparison."""
NUMBERS_KEY = "bim_verify_change_numbers"
"""On element objects: what else the comparison says of them, a line each: name, tabulator, value."""
REASON_KEY = "bim_verify_change_reason"
EPOCHS_KEY = "bim_verify_epochs"
MODE = "CHANGE"


def show_change(target: bpy.types.Scene, result: ChangeResult, only: Collection[str] | None = None) -> None:
    """Show elements, what is left of those that stand in part (both of the GlobalIds ``only``), and voxels of a comparison;
    what an earlier one showed of them is replaced."""
    objects = scene.objects_of(target, result.model)
    columns = [epoch.states for epoch in result.series]
    names = [f"{epoch.name} {epoch.date[:10]}".strip() for epoch in result.series]
    if result.reference:
        columns.append(tuple(e.state for e in result.elements))
        names.append("change")
    for row, (key, found) in enumerate(zip(scene.keys(result.model), result.elements, strict=True)):
        item = objects.get(key)
        if item is not None and (only is None or found.global_id in only):
            item[STATES_KEY] = " ".join(column[row] for column in columns)
            item[NUMBERS_KEY] = "\n".join(f"{name}\t{value}" for name, value in _numbers(found))
            item[REASON_KEY] = found.reason
    target[EPOCHS_KEY] = "\n".join(names)
    voxel_scene.show_remaining(target, result, only)
    voxel_scene.show_voxels(target, result)
    settings = target.bim_verify_change
    settings.epochs = len(columns)
    found = result.summary()
    settings.summary = (
        f"{found['CONFIRMED']} confirmed, {found['NEW']} new, {found['DISAPPEARED']} gone, {found['PARTIAL']} partial, "
        f"{found['UNKNOWN']} unknown"
    )
    if places := result.places():
        settings.summary += f"\n{places}"
    settings.epoch = len(columns)
    color_elements(target)


def _numbers(found: ElementChange) -> list[tuple[str, str]]:
    shares = (
        ("confirmed", found.confirmed_ratio), ("new", found.new_ratio), ("gone", found.disappeared_ratio),
        ("unknown", found.unknown_ratio),
    )
    rows = [("Shares", ", ".join(f"{100 * share:.0f} % {name}" for name, share in shares if share >= 0.005))]
    if found.volume:
        rows.append(("Stands", f"{found.built_volume:.3f} of {found.volume:.3f} m3, {found.disappeared_volume:.3f} gone"))
    if found.shift is not None:
        rows.append(("Shift", f"{1000 * found.shift:.1f} mm"))
    return [*rows, ("Progress", found.progress)]


def forget(target: bpy.types.Scene) -> None:
    """Take states, epochs, voxels and remaining shapes away."""
    for item in scene.element_objects(target).values():
        for key in (STATES_KEY, NUMBERS_KEY, REASON_KEY):
            item.pop(key, None)
    voxel_scene.remove_voxels(target)
    voxel_scene.remove_remaining(target)
    target.pop(EPOCHS_KEY, None)
    settings = target.bim_verify_change
    settings.summary, settings.epochs, settings.epoch_name, settings.result_key = "", 0, "", ""


def state_now(item: bpy.types.Object) -> str:
    """State of an element at the epoch that the slider says; empty where no comparison knows it."""
    states = str(item.get(STATES_KEY, "")).split()
    at = bpy.context.scene.bim_verify_change.epoch - 1
    return states[min(at, len(states) - 1)] if states else ""


def color_elements(target: bpy.types.Scene) -> None:
    """Colour all elements by their state at the epoch that the slider says; what changed is shown at the last."""
    from . import paint

    settings = target.bim_verify_change
    if not settings.epochs:
        return
    if settings.epoch > settings.epochs:
        settings.epoch = settings.epochs  # calls this again
        return
    names = str(target.get(EPOCHS_KEY, "")).split("\n")
    at = settings.epoch - 1
    settings.epoch_name = names[at] if at < len(names) else ""
    target.bim_verify.color_mode = MODE
    paint.refresh(target)
    voxel_scene.hide_what_changed(target, settings.epoch < settings.epochs)
