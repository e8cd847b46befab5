"""How points and voxels look: geometry nodes that make points with a size of vertices, coloured by ``bv_color``.

The mesh itself stays what it is; the modifier makes it visible in every view and in renders of Cycles and EEVEE. Solid
shading knows no colours of points: there the object's own colour, the mean of them, is seen.
"""

from __future__ import annotations

import bpy
import numpy as np

from .materials import surface_material

MODIFIER = "BIM Verify Display"
POINTS, VOXELS = "BIM Verify Points", "BIM Verify Voxels"
SIZE = "Size"
COLOR = "bv_color"
EMULATED = ("llvmpipe", "softpipe", "swrast", "swiftshader", "software", "basic render", "gdi generic")
"""In the names of renderers that draw on the processor: virtual machines, remote desktops, test machines."""
MOST_EMULATED = 100_000
"""Points; each million takes such a renderer some seconds whenever the view is drawn, and nothing else can be done then."""


def points_shown(settings: bpy.types.PropertyGroup) -> int:
    """To how many points a scan is thinned: as set; unless someone set it, no more than an emulated view can draw."""
    wanted = int(settings.display_points)
    return wanted if settings.is_property_set("display_points") or not emulated() else min(wanted, MOST_EMULATED)


def emulated() -> bool:
    """Whether the processor draws the window."""
    if bpy.app.background:
        return False
    import gpu

    return any(name in gpu.platform.renderer_get().lower() for name in EMULATED)


def show_as_points(item: bpy.types.Object, diameter: float) -> None:
    """Draw the vertices of a mesh object as spheres of ``diameter`` metres; one size for all clouds of the file."""
    _attach(item, _points_group(POINTS, 0.5 * diameter))
    set_point_size(diameter)


def show_as_voxels(item: bpy.types.Object, edge: float) -> None:
    """Draw the vertices of a mesh object, middles of voxels, as spheres as large as those: ``edge`` metres."""
    _attach(item, _points_group(f"{VOXELS} {1000 * edge:g} mm", 0.5 * edge))


def set_point_size(diameter: float) -> None:
    """Change the diameter of all points of the file, metres."""
    group = bpy.data.node_groups.get(POINTS)
    if group is not None:
        group.nodes[SIZE].outputs[0].default_value = 0.5 * diameter


def _attach(item: bpy.types.Object, group: bpy.types.NodeTree) -> None:
    modifier = item.modifiers.get(MODIFIER) or item.modifiers.new(MODIFIER, "NODES")
    modifier.node_group = group
    colors = np.empty(4 * len(item.data.vertices), dtype=np.float32)
    item.data.attributes[COLOR].data.foreach_get("color", colors)
    if len(colors):
        item.color = colors.reshape(-1, 4).mean(axis=0)


def _points_group(name: str, radius: float) -> bpy.types.NodeTree:
    if (found := bpy.data.node_groups.get(name)) is not None:
        return found
    group, source, target = _empty_group(name)
    points = group.nodes.new("GeometryNodeMeshToPoints")
    size = _size(group, radius)
    group.links.new(source.outputs[0], points.inputs["Mesh"])
    group.links.new(size.outputs[0], points.inputs["Radius"])
    _finish(group, points.outputs[0], target)
    return group


def _empty_group(name: str) -> tuple[bpy.types.NodeTree, bpy.types.Node, bpy.types.Node]:
    group = bpy.data.node_groups.new(name, "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    return group, group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")


def _size(group: bpy.types.NodeTree, value: float) -> bpy.types.Node:
    node = group.nodes.new("ShaderNodeValue")
    node.name = node.label = SIZE
    node.outputs[0].default_value = value
    return node


def _finish(group: bpy.types.NodeTree, geometry: bpy.types.NodeSocket, target: bpy.types.Node) -> None:
    paint = group.nodes.new("GeometryNodeSetMaterial")
    paint.inputs["Material"].default_value = surface_material(COLOR)
    group.links.new(geometry, paint.inputs["Geometry"])
    group.links.new(paint.outputs[0], target.inputs[0])
    for column, node in enumerate(group.nodes):
        node.location = (220 * column, 0)
