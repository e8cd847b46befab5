"""A comparison in the scene: elements coloured by state, epoch by epoch, and the voxels that changed."""

from __future__ import annotations

from collections.abc import Collection

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.change.results import CONFIRMED, DISAPPEARED, NEW, UNKNOWN, ChangeResult, ElementChange
from ..core.report.palette import VOXEL_COLORS, to_linear
from . import frame, materials, scene
from .point_display import show_as_voxels

STATES_KEY = "bim_verify_states"
"""On element objects: their state at each epoch, joined by spaces; the last one is that of the comparison."""
NUMBERS_KEY = "bim_verify_change_numbers"
"""On element objects: what else the comparison says of them, a line each: name, tabulator, value."""
REASON_KEY = "bim_verify_change_reason"
EPOCHS_KEY = "bim_verify_epochs"
MODE = "CHANGE"
VOXELS = "Voxels"
VOXEL_KEY = "bim_verify_voxels"
STATE = "bv_state"
MOST_POINTS = 500_000
LIFT = 0.03
"""Voxels are drawn larger by this share of their edge, so that their faces do not lie in those of elements."""
NAMES = {CONFIRMED: "Confirmed", NEW: "New", DISAPPEARED: "Disappeared", UNKNOWN: "Unknown"}


def show_change(target: bpy.types.Scene, result: ChangeResult, only: Collection[str] | None = None) -> None:
    """Show elements (of the GlobalIds ``only``) and voxels of a comparison; what an earlier one showed of them is replaced."""
    objects = scene.objects_of(target, result.model)
    series = [*([result.reference] if result.reference else []), *result.epochs]
    columns = [epoch.states for epoch in series]
    names = [f"{epoch.name} {epoch.date[:10]}".strip() for epoch in series]
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
    _show_voxels(target, result)
    settings = target.bim_verify_change
    settings.epochs = len(columns)
    found = result.summary()
    settings.summary = (
        f"{found['CONFIRMED']} confirmed, {found['NEW']} new, {found['DISAPPEARED']} gone, {found['PARTIAL']} partial, "
        f"{found['UNKNOWN']} unknown"
    )
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
    """Take states, epochs and voxels away."""
    for item in scene.element_objects(target).values():
        for key in (STATES_KEY, NUMBERS_KEY, REASON_KEY):
            item.pop(key, None)
    _remove_voxels(target)
    target.pop(EPOCHS_KEY, None)
    settings = target.bim_verify_change
    settings.summary, settings.epochs, settings.epoch_name, settings.result_key = "", 0, "", ""


def _remove_voxels(target: bpy.types.Scene) -> None:
    scene.remove(*(item for item in target.objects if VOXEL_KEY in item))


def state_now(item: bpy.types.Object) -> str:
    """State of an element at the epoch that the slider says; empty where no comparison knows it."""
    states = str(item.get(STATES_KEY, "")).split()
    at = bpy.context.scene.bim_verify_change.epoch - 1
    return states[min(at, len(states) - 1)] if states else ""


def color_elements(target: bpy.types.Scene) -> None:
    """Colour all elements by their state at the epoch that the slider says; voxels that changed are shown at the last."""
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
    here = bpy.context.view_layer.objects
    for item in target.objects:  # the voxels are those of the comparison, which the last place of the slider shows
        if item.get(VOXEL_KEY) in (NEW, DISAPPEARED) and item.name in here:
            item.hide_set(settings.epoch < settings.epochs)


def _paint(mesh: bpy.types.Mesh, rgb: NDArray[np.float64]) -> None:
    rgba = np.ones((len(mesh.vertices), 4), np.float32)
    rgba[:, :3] = rgb
    scene.set_attribute(mesh, scene.COLOR, "FLOAT_COLOR", rgba)
    scene.make_active_color(mesh)
    mesh.update_tag()


def _outward(vertices: NDArray[np.float64], quads: NDArray[np.int64]) -> NDArray[np.float64]:
    """(V, 3) the directions that the quads around each vertex face."""
    corner = vertices[quads]
    normal = np.sign(np.round(np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1]), 12))
    total = np.stack([
        np.bincount(quads.ravel(), weights=np.repeat(normal[:, axis], 4), minlength=len(vertices)) for axis in range(3)
    ], axis=1)
    return np.sign(total)


def _show_voxels(target: bpy.types.Scene, result: ChangeResult) -> None:
    """New and gone voxels as surfaces; the others as points, hidden at first: they fill the building and the rooms."""
    from ..core.report.voxel_skin import voxel_skin

    _remove_voxels(target)
    place = frame.stored(target) or frame.ViewFrame()
    cloud = result.voxels
    points = []
    for code, name in NAMES.items():
        index = cloud.index[cloud.state == code]
        if not len(index):
            continue
        if code in (NEW, DISAPPEARED):
            vertices, quads = voxel_skin(index, np.array(result.anchor), result.edge)
            vertices = vertices + LIFT * result.edge * _outward(vertices, quads)
        else:
            index = index[:: max(-(-len(index) // MOST_POINTS), 1)]
            vertices = np.array(result.anchor) + result.edge * (index + 0.5)
            quads = np.zeros((0, 4), np.int64)
        middle = np.round(vertices.mean(axis=0))
        mesh = bpy.data.meshes.new(f"{VOXELS} {name}")
        mesh.from_pydata((vertices - middle).tolist(), [], quads.tolist())
        scene.set_attribute(mesh, STATE, "INT", np.full(len(vertices), code, np.int32))
        _paint(mesh, np.broadcast_to(to_linear(VOXEL_COLORS[code]), (len(vertices), 3)))
        item = bpy.data.objects.new(f"{VOXELS} {name}", mesh)
        if len(quads):
            mesh.materials.append(materials.surface_material(scene.COLOR))
        else:
            show_as_voxels(item, result.edge)
        item[VOXEL_KEY] = code
        item[frame.ORIGIN_KEY] = [float(v) for v in middle]
        frame.place(item, place)
        scene.collection(target, VOXELS).objects.link(item)
        if not len(quads):
            points.append(item)
    bpy.context.view_layer.update()  # until then it does not know the new objects
    for item in points:
        item.hide_render = True
        if item.name in bpy.context.view_layer.objects:
            item.hide_set(True)
