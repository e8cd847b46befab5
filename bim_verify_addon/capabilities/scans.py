"""The scans of the campaign."""

from __future__ import annotations

import bpy

from .. import project
from ..capability import Capability, Step, StepState
from ..point_display import points_shown
from ..step_parts import main_button


class BIMVERIFY_UL_scans(bpy.types.UIList):
    """The scan files."""

    def draw_item(self, context, layout, data, item, icon, active_data, active_property, index) -> None:  # type: ignore[no-untyped-def]
        row = layout.row(align=True)
        row.prop(item, "use", text="")
        row.label(text=item.name)
        row.label(text=f"{item.points / 1e6:.2f} M")
        icon = "IMAGE_DATA" if item.dense else "OUTLINER_OB_POINTCLOUD"
        row.prop(item, "dense", text="", icon=icon, emboss=item.dense)


def _state(scene: bpy.types.Scene) -> StepState:
    used = [scan for scan in scene.bim_verify.scans if scan.use]
    if not project.scan_paths(scene.bim_verify):
        return StepState(False, "Dense points need the project of their photos" if used else "No scan yet")
    points = sum(scan.points for scan in used)
    stations = sum(scan.stations for scan in used if not scan.dense)
    return StepState(True, f"{points / 1e6:.1f} M points, {stations} station{'s' if stations != 1 else ''}")


def _draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    settings = context.scene.bim_verify
    if settings.scans:
        row = layout.row()
        row.template_list("BIMVERIFY_UL_scans", "", settings, "scans", settings, "scan_index", rows=2)
        row.operator("bim_verify.remove_scan", text="", icon="REMOVE")
    main_button(layout, "import_scan", "ADD")


def _expert(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    for name in ("scan_frame", "origin", "display_points", "point_size_mm"):
        layout.prop(context.scene.bim_verify, name)
    if (shown := points_shown(context.scene.bim_verify)) < context.scene.bim_verify.display_points:
        layout.label(text=f"{shown:,} are shown: graphics are emulated", icon="INFO")


CAPABILITY = Capability("scans", Step("scans", "Scans", _state, _draw, _expert), classes=(BIMVERIFY_UL_scans,))
