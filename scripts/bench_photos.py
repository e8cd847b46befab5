"""From photos to poses, against the truth: what ``coregister`` makes of the images of ``render_photos.py``.

    python scripts/render_photos.py MODEL.ifc --out DIR && python scripts/bench_photos.py MODEL.ifc DIR [--starts 3]

Every image is placed from several coarse poses, drawn anew from the sigmas of ``cameras.json``. The last line says how far the
lines that were used lie from their edges as built, seen from the true pose. With ``--swapped`` every image is given for every
other's place instead, which must be refused. With ``--buildings N`` no images are read: quick ones are made by ray casting at
the same places, of N buildings whose elements stand off anew, so that errors over covariances are those of many buildings.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
from headless_entry import package
from numpy.typing import NDArray

PACKAGE = package()

from bim_verify.core.imagery.camera import Camera  # noqa: E402
from bim_verify.core.imagery.cameras_file import (  # noqa: E402
    POSITION_SIGMA_M,
    ROTATION_SIGMA_RAD,
    CameraList,
    KnownCamera,
    read_cameras,
    shifted,
)
from bim_verify.core.imagery.coregistration import CoregisterOptions, is_placed, state_of  # noqa: E402
from bim_verify.core.imagery.detect_lines import detect_lines  # noqa: E402
from bim_verify.core.imagery.line_pose import pose_difference  # noqa: E402
from bim_verify.core.imagery.model_edges import sharp_edges  # noqa: E402
from bim_verify.core.imagery.read_image import read_grey  # noqa: E402
from bim_verify.core.imagery.register_image import ImageRegistration, register_image  # noqa: E402
from bim_verify.core.imagery.visible_edges import EdgeViewer  # noqa: E402
from bim_verify.core.jobs.coregister import coregister  # noqa: E402
from bim_verify.core.model.elements import BuildingModel  # noqa: E402
from bim_verify.core.model.load import load_model  # noqa: E402
from bim_verify.core.sensing.loa import level_sigma  # noqa: E402
from bim_verify.core.simulation.photo import photograph  # noqa: E402

Array = NDArray[np.float64]
WRONG_PX, FAR_PX = 1.5, 5.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--starts", type=int, default=3, help="coarse poses per image")
    parser.add_argument("--worse", type=float, default=1.0, help="factor on the sigmas of the coarse poses")
    parser.add_argument("--loa", type=int, default=40)
    parser.add_argument("--detector", default="lsd", choices=("lsd", "hough"))
    parser.add_argument("--buildings", type=int, default=0, help="so many buildings, in quick photos")
    parser.add_argument("--swapped", action="store_true", help="give every image for every other's place")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None)
    model = load_model(options.model)
    coarse, truth = read_cameras(options.folder / "cameras.json"), read_cameras(options.folder / "truth.json")
    if options.buildings:
        many_buildings(model, truth, options.buildings, options.loa)
        return
    if options.swapped:
        swapped(model, options.folder, coarse, CoregisterOptions(loa=options.loa, detector=options.detector))
        return
    shifts = np.array(json.loads((options.folder / "truth.json").read_text())["shifts_m"])
    rows, off = [], []
    for start in range(options.starts):
        rng = np.random.default_rng((start, 3))
        known = []
        for given, true in zip(coarse.cameras, truth.cameras, strict=True):
            position, rotation = options.worse * given.position_sigma, options.worse * given.rotation_sigma
            known.append(KnownCamera(
                true.camera.moved(rng.normal(0, rotation, 3), rng.normal(0, position, 3)), position, rotation
            ))
        images = [options.folder / k.camera.name for k in known if (options.folder / k.camera.name).exists()]
        begin = time.process_time()
        result = coregister(
            model, images, CameraList(tuple(known)), CoregisterOptions(loa=options.loa, detector=options.detector, seed=start)
        )
        worked = (time.process_time() - begin) / len(images)
        for path, found in zip(images, result.registrations, strict=True):
            true = shifted(truth.of_image(path), model.origin).camera
            away = pose_difference(found.camera, true)
            if is_placed(found):
                off.append(from_true_edges(found, true, shifts))
            state = state_of(found)
            square = float(away @ np.linalg.solve(found.covariance, away)) if found.covariance is not None else math.nan
            rows.append({
                "image": path.name, "state": state, "position_m": float(np.linalg.norm(away[3:])),
                "rotation_deg": math.degrees(float(np.linalg.norm(away[:3]))), "square": square,
                "lines": sum(m.kept for m in found.matches), "seconds": worked,
            })
            print(
                f"{path.name} start {start}: {state:<9} {1000 * rows[-1]['position_m']:7.1f} mm "
                f"{rows[-1]['rotation_deg']:7.3f} deg {rows[-1]['lines']:4d} lines, error over covariance "
                f"{square:6.1f} (6 expected)", flush=True,
            )
    placed = [r for r in rows if r["state"] in ("REFINED", "PARTLY")]
    wrong = [r for r in placed if r["position_m"] > 0.05 or r["rotation_deg"] > 1.0]
    print(
        f"{len(placed)} of {len(rows)} placed, {len(wrong)} of them wrong (more than 5 cm or 1 deg); median error "
        f"{1000 * np.median([r['position_m'] for r in placed]):.1f} mm and "
        f"{np.median([r['rotation_deg'] for r in placed]):.3f} deg, worst "
        f"{1000 * max(r['position_m'] for r in placed):.1f} mm and {max(r['rotation_deg'] for r in placed):.3f} deg; "
        f"{np.mean([r['seconds'] for r in rows]):.1f} s of processor time an image."
    )
    distance = np.concatenate(off)
    wrong, far = (f"{np.mean(distance > limit):.1%} beyond {limit} px" for limit in (WRONG_PX, FAR_PX))
    print(
        f"{len(distance)} lines used: the farther end lies {np.median(distance):.2f} px from its edge as built (median), 90 % "
        f"within {np.quantile(distance, 0.9):.2f} px; {wrong}, {far}."
    )
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1), encoding="ascii")


def many_buildings(model: BuildingModel, truth: CameraList, buildings: int, loa: int) -> None:
    """Print errors of quick photos of buildings that stand off anew each time, over their covariances."""
    viewer, sigma = EdgeViewer(model, sharp_edges(model)), level_sigma(loa)
    squares, errors, unplaced = [], [], 0
    for number in range(buildings):
        rng = np.random.default_rng((number, 77))
        shift = rng.normal(0, sigma, (len(model.elements), 3))
        for given in truth.cameras:
            true = shifted(given, model.origin).camera
            lines = detect_lines(photograph(model, true, shift=shift, seed=number), true.interior)
            coarse = KnownCamera(true.moved(rng.normal(0, ROTATION_SIGMA_RAD, 3), rng.normal(0, POSITION_SIGMA_M, 3)))
            found = register_image(viewer, lines, coarse, model_sigma=sigma, seed=number)
            if found.covariance is None or not is_placed(found):
                unplaced += 1
                continue
            away = pose_difference(found.camera, true)
            squares.append(float(away @ np.linalg.solve(found.covariance, away)))
            errors.append((1000 * np.linalg.norm(away[3:]), math.degrees(float(np.linalg.norm(away[:3])))))
        print(f"{number + 1} buildings: error over covariance {np.mean(squares):.1f} in the mean (6 expected)", flush=True)
    (median_mm, median_deg), (worst_mm, worst_deg) = np.median(errors, axis=0), np.max(errors, axis=0)
    print(
        f"{len(squares)} of {len(squares) + unplaced} placed; median error {median_mm:.1f} mm and {median_deg:.3f} deg, worst "
        f"{worst_mm:.1f} mm and {worst_deg:.3f} deg; error over covariance {np.mean(squares):.1f} in the mean (6 expected), "
        f"{min(squares):.1f} to {max(squares):.1f}."
    )


def from_true_edges(found: ImageRegistration, true: Camera, shifts: Array) -> Array:
    """(N,) of the lines used: distance [px] of the farther end from the edge as built, seen by the ``true`` camera."""
    out = []
    for match in found.matches:
        if match.kept:
            b = match.bearers
            moved = match.edge + np.einsum("kij,kj->i", b.carry[0], shifts[b.element[0]])
            start, end = true.project(moved)
            along = (end - start) / np.linalg.norm(end - start)
            ends = match.line.reshape(2, 2) - start
            out.append(np.abs(ends[:, 0] * along[1] - ends[:, 1] * along[0]).max())
    return np.array(out)


def swapped(model: BuildingModel, folder: Path, coarse: CameraList, options: CoregisterOptions) -> None:
    """Print what becomes of images that show another place than their camera says."""
    viewer = EdgeViewer(model, sharp_edges(model))
    local = [shifted(k, model.origin) for k in coarse.cameras if (folder / k.camera.name).exists()]
    states: Counter[str] = Counter()
    for image in local:
        lines = detect_lines(read_grey(folder / image.camera.name), image.camera.interior, options.detector)
        for place in local:
            if place is not image:
                found = register_image(viewer, lines, place, model_sigma=level_sigma(options.loa))
                states[state_of(found)] += 1
    print(", ".join(f"{state} {count}" for state, count in sorted(states.items())))


if __name__ == "__main__":
    main()
