"""How well windows and doors are found on facades with known truth.

    python scripts/render_facades.py --out DIR
    python scripts/bench_facade.py DIR [--scale width|height|none] [--corners given|found] [--poor]

Parameters were fixed on seeds 0 to 59; seeds 240 to 299 give the figures of docs/facade.md. ``--poor`` spoils each photo
first: another light, a colour cast, dark corners, blur, noise, strong compression, 70 % of the pixels. An element of
which plants or things in the street hide more than half is left out of recall, and finding it counts neither way. Of a
photo that is refused, all elements count as not found.
``scale`` and ``aspect`` are errors of the facade's width, and of height over width, in stated standard deviations: the
shares within one and within two. ``levels`` are floors against the truth, where their number is right.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
from headless_entry import package
from PIL import Image, ImageFilter

PACKAGE = package()

from bim_verify.core.errors import BimVerifyError  # noqa: E402
from bim_verify.core.facade.grammar import grammar_of  # noqa: E402
from bim_verify.core.facade.mockup import size_sigma  # noqa: E402
from bim_verify.core.facade.records import Facade  # noqa: E402
from bim_verify.core.jobs.facade import FacadeOptions, read_facade  # noqa: E402

FOUND_IOU = 0.5
HIDDEN = 0.5
POOR_SIZE = 0.7


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seeds", choices=("odd", "even", "all"), default="all")
    parser.add_argument("--scale", choices=("width", "height", "none"), default="width")
    parser.add_argument("--corners", choices=("given", "found"), default="given", help="true ones, one pixel off, or none")
    parser.add_argument("--poor", action="store_true", help="spoil the photos first, as a poor camera does")
    parser.add_argument("--verbose", action="store_true")
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None)
    with tempfile.TemporaryDirectory() as folder:
        run(options, Path(folder))


def run(options: argparse.Namespace, folder: Path) -> None:
    """Score all photos; ``folder`` is for spoiled ones."""
    total: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    warm = True
    for path in sorted(options.folder.glob("facade_*.json")):
        seed = int(path.stem.split("_")[1])
        if options.seeds != "all" and seed % 2 != (options.seeds == "odd"):
            continue
        truth = json.loads(path.read_text())
        known = {"width": {"width": truth["width_m"]}, "height": {"height": truth["height_m"]}, "none": {}}[options.scale]
        rng = np.random.default_rng((seed, 34))
        corners = np.array(truth["corners_px"]) + rng.normal(0.0, 1.0, (4, 2))
        photo = path.with_suffix(".jpg")
        if options.poor:
            photo = spoiled(photo, folder, seed)
            corners, truth["corners_px"] = (POOR_SIZE * (np.asarray(c) + 0.5) - 0.5 for c in (corners, truth["corners_px"]))
        settings = FacadeOptions(corners=(corners,) if options.corners == "given" else (), **known)
        try:
            if warm:
                read_facade(photo, settings)
                warm = False
            start, used = time.perf_counter(), time.process_time()
            found = read_facade(photo, settings)
        except BimVerifyError as error:
            print(error)
            missed = [0.0 for e in truth["elements"] if e["hidden"] <= HIDDEN]
            for style in (truth["style"], "all"):
                total[style]["hit"] += missed
            continue
        seconds = time.perf_counter() - start
        row = score(found, truth)
        row["seconds"], row["processor"] = [seconds], [time.process_time() - used]
        true_aspect, sigma = truth["height_m"] / truth["width_m"], max(found.scale.aspect_sigma, 1e-6)
        row["aspect"] = [abs(found.scale.height / found.scale.width / true_aspect - 1) / sigma]
        row["scale"] = [abs(found.scale.width / truth["width_m"] - 1) / found.scale.relative_sigma]
        reach = np.ptp(np.array(truth["corners_px"]), axis=0).max()
        row["corner"] = [*(np.linalg.norm(found.corners - np.array(truth["corners_px"]), axis=1) / reach)]
        for name, values in row.items():
            total[truth["style"]][name] += values
            total["all"][name] += values
        if options.verbose:
            print(f"{path.stem} {truth['style']:9s} {line(row)}", flush=True)
    for style, row in sorted(total.items(), key=lambda item: item[0] == "all"):
        print(f"{style:9s} {line(row)}")


def spoiled(photo: Path, folder: Path, seed: int) -> Path:
    """A photo as a poor camera takes it, in ``folder``."""
    rng = np.random.default_rng((seed, 35))
    with Image.open(photo) as image:
        size = (round(POOR_SIZE * image.width), round(POOR_SIZE * image.height))
        small = image.convert("RGB").resize(size, Image.Resampling.LANCZOS).filter(ImageFilter.GaussianBlur(0.6))
    pixels = np.asarray(small, dtype=np.float64) / 255.0
    y, x = np.mgrid[-1 : 1 : size[1] * 1j, -1 : 1 : size[0] * 1j]
    pixels = pixels ** rng.uniform(0.7, 1.5) * rng.uniform(0.85, 1.15, 3) * (1.0 - 0.2 * (x * x + y * y))[..., None]
    pixels += rng.normal(0.0, 0.025, pixels.shape)
    out = folder / photo.name
    Image.fromarray((255.0 * np.clip(pixels, 0.0, 1.0)).astype(np.uint8)).save(out, quality=45)
    return out


def line(row: dict[str, list[float]]) -> str:
    true, false = sum(row["true"]), sum(row["false"])
    error = np.abs(row["dimension"]) if row["dimension"] else np.array([np.nan])
    return (
        f"precision {true / max(true + false, 1):.3f} recall {np.mean(row['hit']) if row['hit'] else np.nan:.3f} "
        f"kind {np.mean(row['kind'] or [np.nan]):.3f} shape {np.mean(row['shape'] or [np.nan]):.3f} "
        f"groups {np.mean(row['groups'] or [np.nan]):.3f} "
        f"dimension median {100 * np.median(error):.1f} cm p90 {100 * np.quantile(error, 0.9):.1f} cm "
        f"place {100 * np.median(np.abs(row['place'] or [np.nan])):.1f} cm floors {np.mean(row['floors']):.2f} "
        f"sizes within 1.96 sigma {np.mean(row['covered'] or [np.nan]):.2f} "
        f"levels {np.mean(row['level'] or [np.nan]):+.2f} m, of size {np.mean(np.abs(row['level'] or [np.nan])):.2f} m "
        f"seconds {np.mean(row['seconds'] or [np.nan]):.2f} processor {np.mean(row['processor'] or [np.nan]):.2f} "
        f"scale {np.mean(np.array(row['scale']) < 1):.2f}, {np.mean(np.array(row['scale']) < 2):.2f} "
        f"aspect {np.mean(np.array(row['aspect']) < 1):.2f}, {np.mean(np.array(row['aspect']) < 2):.2f} "
        f"corners median {100 * np.median(row['corner']):.1f} % p90 {100 * np.quantile(row['corner'], 0.9):.1f} % "
        f"grammar off by {100 * max(row['grammar']):.1f} cm at most, leaves out {sum(row['left_out']):.0f}, "
        f"{np.mean(row['rules']):.2f} rules an element"
    )


def score(found: Facade, truth: dict[str, Any]) -> dict[str, list[float]]:
    row: dict[str, list[float]] = {
        n: [] for n in ("true", "false", "hit", "kind", "shape", "groups", "dimension", "covered", "place", "level", "seconds")
    }
    boxes = np.array([[b.x0, b.z0, b.x1, b.z1] for b in found.boxes]).reshape(-1, 4)
    # with no known length everything is compared at the true width
    boxes = boxes * (truth["width_m"] / found.scale.width if found.scale.source == "FLOORHEIGHT" else 1.0)
    true = np.array([e["box_m"] for e in truth["elements"]])
    low, high = np.maximum(boxes[:, None, :2], true[None, :, :2]), np.minimum(boxes[:, None, 2:], true[None, :, 2:])
    both = np.prod(np.clip(high - low, 0, None), axis=2)
    area = [np.prod(b[:, 2:] - b[:, :2], axis=1) for b in (boxes, true)]
    iou = both / (area[0][:, None] + area[1][None] - both)
    used: dict[int, int] = {}
    for flat in np.argsort(-iou, axis=None):
        i, j = np.unravel_index(flat, iou.shape)
        if iou[i, j] >= FOUND_IOU and i not in used and j not in used.values():
            used[int(i)] = int(j)
    hidden = np.array([e["hidden"] > HIDDEN for e in truth["elements"]])
    row["hit"] = [float(j in used.values()) for j in range(len(true)) if not hidden[j]]
    for i, box in enumerate(found.boxes):
        j = used.get(i)
        if j is None:
            row["false"].append(1.0)
            continue
        if hidden[j]:
            continue
        element = truth["elements"][j]
        row["true"].append(1.0)
        row["kind"].append(float(box.kind == element["kind"]))
        row["shape"].append(float((box.rise > 0) == (element["rise_m"] > 0.1)))
        row["dimension"] += [*((boxes[i, 2:] - boxes[i, :2]) - (true[j, 2:] - true[j, :2]))]
        for axis, size in enumerate((box.width, box.height)):
            row["covered"].append(float(abs(row["dimension"][axis - 2]) < 1.96 * size_sigma(found, size, axis)))
        row["place"] += [*(0.5 * (boxes[i, 2:] + boxes[i, :2]) - 0.5 * (true[j, 2:] + true[j, :2]))]
    pairs = [(a, b) for a in used for b in used if a < b]
    row["groups"] = [
        float(
            (found.boxes[a].type == found.boxes[b].type)
            == (truth["elements"][used[a]]["type"] == truth["elements"][used[b]]["type"])
        )
        for a, b in pairs
    ]
    if len(found.levels) == len(truth["levels_m"]) and found.scale.source != "FLOORHEIGHT":
        row["level"] = [a - b for a, b in zip(found.levels[1:], truth["levels_m"][1:], strict=True)]
    split = grammar_of(found)
    row["grammar"], row["left_out"] = [split.largest_error], [float(len(split.left_out))]
    row["rules"] = [len(split.rules) / max(len(found.boxes), 1)]
    row["floors"] = [float(len(found.levels) == len(truth["levels_m"]))]
    return row


if __name__ == "__main__":
    main()
