"""How points and voxels look: geometry nodes that make spheres or cubes of vertices, coloured by ``bv_color``.

The mesh itself stays what it is; the modifier makes it visible in every view and in renders of Cycles and EEVEE.
"""

from __future__ import annotations

import bpy

from .materials import surface_material

MODIFIER = "BIM Verify Display"
POINTS, VOXELS = "BIM Verify Points", "BIM Verify Voxels"
SIZE = "Size"
COLOR = "bv_color"


def show_as_points(item: bpy.types.Object, diameter: float) -> None:
    """Draw the vertices of a mesh object as spheres of ``diameter`` metres; one size for all clouds of the file."""
    _attach(item, _points_group())
    set_point_size(diameter)


def show_as_voxels(item: bpy.types.Object, edge: float) -> None:
    """Draw the vertices of a mesh object as cubes of ``edge`` metres, a little apart."""
    _attach(item, _voxels_group(edge))


def set_point_size(diameter: float) -> None:
    """Change the diameter of all points of the file, metres."""
    group = bpy.data.node_groups.get(POINTS)
    if group is not None:
        group.nodes[SIZE].outputs[0].default_value = 0.5 * diameter


def _attach(item: bpy.types.Object, group: bpy.types.NodeTree) -> None:
    modifier = item.modifiers.get(MODIFIER) or item.modifiers.new(MODIFIER, "NODES")
    modifier.node_group = group


def _points_group() -> bpy.types.NodeTree:
    if (found := bpy.data.node_groups.get(POINTS)) is not None:
        return found
    group, source, target = _empty_group(POINTS)
    points = group.nodes.new("GeometryNodeMeshToPoints")
    radius = _size(group, 0.005)
    group.links.new(source.outputs[0], points.inputs["Mesh"])
    group.links.new(radius.outputs[0], points.inputs["Radius"])
    _finish(group, points.outputs[0], target)
    return group


def _voxels_group(edge: float) -> bpy.types.NodeTree:
    name = f"{VOXELS} {1000 * edge:g} mm"
    if (found := bpy.data.node_groups.get(name)) is not None:
        return found
    group, source, target = _empty_group(name)
    points = group.nodes.new("GeometryNodeMeshToPoints")
    cube = group.nodes.new("GeometryNodeMeshCube")
    place = group.nodes.new("GeometryNodeInstanceOnPoints")
    real = group.nodes.new("GeometryNodeRealizeInstances")
    cube.inputs["Size"].default_value = (0.92 * edge,) * 3
    group.links.new(source.outputs[0], points.inputs["Mesh"])
    group.links.new(points.outputs[0], place.inputs["Points"])
    group.links.new(cube.outputs[0], place.inputs["Instance"])
    group.links.new(place.outputs[0], real.inputs["Geometry"])
    _finish(group, real.outputs[0], target)
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
