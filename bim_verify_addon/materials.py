"""The material that shows a colour attribute in Cycles, EEVEE and material preview."""

from __future__ import annotations

import bpy

NAME = "BIM Verify"


def surface_material(attribute: str) -> bpy.types.Material:
    """The shared material whose base colour is the mesh attribute ``attribute``."""
    material = bpy.data.materials.get(NAME)
    if material is not None:
        return material
    material = bpy.data.materials.new(NAME)
    if material.node_tree is None:
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    color = tree.nodes.new("ShaderNodeVertexColor")
    color.layer_name = attribute
    surface = tree.nodes.new("ShaderNodeBsdfPrincipled")
    surface.inputs["Roughness"].default_value = 0.9
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(color.outputs["Color"], surface.inputs["Base Color"])
    tree.links.new(surface.outputs["BSDF"], output.inputs["Surface"])
    color.location, surface.location, output.location = (-250, 0), (0, 0), (300, 0)
    return material


def plain_material(name: str, color: tuple[float, float, float, float]) -> bpy.types.Material:
    """The material of that name: one colour, see-through by its alpha."""
    material = bpy.data.materials.get(name)
    if material is None:
        material = bpy.data.materials.new(name)
        material.use_nodes = True
        surface = material.node_tree.nodes["Principled BSDF"]
        surface.inputs["Base Color"].default_value = color
        surface.inputs["Alpha"].default_value = color[3]
        material.diffuse_color = color
    return material
