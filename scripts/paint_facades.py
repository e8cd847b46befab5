"""Painted photos of facades with known truth: flat colours and grain, no Blender; another kind of picture than rendered ones.

    python scripts/paint_facades.py --out DIR [--images 60] [--first 0] [--size 900]

Writes ``facade_NN.jpg`` and ``facade_NN.json`` as ``render_facades.py`` does; nothing stands before these facades.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from headless_entry import package
from PIL import Image

PACKAGE = package()

from bim_verify.core.simulation.facade_photo import paint_facade, street_camera, truth_of  # noqa: E402
from bim_verify.core.simulation.facade_plan import facade_plan  # noqa: E402


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--images", type=int, default=60)
    parser.add_argument("--first", type=int, default=0, help="seed of the first")
    parser.add_argument("--size", type=int, default=900, help="pixels along the longer side")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    for seed in range(options.first, options.first + options.images):
        plan = facade_plan(seed)
        camera = street_camera(plan, options.size, np.random.default_rng((seed, 32)))
        data = truth_of(plan, camera)
        for element in data["elements"]:
            element["hidden"] = 0.0
        Image.fromarray(paint_facade(plan, camera, seed)).save(options.out / f"facade_{seed:02d}.jpg", quality=85)
        (options.out / f"facade_{seed:02d}.json").write_text(json.dumps(data), encoding="ascii")


if __name__ == "__main__":
    main()
