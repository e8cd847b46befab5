"""A wall that moved in the scene: its face column by column as small squares, coloured by what each place did."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.report import palette
from . import frame, materials, project, scene

if TYPE_CHECKING:
    from ..core.wall_displacement.result import Column, DisplacementResult

PLACE = "Wall displacement"
COLUMN_KEY = "bim_verify_column"
"""On each column's object: its number."""
SUMMARY_KEY, LIMIT_KEY = "bim_verify_wall_summary", "bim_verify_wall_limit"
"""On the scene: what was found, in one sentence; metres at which the colours end."""
RESULT_KEY = "bim_verify_wall_result"
"""On the scene: of the result in memory, ``session.walls``."""
LATERAL, VERTICAL, DETECTION = "bv_lateral", "bv_vertical", "bv_detection"
UNSURE = 0.35
"""Share of the colour that a movement below its level of detection keeps."""


def columns(target: bpy.types.Scene) -> list[bpy.types.Object]:
    """The objects of the columns."""
    return [item for item in target.objects if COLUMN_KEY in item]


def show_displacement(target: bpy.types.Scene, result: DisplacementResult) -> str:
    """Show the wall in place of an earlier one, coloured, and return one sentence."""
    from ..core.wall_displacement.report import color_limit
    from ..core.wall_displacement.tables import summary_lines

    forget(target)
    project.adopt_frame(target, None, result.field.points)
    for column in result.columns:
        rows = np.flatnonzero(result.field.column == column.number)
        if len(rows):
            _show_column(target, result, column, rows)
    target[SUMMARY_KEY], target[LIMIT_KEY] = summary_lines(result)[0], color_limit(result)
    recolor(target)
    return str(target[SUMMARY_KEY])


def forget(target: bpy.types.Scene) -> None:
    """Remove the wall."""
    scene.remove(*columns(target))
    for key in (SUMMARY_KEY, LIMIT_KEY, RESULT_KEY):
        target.pop(key, None)


def recolor(target: bpy.types.Scene) -> None:
    """Colour the columns by the direction that the settings name; pale where a lateral movement is not significant."""
    vertical = target.bim_verify_displacement.direction == "VERTICAL"
    limit = float(target.get(LIMIT_KEY, 0.0)) or 1.0
    for item in columns(target):
        mesh = item.data
        value = _values(mesh, VERTICAL if vertical else LATERAL)
        color = np.ones((len(value), 4), dtype=np.float32)
        known = np.isfinite(value)
        srgb = np.tile(np.array(palette.UNMEASURED, dtype=np.float64), (len(value), 1))
        srgb[known] = palette.deviation_color(value[known], limit)
        if not vertical:
            unsure = np.abs(value) <= _values(mesh, DETECTION)
            srgb[unsure] = 1.0 - UNSURE * (1.0 - srgb[unsure])
        color[:, :3] = palette.to_linear(srgb)
        scene.set_attribute(mesh, scene.COLOR, "FLOAT_COLOR", color)
        scene.make_active_color(mesh)
        mesh.update_tag()


def _show_column(
    target: bpy.types.Scene, result: DisplacementResult, column: Column, rows: NDArray[np.int64]
) -> None:
    from ..core.wall_displacement.field import STEP_M

    points, normals = result.field.points[rows], result.field.normals[rows]
    middle = np.round(points.mean(axis=0))
    along = np.cross([0.0, 0.0, 1.0], normals)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    up = np.cross(normals, along)
    half = 0.5 * STEP_M
    corners = np.stack([points - middle + half * (a * along + b * up) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))], axis=1)
    name = f"Wall column {column.number}"
    mesh = bpy.data.meshes.new(name)
    count = 4 * len(rows)
    mesh.vertices.add(count)
    mesh.attributes["position"].data.foreach_set("vector", corners.astype(np.float32).ravel())
    mesh.loops.add(count)
    mesh.loops.foreach_set("vertex_index", np.arange(count, dtype=np.int32))
    mesh.polygons.add(len(rows))
    mesh.polygons.foreach_set("loop_start", np.arange(0, count, 4, dtype=np.int32))
    mesh.update(calc_edges=True)
    lateral, detection = result.field.distance[rows], result.field.detection[rows]
    scene.set_attribute(mesh, LATERAL, "FLOAT", np.repeat(lateral, 4))
    scene.set_attribute(mesh, DETECTION, "FLOAT", np.repeat(detection, 4))
    scene.set_attribute(mesh, VERTICAL, "FLOAT", np.repeat(column.vertical_at(points[:, 2]), 4))
    mesh.materials.append(materials.surface_material(scene.COLOR))
    item = bpy.data.objects.new(name, mesh)
    item[COLUMN_KEY] = column.number
    item["note"] = _note(column)
    item[frame.ORIGIN_KEY] = [float(v) for v in middle]
    frame.place(item, frame.stored(target) or frame.ViewFrame())
    scene.collection(target, PLACE).objects.link(item)


def _note(column: Column) -> str:
    """One line a joint."""
    lines = []
    for joint in column.joints:
        if joint.vertical is None or joint.lateral is None or joint.vertical_sigma is None or joint.lateral_sigma is None:
            lines.append(f"{joint.height:.2f} m: {joint.state.lower()}, not measured")
            continue
        moved = "" if joint.vertical_significant or joint.lateral_significant else ", not significant"
        lines.append(
            f"{joint.height:.2f} m: up {1000 * joint.vertical:+z.1f} mm (sigma {1000 * joint.vertical_sigma:.1f} mm), "
            f"out {1000 * joint.lateral:+z.1f} mm (sigma {1000 * joint.lateral_sigma:.1f} mm){moved}"
        )
    return "\n".join(lines)


def _values(mesh: bpy.types.Mesh, name: str) -> NDArray[np.float32]:
    values = np.empty(len(mesh.vertices), dtype=np.float32)
    mesh.attributes[name].data.foreach_get("value", values)
    return values
