"""The only file that knows Bonsai. Without it, or with no project loaded in it, every question is answered with None.

When Bonsai holds the project, its IFC file in memory is what is verified and what receives the property sets, and its
false origin is the scene's. Its meshes are never touched: they are shared between elements and belong to Bonsai's own
editing. The coloured surfaces are objects of ours beside them, with the same ``GlobalId``; while they are shown, the
objects of Bonsai they stand for are hidden in the view layer and can be brought back with one button.
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import bpy

from .frame import ViewFrame


def live_file() -> Any | None:
    """The IFC file that Bonsai holds in memory."""
    ifc = _ifc()
    return None if ifc is None else ifc.get()


def live_path() -> str:
    """Where that file was loaded from; empty for one that was never saved."""
    ifc = _ifc()
    return (ifc.get_path() or "") if ifc is not None and ifc.get() is not None else ""


def live_copy() -> tuple[tempfile.TemporaryDirectory[str], Path] | None:
    """A temporary folder with a copy of that file as it is now, unsaved edits included, and the copy.

    For a worker thread, which must use nothing of Bonsai; it leaves the folder with ``with``. Call this on the main thread.
    """
    live = live_file()
    if live is None:
        return None
    folder = tempfile.TemporaryDirectory(prefix="bim_verify_")
    copy = Path(folder.name) / "live.ifc"
    live.write(str(copy))
    return folder, copy


def view_frame(scene: bpy.types.Scene) -> ViewFrame | None:
    """The false origin under which Bonsai shows the project, in metres."""
    file = live_file()
    if file is None:
        return None
    georeference = getattr(scene, "BIMGeoreferenceProperties", None)
    if georeference is None or not georeference.has_blender_offset:
        return ViewFrame()
    import ifcopenshell.util.unit

    unit = float(ifcopenshell.util.unit.calculate_unit_scale(file))
    x, y, z = (float(getattr(georeference, f"blender_offset_{axis}")) * unit for axis in "xyz")
    angle = math.atan2(float(georeference.blender_x_axis_ordinate), float(georeference.blender_x_axis_abscissa))
    return ViewFrame((x, y, z), angle)


def global_id(item: bpy.types.Object) -> str | None:
    """The GlobalId of the element that one of Bonsai's objects stands for."""
    ifc = _ifc()
    if ifc is None or ifc.get() is None:
        return None
    return getattr(ifc.get_entity(item), "GlobalId", None)


def objects(global_ids: Iterable[str]) -> Iterator[bpy.types.Object]:
    """Bonsai's objects for these elements, where it has any."""
    ifc = _ifc()
    file = None if ifc is None else ifc.get()
    if ifc is None or file is None:
        return
    for identifier in global_ids:
        try:
            element = file.by_guid(identifier)
        except RuntimeError:
            continue
        if (item := ifc.get_object(element)) is not None:
            yield item


def change_file(context: bpy.types.Context, name: str, change: Callable[[Any], object]) -> None:
    """Let ``change`` edit Bonsai's file as one step of its own undo, mark it unsaved and bring its panels up to date.

    ``name``: of the operator that does it. Blender's undo step of that operator then takes the edit back too.
    """
    file = live_file()
    if file is None:
        return
    store = getattr(sys.modules.get("bonsai.bim.ifc"), "IfcStore", None)
    if store is None:
        change(file)
        return
    store.execute_ifc_operator(_Step(name, lambda: change(file)), context)


class _Step:
    """What Bonsai expects of one of its operators, around an edit of ours."""

    def __init__(self, name: str, change: Callable[[], object]) -> None:
        self.bl_idname = name
        self._change = change

    def _execute(self, context: bpy.types.Context) -> set[str]:
        self._change()
        return {"FINISHED"}


def _ifc() -> Any | None:
    """``bonsai.tool.Ifc`` where Bonsai is enabled; it is never imported by us."""
    tool = sys.modules.get("bonsai.tool")
    return getattr(tool, "Ifc", None)
