"""How a Blender window answers while a verification runs beside it: gaps between the ticks of a timer, and Esc.

    blender --factory-startup --enable-event-simulate --window-geometry 0 0 1600 1000 --python scripts/bench_window.py
        [-- --inputs DIR --points N]

Verifies the demo house with its scan of 4.4 million points twice: the first time to the end (its kernels may be compiled
in it), then again until half of it is done and Esc is pressed. A tick comes every 20 ms when nothing else holds the window.
``--inputs`` keeps the demo's files there and takes those that it holds; ``--points``: to how many the cloud is thinned.
Drawing counts as well: the view is drawn anew when a cloud or a result has come, and while it is turned.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))

from blender_window import TO_DRAW_S, choose_tab, in_view, run, until_idle, view

from bim_verify.bim_verify_addon import point_display
from bim_verify.bim_verify_addon.session import SESSION
from bim_verify.core.simulation.demo import make_demo

TICK_S = 0.02
REDRAWS = 5
HALF = 0.5
LONGEST_S = 900.0


class Ticks:
    """The gaps between the ticks of a timer since they were last printed."""

    def __init__(self) -> None:
        self._last, self._gaps = time.monotonic(), list[float]()
        bpy.app.timers.register(self._tick)

    def _tick(self) -> float:
        now = time.monotonic()
        self._gaps.append(now - self._last)
        self._last = now
        return TICK_S

    def say(self, what: str) -> None:
        """Print and forget them."""
        gaps, self._gaps = sorted(self._gaps), []
        if gaps:
            spread = (gaps[len(gaps) // 2], gaps[int(0.95 * len(gaps))], gaps[-1])
            print(f"{what}: {len(gaps)} ticks, {', '.join(f'{g:.2f}' for g in spread)} s (median, 95 %, longest)", flush=True)


def story(folder: Path, points: int | None) -> Iterator[float]:
    """Yields seconds to wait before the next step."""
    view().spaces.active.show_region_ui = True
    yield TO_DRAW_S
    choose_tab()
    yield TO_DRAW_S
    if not (folder / "scan.e57").exists():
        make_demo(folder)
    settings = bpy.context.scene.bim_verify
    if points is not None:
        settings.display_points = points
    print(f"Points shown: {point_display.points_shown(settings):,}; drawn by the processor: {point_display.emulated()}")
    ticks = Ticks()
    for name, operator in (("house.ifc", bpy.ops.bim_verify.import_ifc), ("scan.e57", bpy.ops.bim_verify.import_scan)):
        with in_view():
            operator("INVOKE_DEFAULT", filepath=str(folder / name))
        yield from until_idle()
        ticks.say(f"While {name} is read and drawn")
    for _ in range(REDRAWS):
        view().tag_redraw()
        yield TICK_S
    ticks.say("While the view is drawn and nothing runs")

    for until in (1.0, HALF):
        begun, before = time.monotonic(), facts()
        with in_view():
            bpy.ops.bim_verify.verify("INVOKE_DEFAULT")
        while SESSION.job is not None and SESSION.job.fraction < until and time.monotonic() - begun < LONGEST_S:
            yield TICK_S
        ticks.say(f"Verification of {time.monotonic() - begun:.0f} s, to {100 * until:.0f} %")
        if until == 1.0:
            yield from until_idle()
            ticks.say("While the result is put into the scene and drawn")
    pressed = time.monotonic()
    bpy.context.window_manager.windows[0].event_simulate(type="ESC", value="PRESS")
    while SESSION.job is not None:
        yield TICK_S
    print(f"Esc: {time.monotonic() - pressed:.2f} s; scene as before: {facts() == before}", flush=True)
    while SESSION.ending is not None and SESSION.ending.is_alive():
        yield TICK_S
    print(f"Its thread ended {time.monotonic() - pressed:.1f} s after Esc", flush=True)
    ticks.say("While it ends")


def facts() -> list[tuple[str, int, int]]:
    """What a scene holds."""
    return sorted(
        (i.name, len(i.data.vertices), len(i.data.attributes)) for i in bpy.context.scene.objects if i.type == "MESH"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inputs", type=Path)
    parser.add_argument("--points", type=int)
    arguments = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else [])

    def steps() -> Iterator[float]:
        with tempfile.TemporaryDirectory(prefix="bim_verify_window_") as folder:
            yield from story((arguments.inputs or Path(folder)).resolve(), arguments.points)

    run(steps())


main()
