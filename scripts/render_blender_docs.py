"""The pictures of docs/blender.md: the demo house verified in a real Blender window, colour mode by colour mode.

    blender --factory-startup --window-geometry 0 0 1600 1000 --python scripts/render_blender_docs.py -- [--out docs/images]

Needs a window that fills the screen (a virtual one will do): the pictures are taken from the screen, since Blender's own
screenshots are black where the graphics are emulated. Blender ends when the last picture is there.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import tempfile
import traceback
from collections.abc import Iterator
from pathlib import Path

import bpy
from mathutils import Euler

sys.path.insert(0, str(Path(__file__).resolve().parent))

from headless_entry import package

PACKAGE = package()

from PIL import ImageGrab  # noqa: E402

from bim_verify.bim_verify_addon import hover, scene  # noqa: E402
from bim_verify.bim_verify_addon.registration import register  # noqa: E402
from bim_verify.bim_verify_addon.session import SESSION  # noqa: E402
from bim_verify.core.simulation.demo import make_demo  # noqa: E402

SIZE = (960, 680)
WHILE_BUSY_S, TO_DRAW_S = 0.3, 1.5
MODES = {"DEVIATION": "deviation", "BELIEF": "evidence", "LOA": "loa", "COVERAGE": "coverage"}
SCROLL_STEPS = 60
"""More than the sidebar is long; it stops at its end."""
SIDEBAR = "BIM Verify"


def story(folder: Path, out: Path) -> Iterator[float]:
    """What a modeller does; yields seconds to wait before the next step."""
    tidy()
    yield TO_DRAW_S
    choose_tab()
    yield TO_DRAW_S
    files = make_demo(folder)
    with in_view():
        bpy.ops.bim_verify.import_ifc("INVOKE_DEFAULT", filepath=str(files.model))
    yield from until_idle()
    bpy.context.scene.bim_verify.display_points = 50_000
    bpy.context.scene.bim_verify.point_size_mm = 50
    with in_view():
        bpy.ops.bim_verify.import_scan("INVOKE_DEFAULT", filepath=str(files.scan))
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


def tidy() -> None:
    """An empty scene, one view with the sidebar open, no grid."""
    for item in list(bpy.data.objects):
        bpy.data.objects.remove(item)
    space = view().spaces.active
    space.show_region_ui = True
    space.overlay.show_floor = space.overlay.show_axis_x = space.overlay.show_axis_y = False
    space.overlay.show_cursor = False
    space.shading.show_object_outline = False
    bpy.context.scene.bim_verify.show_hover = False  # wherever the mouse happens to be


def choose_tab() -> None:
    """Ours, of the sidebar; it must have been drawn before."""
    for region in view().regions:
        if region.type == "UI":
            region.active_panel_category = SIDEBAR
            region.tag_redraw()


def scroll_to_result() -> None:
    """Down to the list of findings and the active element."""
    area = view()
    region = next(r for r in area.regions if r.type == "UI")
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0], area=area, region=region):
        for _ in range(SCROLL_STEPS):
            bpy.ops.view2d.scroll_down()


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


def until_idle() -> Iterator[float]:
    """Wait for the running job."""
    yield TO_DRAW_S
    while SESSION.job is not None:
        yield WHILE_BUSY_S
    yield TO_DRAW_S


def view() -> bpy.types.Area:
    """The 3D view."""
    return next(a for a in bpy.context.window_manager.windows[0].screen.areas if a.type == "VIEW_3D")


def in_view() -> object:
    """Context for operators that need the view."""
    area = view()
    region = next(r for r in area.regions if r.type == "WINDOW")
    return bpy.context.temp_override(window=bpy.context.window_manager.windows[0], area=area, region=region)


def shoot(path: Path) -> None:
    """The 3D view with its sidebar as it is on the screen, as a small PNG."""
    screen, area = ImageGrab.grab(xdisplay=os.environ.get("DISPLAY")), view()
    bottom = screen.height - area.y
    picture = screen.crop((area.x, bottom - area.height, area.x + area.width, bottom)).convert("RGB")
    picture.thumbnail(SIZE)
    picture.save(path, optimize=True)
    print(path, flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path(__file__).resolve().parent.parent / "docs" / "images")
    arguments = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else [])
    if bpy.app.background:
        raise SystemExit("The pictures need a Blender with a window.")
    arguments.out.mkdir(parents=True, exist_ok=True)
    bpy.context.preferences.view.show_splash = False
    bpy.context.preferences.view.smooth_view = 0
    if not hasattr(bpy.types.Scene, "bim_verify"):
        register()
    folder = tempfile.TemporaryDirectory(prefix="bim_verify_docs_")
    steps = story(Path(folder.name), arguments.out.resolve())

    def tick() -> float:
        try:
            return next(steps)
        except StopIteration:
            code = 0
        except Exception:
            traceback.print_exc()
            code = 1
        folder.cleanup()
        sys.stdout.flush()
        os._exit(code)

    bpy.app.timers.register(tick, first_interval=2.0, persistent=True)


main()
