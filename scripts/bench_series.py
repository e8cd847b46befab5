"""A series of photos along a corridor: how far it drifts, and how far edges of the model pull it straight.

    python scripts/bench_series.py [--images 60] [--runs 5] [--quick] [--json FILE]

The corridor is 30 m long, has doors and beams, and is built with LOA40. Tie points are found again in the next three images
only, so errors add up along the way. The series hangs on six control points at its start, without and with lines in every
tenth image. Errors are those of the projection centres, against the truth and against what the adjustment says of them.
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
from bim_verify.core.simulation.photo_block import edge_lines, photograph_block, walk  # noqa: E402

Array = NDArray[np.float64]
LOA, LENGTH_M, LINE_PX = 40, 30.0, 0.3
EVERY = 10
COARSE_M, COARSE_DEG = 0.15, 1.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--images", type=int, default=60)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--quick", action="store_true", help="two runs")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None)
    rows: dict[str, list[tuple[Array, Array, Array]]] = {"control at the start": [], "lines in every tenth image": []}
    begin = time.perf_counter()
    for seed in range(2 if options.quick else options.runs):
        for name, row in run(options.images, seed).items():
            rows[name].append(row)
    found = {}
    for name, runs in rows.items():
        away, sigma, square = (np.array([r[k] for r in runs]) for k in range(3))
        found[name] = {
            "rms_m": float(np.sqrt((away**2).mean())), "worst_m": float(away.max()),
            "predicted_rms_m": float(np.sqrt((sigma**2).mean())), "square": float(square.mean()),
        }
        print(
            f"{name}: centres off by {1000 * found[name]['rms_m']:.1f} mm (rms), {1000 * away.max():.1f} mm at worst; "
            f"predicted {1000 * found[name]['predicted_rms_m']:.1f} mm; squared error over covariance {square.mean():.2f} "
            f"(6 expected)"
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


def run(images: int, seed: int) -> dict[str, tuple[Array, Array, Array]]:
    """Per image of one series: error [m], predicted standard deviation [m], squared error over covariance."""
    model = corridor_model()
    rng = np.random.default_rng((seed, 41))
    shift = rng.normal(0, level_sigma(LOA), (len(model.elements), 3))
    scene = RayScene(model, shift)
    built = building_as(model, shift)
    truth = walk(LENGTH_M, images)
    problem, points = photograph_block(scene, truth, 70, seed, control=0, track=3, free=())
    near = np.argsort(np.linalg.norm(points - truth[0].position, axis=1), kind="stable")
    known = near[:: max(len(near) // 60, 1)][:6]
    control = Control(known, points[known] + rng.normal(0, 0.002, (6, 3)), np.full((6, 3), 0.002))
    viewer_built, viewer = EdgeViewer(built, sharp_edges(built)), EdgeViewer(model, sharp_edges(model))
    selected = sorted({*range(0, images, EVERY), images - 1})
    lines = {k: edge_lines(viewer_built, truth[k], LINE_PX, rng) for k in selected}
    alone = adjust_bundle(replace(problem, control=control))
    tied = adjust_series(
        replace(problem, control=control), lines, viewer, np.zeros(3), model_sigma=level_sigma(LOA), position_sigma=COARSE_M,
        rotation_sigma=math.radians(COARSE_DEG), seed=seed, robust=False,
    )
    placed = sum(r.estimate is not None for r in tied.registrations.values())
    print(f"  run {seed + 1}: {len(points)} tie points, {placed} of {len(lines)} selected images placed")
    return {"control at the start": judged(alone, truth), "lines in every tenth image": judged(tied.bundle, truth)}


def building_as(model: BuildingModel, shift: Array) -> BuildingModel:
    """The model as built."""
    moved = model.vertices.copy()
    for e in range(len(model.elements)):
        rows = np.unique(model.triangles[model.triangle_element == e])
        moved[rows] += shift[e]
    return replace(model, vertices=moved)


def judged(found: BundleResult, truth: tuple[Camera, ...]) -> tuple[Array, Array, Array]:
    """(C,) error, predicted standard deviation, and squared error over covariance of pose."""
    away = np.array([pose_difference(a, b) for a, b in zip(found.cameras, truth, strict=True)])
    square = np.einsum("ci,cij,cj->c", away, np.linalg.inv(found.pose_covariance), away)
    return (
        np.linalg.norm(away[:, 3:], axis=1), np.sqrt(np.einsum("cii->c", found.pose_covariance[:, 3:, 3:])), square
    )


if __name__ == "__main__":
    main()
