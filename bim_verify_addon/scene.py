"""Arrays to Blender objects and back: elements, their coloured surfaces, scans. Runs on the main thread only."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.files import same_file
from ..core.model.elements import BuildingModel, Element
from ..core.results import LEVELS, ElementVerdict, VerificationResult
from . import bonsai, colors, frame
from .point_display import show_as_points
from .surface_grid import Display, second_sides

ROOT = "BIM Verify"
SCANS, STOREY = "Scans", "storey "
GUID_KEY = "GlobalId"
SECOND_KEY = "bim_verify_element"
"""On the object of an element whose GlobalId another one has as well: its name among ``element_objects``."""
PLACE_KEY = "bim_verify_collection"
"""On each collection that we make: its path below the root, since Blender may have renamed it."""
SCAN_KEY = "bim_verify_scan"
"""On each scan object: the path of its file."""
OURS = "bv_"
OCCUPIED, EMPTY, UNKNOWN, DEVIATION, COLOR = "bv_occupied", "bv_empty", "bv_unknown", "bv_deviation", "bv_color"

PLAIN_FIELDS = (
    "status",
    "required_loa",
    "achieved_loa",
    "belief_occupied",
    "belief_empty",
    "belief_unknown",
    "conflict",
    "coverage",
    "sample_count",
    "observed_count",
    "area",
    "measurement_sigma",
    "registration_sigma",
    "reason",
)
"""Of a verdict, stored on the object as they are; the others may be missing, or are no single numbers."""


def element_objects(scene: bpy.types.Scene) -> dict[str, bpy.types.Object]:
    """GlobalId -> the object that we made for it (never one of Bonsai's); a second element with the same one: ``keys``.

    Of copies that a person made the first object counts. What is linked from another file, or no mesh any more, is not ours.
    """
    ours = (item for item in scene.objects if GUID_KEY in item and frame.ORIGIN_KEY in item and _is_own(item))
    return {key_of(item): item for item in sorted(ours, key=lambda item: -item.session_uid)}


def key_of(item: bpy.types.Object) -> str | None:
    """What ``element_objects`` calls the element of this object; None where it is none of ours."""
    return item.get(SECOND_KEY) or item.get(GUID_KEY)


def _is_own(item: bpy.types.Object) -> bool:
    return item.type == "MESH" and item.library is None and item.override_library is None and item.data.library is None


def keys(model: BuildingModel) -> list[str]:
    """What ``element_objects`` calls each element: its GlobalId, with the STEP id where an element before it has the same."""
    known: set[str] = set()
    found = []
    for element in model.elements:
        found.append(f"{element.global_id} #{element.step_id}" if element.global_id in known else element.global_id)
        known.add(element.global_id)
    return found


def scan_objects(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """The display clouds of the scene."""
    return [item for item in scene.objects if SCAN_KEY in item and _is_own(item)]


def show_model(scene: bpy.types.Scene, model: BuildingModel) -> None:
    """One object an element, in a collection a storey; what an earlier import made is brought up to date or removed."""
    collection(scene)
    place = frame.stored(scene) or frame.ViewFrame()
    existing = element_objects(scene)
    start, second = model.triangle_start, second_sides(model)
    for index, (key, element) in enumerate(zip(keys(model), model.elements, strict=True)):
        own = slice(start[index], start[index + 1])
        triangles = model.triangles[own][~second[own]]
        used, corner = np.unique(triangles, return_inverse=True)
        surface = model.vertices[used], corner.reshape(-1, 3)
        _put_element(scene, existing.pop(key, None), key, element, surface, model.origin, place)
    remove(*existing.values())


def objects_of(scene: bpy.types.Scene, model: BuildingModel) -> dict[str, bpy.types.Object]:
    """GlobalId -> object of every element; the model is shown where one is missing."""
    existing = element_objects(scene)
    if any(key not in existing for key in keys(model)):
        show_model(scene, model)
        existing = element_objects(scene)
    return existing


def show_result(
    scene: bpy.types.Scene, result: VerificationResult, display: Display, only: Collection[str] | None = None
) -> None:
    """Give every element its surface with what is known on it, and its verdict; ``paint`` colours them afterwards.

    ``only``: GlobalIds of the elements that are touched; None for all.
    """
    collection(scene)
    place = frame.stored(scene) or frame.ViewFrame()
    existing = element_objects(scene) if only is None else objects_of(scene, result.model)
    grid, values = display.grid, display.values
    rows = zip(keys(result.model), result.model.elements, result.verdicts, strict=True)
    for index, (key, element, verdict) in enumerate(rows):
        if only is not None and element.global_id not in only:
            continue
        at = slice(grid.vertex_start[index], grid.vertex_start[index + 1])
        of = slice(grid.triangle_start[index], grid.triangle_start[index + 1])
        surface = grid.vertices[at], grid.triangles[of] - at.start
        item = _put_element(scene, existing.get(key), key, element, surface, result.model.origin, place)
        set_attribute(item.data, OCCUPIED, "FLOAT", values.occupied[at])
        set_attribute(item.data, EMPTY, "FLOAT", values.empty[at])
        set_attribute(item.data, UNKNOWN, "FLOAT", values.unknown[at])
        set_attribute(item.data, DEVIATION, "FLOAT", values.deviation[at])
        _store_verdict(item, verdict)
    _store_summary(scene, result)


def show_scan(
    scene: bpy.types.Scene,
    path: str,
    name: str,
    xyz: NDArray[np.float64],
    station: NDArray[np.int32],
    color: NDArray[np.uint8] | None,
) -> bpy.types.Object:
    """A thinned scan as a mesh of vertices, with ``station`` (INT) and ``bv_color`` (FLOAT_COLOR) on each.

    ``xyz``: (N, 3) metres, frame of the file; ``move_scans`` says where that lies in the model frame.
    """
    collection(scene)
    remove_scan(scene, path)
    middle = np.round(np.median(xyz, axis=0)) if len(xyz) else np.zeros(3)
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(xyz))
    mesh.attributes["position"].data.foreach_set("vector", (xyz - middle).astype(np.float32).ravel())
    set_attribute(mesh, "station", "INT", station.astype(np.int32))
    rgba = np.ones((len(xyz), 4), dtype=np.float32)
    rgba[:, :3] = colors.scan_color(color, station)
    set_attribute(mesh, COLOR, "FLOAT_COLOR", rgba)
    make_active_color(mesh)
    mesh.update()
    item = bpy.data.objects.new(name, mesh)
    item[SCAN_KEY] = path
    show_as_points(item, scene.bim_verify.point_size_mm / 1000)
    item[frame.ORIGIN_KEY] = [float(v) for v in middle]
    frame.place(item, frame.stored(scene) or frame.ViewFrame())
    collection(scene, SCANS).objects.link(item)
    return item


def remove_scan(scene: bpy.types.Scene, path: str) -> None:
    """Remove the display cloud of this file."""
    remove(*(item for item in scan_objects(scene) if item[SCAN_KEY] == path))


def move_scans(scene: bpy.types.Scene, transform: NDArray[np.float64], paths: Sequence[str] | None = None) -> None:
    """Show all scans (those of ``paths``) where ``transform`` puts them, (4, 4): frame of the files to model frame, metres."""
    place = frame.stored(scene) or frame.ViewFrame()
    for item in scan_objects(scene):
        if paths is not None and not any(same_file(bpy.path.abspath(item[SCAN_KEY]), path) for path in paths):
            continue
        item[frame.PLACEMENT_KEY] = [float(v) for v in transform.ravel()]
        frame.place(item, place)


def show_planned(context: bpy.types.Context, planned: bool) -> None:
    """With Bonsai: its objects and our surfaces fill the same space, so one of them is hidden in the view layer."""
    ours = element_objects(context.scene)
    theirs = list(bonsai.objects(ours))
    if not theirs:
        return
    here = context.view_layer.objects
    for item in ours.values():
        if item.name in here:
            item.hide_set(planned)
    for item in theirs:
        if item.name in here:
            item.hide_set(not planned)


def show_colors_in_views(kind: str = "VERTEX") -> None:
    """Let solid shading in all 3D views show the colour attribute; ``TEXTURE``: pictures on surfaces."""
    for screen in bpy.data.screens:
        for area in screen.areas:
            for space in area.spaces:
                if space.type == "VIEW_3D":
                    space.shading.color_type = kind


def collection(scene: bpy.types.Scene, *path: str, kind: str = "") -> bpy.types.Collection:
    """The collection ``BIM Verify / path...``, made where it is missing; one of another ``kind`` may have the same name.

    One that another scene has as well (a linked copy) leaves this one, so that neither changes what the other shows.
    """
    parent = scene.collection
    for shared in [c for c in parent.children if PLACE_KEY in c and _in_other_scenes(c, scene)]:
        parent.children.unlink(shared)
    for depth in range(len(path) + 1):
        name = path[depth - 1] if depth else ROOT
        key = kind * bool(depth) + "\n".join(path[:depth])
        found = next((c for c in parent.children if c.get(PLACE_KEY) == key and c.library is None), None)
        if found is None:
            found = bpy.data.collections.new(name or "(no storey)")
            found[PLACE_KEY] = key
            parent.children.link(found)
        parent = found
    return parent


def _in_other_scenes(item: bpy.types.Collection, scene: bpy.types.Scene) -> bool:
    return any(item in other.collection.children_recursive for other in bpy.data.scenes if other != scene)


def leave_edit_mode(context: bpy.types.Context) -> None:
    """Attributes of a mesh that is being edited cannot be written, and an edit that goes on would undo what is put there."""
    if context.mode != "OBJECT" and bpy.ops.object.mode_set.poll():
        bpy.ops.object.mode_set(mode="OBJECT")


def set_attribute(mesh: bpy.types.Mesh, name: str, kind: str, values: NDArray[np.generic]) -> None:
    """Write a per-vertex attribute of type INT, FLOAT ((V,)) or FLOAT_COLOR ((V, 4) linear)."""
    attribute = mesh.attributes.get(name)
    if attribute is not None and (attribute.data_type, attribute.domain) != (kind, "POINT"):
        mesh.attributes.remove(attribute)
        attribute = None
    if attribute is None:
        attribute = mesh.attributes.new(name, kind, "POINT")
    field = "color" if kind == "FLOAT_COLOR" else "value"
    dtype = np.int32 if kind == "INT" else np.float32
    attribute.data.foreach_set(field, np.ascontiguousarray(values, dtype=dtype).ravel())


def object_name(element: Element) -> str:
    """``IfcWall/Name``, as Bonsai names its objects."""
    return f"{element.ifc_class}/{element.name or 'Unnamed'}"


def fill(mesh: bpy.types.Mesh, vertices: NDArray[np.float64], triangles: NDArray[np.integer]) -> None:
    """Give a mesh this surface, (V, 3) metres in its object's frame and (T, 3) rows of them.

    It is filled anew and not replaced: Blender goes through the whole file for each mesh that is removed. What other
    capabilities know of its vertices stays, if they are the same ones.
    """
    kept = _values(mesh) if (len(mesh.vertices), len(mesh.polygons)) == (len(vertices), len(triangles)) else {}
    mesh.clear_geometry()
    mesh.materials.clear()
    mesh.vertices.add(len(vertices))
    mesh.attributes["position"].data.foreach_set("vector", vertices.astype(np.float32).ravel())
    mesh.loops.add(3 * len(triangles))
    mesh.loops.foreach_set("vertex_index", np.ascontiguousarray(triangles, dtype=np.int32).ravel())
    mesh.polygons.add(len(triangles))
    mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * len(triangles), 3, dtype=np.int32))
    mesh.polygons.foreach_set("use_smooth", np.zeros(len(triangles), dtype=np.bool_))
    mesh.update(calc_edges=True)
    for name, values in kept.items():
        set_attribute(mesh, name, "FLOAT", values)


def _values(mesh: bpy.types.Mesh) -> dict[str, NDArray[np.float32]]:
    """Our numbers on its vertices."""
    found = {}
    for attribute in mesh.attributes:
        if attribute.name.startswith(OURS) and attribute.data_type == "FLOAT":
            found[attribute.name] = np.empty(len(mesh.vertices), dtype=np.float32)
            attribute.data.foreach_get("value", found[attribute.name])
    return found


def _put_element(
    scene: bpy.types.Scene,
    item: bpy.types.Object | None,
    key: str,
    element: Element,
    surface: tuple[NDArray[np.float64], NDArray[np.integer]],
    origin: NDArray[np.float64],
    place: frame.ViewFrame,
) -> bpy.types.Object:
    if item is None:
        item = bpy.data.objects.new(object_name(element), bpy.data.meshes.new(object_name(element)))
        item[GUID_KEY] = element.global_id
        if key != element.global_id:
            item[SECOND_KEY] = key
        collection(scene, element.storey, kind=STOREY).objects.link(item)
    else:
        item.data.name = object_name(element)
    vertices, triangles = surface
    middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0)) if len(vertices) else np.zeros(3)
    fill(item.data, vertices - middle, triangles)
    item[frame.ORIGIN_KEY] = [float(v) for v in origin + middle]
    frame.place(item, place)
    item.bim_verify.ifc_class = element.ifc_class
    item.bim_verify.element_name = element.name
    item.bim_verify.storey = element.storey
    return item


def remove(*items: bpy.types.Object) -> None:
    """Remove objects, and their meshes and cameras if nothing else has them."""
    data = {item.data for item in items if isinstance(item.data, (bpy.types.Mesh, bpy.types.Camera))}
    bpy.data.batch_remove(items)
    bpy.data.batch_remove([block for block in data if block.users == 0])


def make_active_color(mesh: bpy.types.Mesh) -> None:
    """Let solid shading and materials take ``bv_color``."""
    mesh.color_attributes.active_color_name = COLOR
    mesh.color_attributes.render_color_index = mesh.color_attributes.active_color_index


def _store_verdict(item: bpy.types.Object, verdict: ElementVerdict) -> None:
    stored = item.bim_verify
    for name in PLAIN_FIELDS:
        setattr(stored, name, getattr(verdict, name))
    for name in ("deviation_median", "deviation_p95", "displacement", "displacement_sigma"):
        value = getattr(verdict, name)
        setattr(stored, name, math.nan if value is None else value)
    stored.displacement_vector = verdict.displacement_vector or (math.nan,) * 3
    stored.confirmed_ratio = [verdict.confirmed_ratio.get(level, 0.0) for level in LEVELS]
    stored.significant = bool(verdict.significant)
    stored.stations = ", ".join(verdict.stations)


def _store_summary(scene: bpy.types.Scene, result: VerificationResult) -> None:
    settings = scene.bim_verify
    summary = result.summary()
    settings.result_summary = f"{summary['elements']} elements, {100 * summary['coverage']:.0f} % of the surface observed"
    settings.result_note = "\n".join(result.warnings)
    settings.verified_model = result.model.content_hash
