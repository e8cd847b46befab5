"""A stand-in with the public names of Bonsai that the bridge uses, and nothing else of it."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import bpy
import ifcopenshell
import ifcopenshell.util.unit


class BIMGeoreferenceProperties(bpy.types.PropertyGroup):
    has_blender_offset: bpy.props.BoolProperty()
    blender_offset_x: bpy.props.StringProperty(default="0")
    blender_offset_y: bpy.props.StringProperty(default="0")
    blender_offset_z: bpy.props.StringProperty(default="0")
    blender_x_axis_abscissa: bpy.props.StringProperty(default="1")
    blender_x_axis_ordinate: bpy.props.StringProperty(default="0")


class BIMObjectProperties(bpy.types.PropertyGroup):
    ifc_definition_id: bpy.props.IntProperty()


class IfcStore:
    """``bonsai.bim.ifc.IfcStore``: an edit is one step of the file's own undo."""

    steps: list[str] = []

    @classmethod
    def execute_ifc_operator(cls, operator: Any, context: bpy.types.Context) -> set[str]:
        Ifc.file.begin_transaction()
        try:
            return operator._execute(context)
        finally:
            Ifc.file.end_transaction()
            cls.steps.append(operator.bl_idname)


class Ifc:
    """``bonsai.tool.Ifc``"""

    file: Any = None
    path = ""

    @classmethod
    def get(cls) -> Any:
        return cls.file

    @classmethod
    def get_path(cls) -> str:
        return cls.path

    @classmethod
    def get_entity(cls, item: bpy.types.Object) -> Any:
        identifier = item.BIMObjectProperties.ifc_definition_id
        return cls.file.by_id(identifier) if identifier else None

    @classmethod
    def get_object(cls, element: Any) -> bpy.types.Object | None:
        return next((o for o in bpy.data.objects if o.BIMObjectProperties.ifc_definition_id == element.id()), None)


@contextmanager
def bonsai_holding(path: Path, *, offset: tuple[float, float, float] | None = None, angle: float = 0.0) -> Iterator[type[Ifc]]:
    """Bonsai enabled, with the project loaded: one object an element, and the false origin (file units) set."""
    for cls in (BIMGeoreferenceProperties, BIMObjectProperties):
        bpy.utils.register_class(cls)
    bpy.types.Scene.BIMGeoreferenceProperties = bpy.props.PointerProperty(type=BIMGeoreferenceProperties)
    bpy.types.Object.BIMObjectProperties = bpy.props.PointerProperty(type=BIMObjectProperties)
    package, tool = ModuleType("bonsai"), ModuleType("bonsai.tool")
    tool.Ifc = Ifc  # type: ignore[attr-defined]
    package.tool = tool  # type: ignore[attr-defined]
    store = ModuleType("bonsai.bim.ifc")
    store.IfcStore = IfcStore  # type: ignore[attr-defined]
    IfcStore.steps = []
    sys.modules.update({"bonsai": package, "bonsai.tool": tool, "bonsai.bim.ifc": store})
    Ifc.file, Ifc.path = ifcopenshell.open(str(path)), str(path)
    try:
        for element in Ifc.file.by_type("IfcElement"):
            item = bpy.data.objects.new(f"{element.is_a()}/{element.Name}", bpy.data.meshes.new("1/2"))
            item.BIMObjectProperties.ifc_definition_id = element.id()
            bpy.context.scene.collection.objects.link(item)
        if offset is not None:
            props = bpy.context.scene.BIMGeoreferenceProperties
            props.has_blender_offset = True
            props.blender_offset_x, props.blender_offset_y, props.blender_offset_z = (str(v) for v in offset)
            props.blender_x_axis_abscissa, props.blender_x_axis_ordinate = str(math.cos(angle)), str(math.sin(angle))
        yield Ifc
    finally:
        Ifc.file, Ifc.path = None, ""
        del sys.modules["bonsai.bim.ifc"], sys.modules["bonsai.tool"], sys.modules["bonsai"]
        del bpy.types.Scene.BIMGeoreferenceProperties
        del bpy.types.Object.BIMObjectProperties
        for cls in (BIMObjectProperties, BIMGeoreferenceProperties):
            bpy.utils.unregister_class(cls)
