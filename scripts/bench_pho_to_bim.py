"""Verdicts from photos: tie points, and tie points with a dense cloud, of a building built otherwise than planned.

    python scripts/bench_pho_to_bim.py [--campaigns 3] [--loa 30] [--quick] [--json FILE]
    python scripts/bench_pho_to_bim.py --photos 200

Four rooms, photographed by rings of photos in each room (0.5 pixels of noise, twelve control points of 2 mm). A block is
adjusted, written and verified as a user would. In every campaign four elements are missing and six stand 4 to 15 cm off,
along their thinnest direction.
Accuracy counts elements that tie points say anything about; what cannot be seen must be NOTOBSERVED.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np
from headless_entry import package
from numpy.typing import NDArray

PACKAGE = package()

from bim_verify.core.imagery.bundle import adjust_bundle  # noqa: E402
from bim_verify.core.imagery.bundle_project import adjusted_project  # noqa: E402
from bim_verify.core.jobs import verify  # noqa: E402
from bim_verify.core.model.raycast import RayScene  # noqa: E402
from bim_verify.core.options import VerifyOptions  # noqa: E402
from bim_verify.core.scans.write_ply import write_ply  # noqa: E402
from bim_verify.core.simulation.box_building import building_model, four_room_stations, four_rooms  # noqa: E402
from bim_verify.core.simulation.photo_block import cameras_around, dense_cloud, photograph_block  # noqa: E402

Array = NDArray[np.float64]
MISSING, MOVED = 4, 6
LOOSE = ("cabinet", "table", "column", "beam")
EXPECTED = {"missing": ("ABSENT",), "moved": ("DEVIATING",), "as planned": ("CONFIRMED", "PARTIAL")}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--campaigns", type=int, default=3)
    parser.add_argument("--loa", type=int, default=30)
    parser.add_argument("--quick", action="store_true", help="one campaign with fewer photos")
    parser.add_argument("--photos", type=int, help="only: how long one verification with so many photos takes")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None)
    if options.photos:
        timed(options.photos, options.loa)
        return
    found: dict[str, Counter[str]] = {"tie points": Counter(), "with dense points": Counter()}
    for seed in range(1 if options.quick else options.campaigns):
        for name, counts in campaign(seed, options.loa, options.quick).items():
            found[name].update(counts)
    for name, counts in found.items():
        print(f"{name}:")
        for kind in EXPECTED:
            total = sum(n for (k, _), n in ((key.split("|"), n) for key, n in counts.items()) if k == kind)
            right = sum(counts[f"{kind}|{status}"] for status in EXPECTED[kind])
            silent = counts[f"{kind}|NOTOBSERVED"]
            given = ", ".join(f"{k.split('|')[1]} {n}" for k, n in sorted(counts.items()) if k.startswith(kind))
            print(f"  {kind}: {right} of {total - silent} right, {silent} not observed ({given})")
    if options.json:
        options.json.write_text(json.dumps(found, indent=1), encoding="ascii")


def timed(count: int, loa: int) -> None:
    """Processor time of one verification with ``count`` photos of the building as planned."""
    model = building_model(four_rooms())
    steps = np.random.default_rng(5).uniform(-0.9, 0.9, (count // 36 + 1, 1, 3)) * [1.0, 1.0, 0.15]
    cameras = cameras_around((four_room_stations()[:4] + steps).reshape(-1, 3), 9)[:count]
    problem, points = photograph_block(RayScene(model), cameras, 100, 0, free=())
    with tempfile.TemporaryDirectory() as folder:
        project = Path(folder) / "adjusted.json"
        project.write_text(json.dumps(adjusted_project(problem, adjust_bundle(problem), "bench")), encoding="ascii")
        begin = time.process_time()
        result = verify(model, [project], VerifyOptions(loa=loa, sample_spacing=0.08))
        print(
            f"{count} photos, {len(points)} tie points, {len(problem.observed)} rays, {len(result.samples)} query positions: "
            f"{time.process_time() - begin:.0f} s of processor time"
        )


def campaign(seed: int, loa: int, quick: bool) -> dict[str, Counter[str]]:
    """Verdicts of one campaign, counted by ``truth|status``."""
    boxes = four_rooms()
    model = building_model(boxes)
    rng = np.random.default_rng((seed, 31))
    loose = rng.permutation([k for k, b in enumerate(boxes) if b.name.startswith(LOOSE)])
    walls = rng.permutation([k for k, b in enumerate(boxes) if "wall" in b.name or "partition" in b.name])
    shift = np.zeros((len(boxes), 3))
    truth = ["as planned"] * len(boxes)
    for k in loose[:MISSING]:
        shift[k], truth[k] = np.nan, "missing"
    for k in [*loose[MISSING : MISSING + MOVED // 2], *walls[: MOVED - MOVED // 2]]:
        shift[k][boxes[k].thin_axis] = rng.choice([-1, 1]) * rng.uniform(0.04, 0.15)
        truth[k] = "moved"
    scene = RayScene(model, shift)
    stands = four_room_stations()[:4]
    steps = ((0.0, 0.0, 0.0), (0.9, 0.3, 0.1), (-0.8, 0.5, -0.1), (0.4, -0.8, 0.2))
    places = np.concatenate([stands + step for step in (steps[:2] if quick else steps)])
    cameras = cameras_around(places, 6 if quick else 9)
    begin = time.perf_counter()
    problem, points = photograph_block(scene, cameras, 120 if quick else 150, seed)
    adjusted = adjust_bundle(problem)
    sigma = float(np.median(np.sqrt(np.einsum("pii->p", adjusted.point_covariance) / 3)))
    out: dict[str, Counter[str]] = {}
    with tempfile.TemporaryDirectory() as folder:
        project, dense = Path(folder) / "adjusted.json", Path(folder) / "dense.ply"
        project.write_text(json.dumps(adjusted_project(problem, adjusted, "bench")), encoding="ascii")
        cloud, normal = dense_cloud(scene, cameras[:: 1 if quick else 2], 60.0 if quick else 40.0, 1.5 * sigma, seed)
        write_ply(dense, {
            "x": cloud[:, 0], "y": cloud[:, 1], "z": cloud[:, 2],
            "nx": normal[:, 0], "ny": normal[:, 1], "nz": normal[:, 2],
        })
        print(
            f"Campaign {seed + 1}: {len(cameras)} photos, {len(points)} tie points of {1000 * sigma:.1f} mm (median), "
            f"{len(cloud)} dense points, made in {time.perf_counter() - begin:.0f} s"
        )
        for name, files in (("tie points", ()), ("with dense points", (str(dense),))):
            begin = time.perf_counter()
            result = verify(model, [project], VerifyOptions(loa=loa, dense=files, sample_spacing=0.08 if quick else 0.04))
            out[name] = Counter(f"{t}|{v.status}" for t, v in zip(truth, result.verdicts, strict=True))
            print(f"  {name}: {time.perf_counter() - begin:.0f} s, coverage {result.summary()['coverage']:.0%}")
            for t, v in zip(truth, result.verdicts, strict=True):
                if v.status not in (*EXPECTED[t], "NOTOBSERVED"):
                    print(f"    {v.name} is {t}: {v.status}. {v.reason}")
    return out


if __name__ == "__main__":
    main()
