"""The pictures of docs/blender.md: the demo house verified in a real Blender window, colour mode by colour mode.

    blender --factory-startup --window-geometry 0 0 1600 1000 --python scripts/render_blender_docs.py -- [--out docs/images]

``--inputs DIR`` keeps the demo's files there and takes those that it holds. Needs a window that fills the screen (a
virtual one will do). Blender ends when the last picture is there.
``scripts/render_blender_steps.py`` makes the pictures of the other steps.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import bpy
from mathutils import Euler

sys.path.insert(0, str(Path(__file__).resolve().parent))

from blender_window import (
    TO_DRAW_S,
    WHILE_BUSY_S,
    choose_tab,
    in_view,
    run,
    scroll_to_result,
    shoot,
    tidy,
    until_idle,
    view,
)

from bim_verify.bim_verify_addon import hover, scene
from bim_verify.bim_verify_addon.session import SESSION
from bim_verify.core.simulation.demo import make_demo

MODES = {"DEVIATION": "deviation", "BELIEF": "evidence", "LOA": "loa", "COVERAGE": "coverage"}


def story(folder: Path, out: Path) -> Iterator[float]:
    """What a modeller does; yields seconds to wait before the next step."""
    tidy()
    yield TO_DRAW_S
    choose_tab()
    yield TO_DRAW_S
    if not (folder / "scan.e57").exists():
        make_demo(folder)
    with in_view():
        bpy.ops.bim_verify.import_ifc("INVOKE_DEFAULT", filepath=str(folder / "house.ifc"))
    yield from until_idle()
    bpy.context.scene.bim_verify.display_points = 50_000
    bpy.context.scene.bim_verify.point_size_mm = 50
    with in_view():
        bpy.ops.bim_verify.import_scan("INVOKE_DEFAULT", filepath=str(folder / "scan.e57"))
    yield from until_idle()
    frame_building()
    yield TO_DRAW_S
    bpy.context.scene.bim_verify.spacing_mm = 50
    bpy.context.scene.bim_verify.display_vertices = 250_000
    with in_view():
        bpy.ops.bim_verify.verify("INVOKE_DEFAULT")
    while SESSION.job is not None and SESSION.job.fraction < 0.4:
        yield WHILE_BUSY_S
    yield TO_DRAW_S
    shoot(out / "blender_scan.png")
    yield from until_idle()
    for item in scene.scan_objects(bpy.context.scene):
        item.hide_set(True)
    shading = view().spaces.active.shading
    # Flat light: the colours are those of the legend. Shadows show the shape.
    shading.show_shadows, shading.shadow_intensity, shading.show_object_outline = True, 0.35, True
    shading.light, shading.show_cavity, shading.cavity_type = "FLAT", True, "SCREEN"
    frame_building()
    yield TO_DRAW_S
    shoot(out / "blender_status.png")
    for mode, name in MODES.items():
        bpy.context.scene.bim_verify.color_mode = mode
        yield TO_DRAW_S
        shoot(out / f"blender_{name}.png")
    bpy.context.scene.bim_verify.color_mode = "STATUS"
    bpy.context.scene.bim_verify.show_hover = True
    point_at_a_deviating_element()
    yield TO_DRAW_S
    shoot(out / "blender_hover.png")
    hover.forget()
    scroll_to_result()
    with in_view():
        bpy.ops.bim_verify.step_finding(mode="STATUS", category="DEVIATING")
    yield TO_DRAW_S
    shoot(out / "blender_finding.png")


def frame_building() -> None:
    """The building from the south-west, without the terrain."""
    for item in scene.element_objects(bpy.context.scene).values():
        item.hide_set(item.bim_verify.ifc_class == "IfcGeographicElement")
    with in_view():
        bpy.ops.object.select_all(action="DESELECT")
        for item in scene.element_objects(bpy.context.scene).values():
            item.select_set(item.visible_get())
        bpy.ops.view3d.view_selected()
        bpy.ops.object.select_all(action="DESELECT")
    bpy.context.view_layer.objects.active = None
    region = view().spaces.active.region_3d
    region.view_rotation = Euler((math.radians(62), 0, math.radians(-38))).to_quaternion()
    region.view_distance *= 0.85


def point_at_a_deviating_element() -> None:
    """As if the mouse were there: the visible deviating element that is nearest to the middle of the view."""
    area = view()
    region = next(r for r in area.regions if r.type == "WINDOW")
    with in_view():
        for x, y in sorted(
            ((x, y) for x in range(60, region.width - 500, 20) for y in range(200, region.height - 100, 20)),
            key=lambda place: math.dist(place, (0.45 * region.width, 0.5 * region.height)),
        ):
            hover.HOVER.rest_until = 0.0
            hover.pointed_at(bpy.context, area, region, (x, y))
            if any(line.startswith("Deviating") for line in hover.HOVER.lines):
                return


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path(__file__).resolve().parent.parent / "docs" / "images")
    parser.add_argument("--inputs", type=Path)
    arguments = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else [])
    arguments.out.mkdir(parents=True, exist_ok=True)

    def steps() -> Iterator[float]:
        with tempfile.TemporaryDirectory(prefix="bim_verify_docs_") as folder:
            yield from story((arguments.inputs or Path(folder)).resolve(), arguments.out.resolve())

    run(steps())


main()
