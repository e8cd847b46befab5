"""A series of photos along a corridor: how far it drifts, and how far edges of the model pull it straight.

    python scripts/bench_series.py [--images 60] [--runs 5] [--loop] [--quick] [--json FILE]

The corridor is 30 m long, has doors and beams, and is built with LOA40. Tie points are found again in the next three images
only, so errors add up along the way. The series hangs on six control points at its start, without and with lines in every
tenth image. With ``--loop`` the corridor goes around a core of 9.6 m, and the series ends where it began, without and with tie
points that the last images share with the first. Errors are those of the projection centres, against the truth and against
what the adjustment says of them.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from headless_entry import package
from numpy.typing import NDArray

PACKAGE = package()

from bim_verify.core.imagery.bundle import BundleResult, adjust_bundle  # noqa: E402
from bim_verify.core.imagery.bundle_problem import Control  # noqa: E402
from bim_verify.core.imagery.camera import Camera  # noqa: E402
from bim_verify.core.imagery.line_pose import pose_difference  # noqa: E402
from bim_verify.core.imagery.model_edges import sharp_edges  # noqa: E402
from bim_verify.core.imagery.series import adjust_series  # noqa: E402
from bim_verify.core.imagery.visible_edges import EdgeViewer  # noqa: E402
from bim_verify.core.model.elements import BuildingModel  # noqa: E402
from bim_verify.core.model.raycast import RayScene  # noqa: E402
from bim_verify.core.sensing.loa import level_sigma  # noqa: E402
from bim_verify.core.simulation.box_building import box, building_model, corridor  # noqa: E402
from bim_verify.core.simulation.photo_block import (  # noqa: E402
    as_built,
    edge_lines,
    photograph_block,
    walk,
    walk_around,
)

Array = NDArray[np.float64]
LOA, LENGTH_M, LINE_PX = 40, 30.0, 0.3
EVERY = 10
COARSE_M, COARSE_DEG = 0.15, 1.0
RING_M, WIDE_M, CORNER_M = 14.4, 2.4, 1.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--images", type=int, default=60)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--loop", action="store_true", help="a series that ends where it began")
    parser.add_argument("--quick", action="store_true", help="two runs")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None)
    rows: dict[str, list[tuple[Array, Array, Array]]] = {}
    begin = time.perf_counter()
    for seed in range(2 if options.quick else options.runs):
        for name, row in (run_loop if options.loop else run)(options.images, seed).items():
            rows.setdefault(name, []).append(row)
    found = {}
    for name, runs in rows.items():
        away, sigma, square = (np.array([r[k] for r in runs]) for k in range(3))
        found[name] = {
            "rms_m": float(np.sqrt((away**2).mean())), "worst_m": float(away.max()),
            "predicted_rms_m": float(np.sqrt((sigma**2).mean())), "square": float(square.mean()),
            "square_of_runs": square.mean(axis=1).tolist(),
        }
        # the images of a run share the building's errors: only runs are independent
        off = np.std(square.mean(axis=1), ddof=1) / math.sqrt(len(square)) if len(square) > 1 else math.nan
        print(
            f"{name}: centres off by {1000 * found[name]['rms_m']:.1f} mm (rms), {1000 * away.max():.1f} mm at worst; "
            f"predicted {1000 * found[name]['predicted_rms_m']:.1f} mm; squared error over covariance {square.mean():.2f} "
            f"+- {off:.1f} (6 expected); at the last image {1000 * np.sqrt((away[:, -1] ** 2).mean()):.1f} mm"
        )
    print(f"{options.images} images, {len(next(iter(rows.values())))} runs, {time.perf_counter() - begin:.0f} s")
    if options.json:
        options.json.write_text(json.dumps(found, indent=1), encoding="ascii")


def corridor_model() -> BuildingModel:
    """With doors on both sides and beams under the ceiling."""
    boxes = corridor(ends=True)
    for k, x in enumerate(np.arange(2.0, 28.0, 3.5)):
        side = (2.32, 2.4) if k % 2 else (0.0, 0.08)
        boxes.append(box(f"door {k}", (x, side[0], 0.0), (x + 0.95, side[1], 2.1)))
        boxes.append(box(f"beam {k}", (x + 1.6, 0.0, 2.35), (x + 1.85, 2.4, 2.6)))
    return building_model(boxes)


def ring_model() -> BuildingModel:
    """A corridor around a core, with doors on both sides and beams under the ceiling."""
    half, inner = RING_M / 2, RING_M / 2 - WIDE_M
    boxes = [
        box("floor", (-half, -half, -0.2), (half, half, 0)), box("ceiling", (-half, -half, 2.6), (half, half, 2.8)),
        box("core", (-inner, -inner, 0), (inner, inner, 2.6)),
        box("south", (-half, -half - 0.2, 0), (half, -half, 2.6)), box("north", (-half, half, 0), (half, half + 0.2, 2.6)),
        box("west", (-half - 0.2, -half, 0), (-half, half, 2.6)), box("east", (half, -half, 0), (half + 0.2, half, 2.6)),
    ]
    for k, at in enumerate(np.arange(-inner + 0.8, inner - 1.5, 3.0)):
        for name, sign in (("low", -1.0), ("high", 1.0)):
            outside = sorted((sign * half, sign * (half - 0.08)))
            inside = sorted((sign * inner, sign * (inner + 0.08)))
            beam = sorted((sign * half, sign * inner))
            door = inside if k % 2 else outside
            for axis in (0, 1):
                parts = (("door", (at, at + 0.95), door, 0.0, 2.1), ("beam", (at + 1.4, at + 1.65), beam, 2.35, 2.6))
                for kind, along, across, low, high in parts:
                    x, y = (along, across) if axis == 0 else (across, along)
                    boxes.append(box(f"{kind} {name} {axis} {k}", (x[0], y[0], low), (x[1], y[1], high)))
    return building_model(boxes)


def run(images: int, seed: int) -> dict[str, tuple[Array, Array, Array]]:
    """Per image of one series: error [m], predicted standard deviation [m], squared error over covariance."""
    built = Series(corridor_model(), walk(LENGTH_M, images), seed)
    alone, tied = built.adjust(closed=False, lines=False), built.adjust(closed=False, lines=True)
    return {"control at the start": alone, "lines in every tenth image": tied}


def run_loop(images: int, seed: int) -> dict[str, tuple[Array, Array, Array]]:
    """As ``run``, around the core."""
    built = Series(ring_model(), walk_around(RING_M - WIDE_M, images, CORNER_M), seed)
    return {
        f"{'closed' if closed else 'open'}, {'lines in every tenth image' if lines else 'control at the start'}":
        built.adjust(closed=closed, lines=lines) for closed in (False, True) for lines in (False, True)
    }


class Series:
    """Photos of a building whose elements stand off, along a walk."""

    def __init__(self, model: BuildingModel, truth: tuple[Camera, ...], seed: int) -> None:
        rng = np.random.default_rng((seed, 41))
        shift = rng.normal(0, level_sigma(LOA), (len(model.elements), 3))
        built = as_built(model, shift)
        self.truth, self.seed, self.rng = truth, seed, rng
        self.scene = RayScene(model, shift)
        self.viewer_built, self.viewer = EdgeViewer(built, sharp_edges(built)), EdgeViewer(model, sharp_edges(model))
        count = len(truth)
        self.lines = {
            k: edge_lines(self.viewer_built, truth[k], LINE_PX, rng) for k in sorted({*range(0, count, EVERY), count - 1})
        }

    def adjust(self, *, closed: bool, lines: bool) -> tuple[Array, Array, Array]:
        """Error, its prediction, and squared error over covariance, per image."""
        problem, points = photograph_block(
            self.scene, self.truth, 70, self.seed, control=0, track=3, closed=closed, free=()
        )
        seen = problem.observed.point[problem.observed.camera == 0]
        near = seen[np.argsort(np.linalg.norm(points[seen] - self.truth[0].position, axis=1), kind="stable")]
        known = near[:: max(len(near) // 60, 1)][:6]
        rng = np.random.default_rng((self.seed, 42))
        control = Control(known, points[known] + rng.normal(0, 0.002, (6, 3)), np.full((6, 3), 0.002))
        hung = replace(problem, control=control)
        if not lines:
            return judged(adjust_bundle(hung), self.truth)
        tied = adjust_series(
            hung, self.lines, self.viewer, np.zeros(3), model_sigma=level_sigma(LOA), position_sigma=COARSE_M,
            rotation_sigma=math.radians(COARSE_DEG), seed=self.seed, robust=False,
        )
        placed = sum(r.estimate is not None for r in tied.registrations.values())
        print(f"  run {self.seed + 1}: {len(points)} tie points, {placed} of {len(self.lines)} selected images placed")
        return judged(tied.bundle, self.truth)


def judged(found: BundleResult, truth: tuple[Camera, ...]) -> tuple[Array, Array, Array]:
    """(C,) error, predicted standard deviation, and squared error over covariance of pose."""
    away = np.array([pose_difference(a, b) for a, b in zip(found.cameras, truth, strict=True)])
    square = np.einsum("ci,cij,cj->c", away, np.linalg.inv(found.pose_covariance), away)
    return (
        np.linalg.norm(away[:, 3:], axis=1), np.sqrt(np.einsum("cii->c", found.pose_covariance[:, 3:, 3:])), square
    )


if __name__ == "__main__":
    main()
