"""How long Blender's window stands still while a model and a result of many elements are put into the scene.

    python scripts/bench_show.py [--elements 5000] [--vertices 1000000]
    blender --background --python scripts/bench_show.py -- --elements 5000

Columns on a square grid, scanned by three simulated stations and verified. What runs beside the window is not timed. Prints
the time by the clock and that of the processor for each step on the main thread, in which the window does not answer: the
model shown, the result the first time, the result again (a second verification), the colours changed, another model shown.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from headless_entry import package

PACKAGE = package()

from bim_verify import bim_verify_addon  # noqa: E402
from bim_verify.bim_verify_addon import paint, scene, surface_grid  # noqa: E402
from bim_verify.core.jobs import verify  # noqa: E402
from bim_verify.core.options import VerifyOptions  # noqa: E402
from bim_verify.core.simulation.box_building import box, building_model, scan  # noqa: E402

GRID_M = 3.0
SIDE_M, HEIGHT_M = 0.4, 3.0
STEP_DEG = 0.5


def main(arguments: list[str]) -> None:
    """Run the steps and print their times."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--elements", type=int, default=5000)
    parser.add_argument("--vertices", type=int, default=1_000_000, help="Result vertices, as in the expert settings")
    asked = parser.parse_args(arguments)
    bim_verify_addon.register()
    across = math.ceil(math.sqrt(asked.elements))
    corner = GRID_M * np.array([(k % across, k // across) for k in range(asked.elements)])
    boxes = [box(f"Column {k}", (x, y, 0.0), (x + SIDE_M, y + SIDE_M, HEIGHT_M)) for k, (x, y) in enumerate(corner)]
    model = building_model(boxes)
    middle = np.array([0.5, 0.2, 0.8])[:, None] * GRID_M * across * np.array([[1.0, 1.0, 0.0]])
    stations = middle + np.array([1.5, 1.5, 1.6])
    result = verify(model, scan(model, stations, step_deg=STEP_DEG), VerifyOptions())
    display = surface_grid.make_display(result, asked.vertices)
    target = bpy.context.scene
    print(f"{asked.elements} elements, {len(display.grid.vertices):,} result vertices")
    timed("model shown", lambda: scene.show_model(target, model))
    for what in ("result shown", "result shown again"):
        timed(what, lambda: (scene.show_result(target, result, display), paint.refresh(target)))
    target.bim_verify.color_mode = "STATUS"
    timed("colours changed", lambda: setattr(target.bim_verify, "color_mode", "DEVIATION"))
    other = building_model(boxes[: asked.elements // 2])
    timed("another model of half as many", lambda: scene.show_model(target, other))


def timed(what: str, step: Callable[[], object]) -> None:
    """Do it and print how long it took."""
    begin, worked = time.perf_counter(), time.process_time()
    step()
    print(f"{what}: {time.perf_counter() - begin:.2f} s, {time.process_time() - worked:.2f} s of processor time", flush=True)


if __name__ == "__main__":
    main(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:])
    sys.stdout.flush()
    os._exit(0)
