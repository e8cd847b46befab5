"""A scripted session in a real Blender window: steps that a timer runs, the sidebar, and pictures of the screen.

The pictures are taken from the screen, since Blender's own screenshots are black where the graphics are emulated; so the
window must fill it (a virtual one will do).
"""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path

import bpy
from headless_entry import package

PACKAGE = package()

from PIL import Image, ImageGrab  # noqa: E402

from bim_verify.bim_verify_addon import panels  # noqa: E402
from bim_verify.bim_verify_addon.registration import register  # noqa: E402
from bim_verify.bim_verify_addon.session import SESSION  # noqa: E402

SIZE = (960, 680)
LARGEST = 300_000
"""Bytes of a picture with all its colours."""
WHILE_BUSY_S, TO_DRAW_S = 0.3, 1.5
SCROLL_STEPS = 60
"""More than the sidebar is long; it stops at its end."""
SIDEBAR = "BIM Verify"
_round = 0
_shown: list[type[bpy.types.Panel]] = list(panels.STEP_PANELS)


def run(steps: Iterator[float]) -> None:
    """Register the extension where it is not, run the steps, end Blender. Each yields seconds to wait before the next."""
    if bpy.app.background:
        raise SystemExit("The pictures need a Blender with a window.")
    bpy.context.preferences.view.show_splash = False
    bpy.context.preferences.view.smooth_view = 0
    if not hasattr(bpy.types.Scene, "bim_verify"):
        register()

    def tick() -> float:
        try:
            return next(steps)
        except StopIteration:
            code = 0
        except Exception:
            traceback.print_exc()
            code = 1
        steps.close()
        sys.stdout.flush()
        os._exit(code)

    bpy.app.timers.register(tick, first_interval=2.0, persistent=True)


def tidy() -> None:
    """An empty scene, one view with the sidebar open, no grid."""
    for item in list(bpy.data.objects):
        bpy.data.objects.remove(item)
    space = view().spaces.active
    space.show_region_ui = True
    space.overlay.show_floor = space.overlay.show_axis_x = space.overlay.show_axis_y = False
    space.overlay.show_cursor = False
    space.shading.show_object_outline = False
    space.shading.type = "SOLID"
    space.region_3d.view_perspective = "PERSP"
    bpy.context.scene.bim_verify.show_hover = False  # wherever the mouse happens to be


def choose_tab() -> None:
    """Ours, of the sidebar; it must have been drawn before."""
    for region in view().regions:
        if region.type == "UI":
            region.active_panel_category = SIDEBAR
            region.tag_redraw()


def open_only(*names: str) -> None:
    """Fold all steps of the sidebar but these; the sidebar goes to its top."""
    global _round
    _round += 1  # Blender remembers by their names which panels were folded
    for cls in reversed(_shown):
        bpy.utils.unregister_class(cls)
    _shown.clear()
    for cls in panels.STEP_PANELS:
        opened = cls.bl_idname.removeprefix("BIMVERIFY_PT_step_") in names
        name = f"{cls.bl_idname}_{_round}"
        body = {**cls.__dict__, "bl_idname": name, "bl_options": set() if opened else {"DEFAULT_CLOSED"}}
        _shown.append(type(name, (bpy.types.Panel,), {k: v for k, v in body.items() if k not in ("bl_rna", "__dict__")}))
        bpy.utils.register_class(_shown[-1])


def scroll_to_result() -> None:
    """Down to the list of findings and the active element."""
    _scroll(bpy.ops.view2d.scroll_down)


def scroll_to_top() -> None:
    """Up to the first step."""
    _scroll(bpy.ops.view2d.scroll_up)


def _scroll(once: Callable[[], object]) -> None:
    area = view()
    region = next(r for r in area.regions if r.type == "UI")
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0], area=area, region=region):
        for _ in range(SCROLL_STEPS):
            once()


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
    if path.stat().st_size > LARGEST:
        # Colours that few pixels have are kept, too: a legend's ramp is small.
        picture.quantize(256, method=Image.Quantize.MAXCOVERAGE, kmeans=2).save(path, optimize=True)
    print(path, flush=True)
