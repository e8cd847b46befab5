"""How right and how fast is ``reconstruct``? Storeys made in code, furnished, scanned, and compared with their truth.

    python scripts/bench_reconstruct.py [--cases flat,offices,slanted,two] [--seed 1] [--step-deg 0.18]
    python scripts/bench_reconstruct.py --cases r101,r102,r103,r104 --seed 5 --step-deg 0.3

Scans: several stations inside, 2 mm noise, six boxes and two people, glass that passes rays. The methods were
developed on the named plans (seed 1) and on the drawn ones r1 to r4; r101 and up were drawn to score on.
"""

from __future__ import annotations

import argparse
import math
import tempfile
import time
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

from headless_entry import package

PACKAGE = package()

from bim_verify.core.jobs import reconstruct  # noqa: E402
from bim_verify.core.model.load import load_model  # noqa: E402
from bim_verify.core.planes.derived import Z95  # noqa: E402
from bim_verify.core.reconstruction.compare import compare, comparison_lines  # noqa: E402
from bim_verify.core.reconstruction.shapes import read_shapes  # noqa: E402
from bim_verify.core.reconstruction.write_ifc import write_reconstruction  # noqa: E402
from bim_verify.core.simulation.campaign import Campaign, place_props, scan_to_files, set_up  # noqa: E402
from bim_verify.core.simulation.random_storey import random_storey  # noqa: E402
from bim_verify.core.simulation.scanner import PRESETS  # noqa: E402
from bim_verify.core.simulation.scene import build_scene  # noqa: E402
from bim_verify.core.simulation.storey_plans import flat, offices, slanted  # noqa: E402
from bim_verify.core.simulation.storeys import PlannedStorey, write_building  # noqa: E402

CASES = {
    "flat": ((flat,), 8.0, (0.0, 0.0), 0.0),
    "offices": ((offices,), 0.0, (0.0, 0.0), 0.0),
    "slanted": ((slanted,), 17.3, (1000.0, 2000.0), 3.0),
    "two": ((slanted, flat), -31.0, (-50.0, 12.0), 100.0),
}


def case(name: str) -> tuple[list[PlannedStorey], float, tuple[float, float], float]:
    """Storeys, turn [deg], shift [m] and elevation [m] of a named plan, or of plan N drawn by chance (rN)."""
    if name in CASES:
        plans, *place = CASES[name]
        return [plan() for plan in plans], *place
    if not (name.startswith("r") and name[1:].isdigit()):
        raise SystemExit(f"No plan is named {name}; there are {', '.join(CASES)}, and r1, r2, ...")
    number = int(name[1:])
    return [random_storey(number)], float(37 * number % 90), (0.0, 0.0), 0.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", default=",".join(CASES))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--step-deg", type=float, default=0.18)
    parser.add_argument("--keep", metavar="FOLDER", help="leave the truth, the scans and what was found in this folder")
    arguments = parser.parse_args()
    edges: list[tuple[bool, float]] = []
    with nullcontext(arguments.keep) if arguments.keep else tempfile.TemporaryDirectory() as folder:
        for name in arguments.cases.split(","):
            truth, built, scan, found = (Path(folder) / f"{name}{end}" for end in ("_truth.ifc", ".ifc", ".e57", "_found.ifc"))
            storeys, turn, shift, level = case(name)
            write_building(truth, storeys, turn_deg=turn, shift=shift, elevation=level, furniture=False)
            positions = write_building(built, storeys, turn_deg=turn, shift=shift, elevation=level)
            model = load_model(built)
            props = place_props(model, build_scene(model, {}, seed=arguments.seed), seed=arguments.seed, boxes=6, people=2)
            set_ups = tuple(set_up(f"S{k}", p - model.origin, arguments.seed, k) for k, p in enumerate(positions))
            step = math.radians(arguments.step_deg)
            scanner = replace(PRESETS["fast"], angular_step=step, sigma_range=0.002, sigma_signal=0.0)
            campaign = Campaign(model, scanner, set_ups, {}, props, arguments.seed, glass="clear")
            written = scan_to_files(campaign, scan, None)
            begin = time.perf_counter()
            result = reconstruct([scan])
            write_reconstruction(found, result)
            seconds = time.perf_counter() - begin
            print(f"{name}: {written.returns:,} returns of {len(positions)} stations, {seconds:.1f} s", flush=True)
            comparison = compare(read_shapes(found), read_shapes(truth))
            for line in comparison_lines(comparison):
                print(f"  {line}", flush=True)
            own = [e for m in comparison.classes["openings"].matches for e in m.edges_in_sigmas]
            print(f"  {coverage(own)}", flush=True)
            edges += own
            tests = [t for s in result.storeys for w in s.walls for face in w.faces for t in face.flatness]
            uneven, largest = sum(t.p_value < 0.05 for t in tests), max((t.value for t in tests), default=0.0)
            print(f"  Walls are flat in truth: {uneven} of {len(tests)} tests of flatness have p below 0.05, largest gap "
                  f"{1000 * largest:.1f} mm.", flush=True)
    print(f"All: {coverage(edges)}")


def coverage(edges: list[tuple[bool, float]]) -> str:
    """How often the 95 % intervals of the edges of openings hold the truth."""
    parts = []
    for word, wanted in (("seen", True), ("hidden", False)):
        off = [abs(z) for seen, z in edges if seen == wanted]
        held = sum(z < Z95 for z in off)
        parts.append(f"{held} of {len(off)} {word} edges" + (f" (worst {max(off):.1f} sigma)" if off else ""))
    return "95 % intervals hold for " + ", ".join(parts) + "."


if __name__ == "__main__":
    main()
