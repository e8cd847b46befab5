"""How often the 95 % intervals of `verify --dimensions` hold: rooms whose walls and slabs stand off, scanned and measured.

    python scripts/bench_dimensions.py [--campaigns 12] [--seed 1] [--step-deg 0.4]

The storey is the furnished flat of ``core/simulation/storey_plans.py``. Every wall and slab stands off along its normal by a
number drawn from 5 mm; surfaces are uneven; the scans' poses are off. What is true of a width is the plan and the two shifts.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from headless_entry import package
from numpy.typing import NDArray

PACKAGE = package()

from bim_verify.core.dimensions.openings import opening_shares  # noqa: E402
from bim_verify.core.dimensions.table import Dimension  # noqa: E402
from bim_verify.core.jobs import dimensions, verify  # noqa: E402
from bim_verify.core.model.elements import BuildingModel  # noqa: E402
from bim_verify.core.model.load import load_model  # noqa: E402
from bim_verify.core.options import VerifyOptions  # noqa: E402
from bim_verify.core.simulation.campaign import Campaign, scan_to_files, set_up  # noqa: E402
from bim_verify.core.simulation.scanner import PRESETS  # noqa: E402
from bim_verify.core.simulation.scene import Edit, Unevenness, thinnest_axis  # noqa: E402
from bim_verify.core.simulation.storey_plans import flat  # noqa: E402
from bim_verify.core.simulation.storeys import write_building  # noqa: E402

Array = NDArray[np.float64]
PARALLEL = 0.99
FACE = " at the face"
MOVING = ("IfcWall", "IfcSlab")
SHIFT_M = 0.005
NOISES_M, REGISTRATIONS, UNEVEN = (0.001, 0.002, 0.003), ((0.0, 0.0), (0.0008, 3e-5), (0.002, 1e-4)), (0.0, 0.0005, 0.001)


def across(model: BuildingModel, row: int) -> Array:
    """(3,) along which an element is thinnest."""
    return thinnest_axis(model.vertices[model.triangles[model.triangle_element == row]])[0]


def standing_off(model: BuildingModel, rng: np.random.Generator) -> dict[int, Edit]:
    """Every wall and slab, shifted along its thinnest axis."""
    return {
        row: Edit("shift", float(rng.normal(0.0, SHIFT_M)), tuple(across(model, row).tolist()))
        for row, e in enumerate(model.elements) if e.ifc_class in MOVING
    }


def true_value(row: Dimension, model: BuildingModel, edits: dict[int, Edit]) -> float | None:
    """What a clear width or height is as built.

    None for a test or a vertex, where an element has no name of its own, and where two elements are not parallel: an end
    face stays where its wall moves across.
    """
    if row.planned is None or row.what.removesuffix(FACE) not in ("width", "height"):
        return None
    if len(row.between) == 1:
        return row.planned
    names = [e.name for e in model.elements]
    if any(names.count(name) != 1 for name in row.between):
        return None
    a, b = (names.index(name) for name in row.between)
    shift = [edits[k].vector if k in edits else np.zeros(3) for k in (a, b)]
    if row.opening and row.what.startswith("height"):
        # a lintel over a floor, which is the slab
        below, above = sorted((0, 1), key=lambda k: model.elements[(a, b)[k]].ifc_class)
        return row.planned + float(shift[above][2] - shift[below][2])
    low, high = model.element_bounds
    axis = across(model, a)
    if abs(float(axis @ across(model, b))) < PARALLEL:
        return None
    if float(axis @ (low[b] + high[b] - low[a] - high[a])) < 0:
        axis = -axis
    return row.planned + float((shift[1] - shift[0]) @ axis)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--campaigns", type=int, default=12)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--step-deg", type=float, default=0.4)
    arguments = parser.parse_args()
    kinds: dict[str, list[tuple[float, float]]] = {}
    with tempfile.TemporaryDirectory() as folder:
        path, scan = Path(folder) / "flat.ifc", Path(folder) / "scan.e57"
        positions = write_building(path, [flat()], turn_deg=20.0)
        model = load_model(path)
        for number in range(arguments.seed, arguments.seed + arguments.campaigns):
            rng = np.random.default_rng((number, 41))
            noise, poses, uneven = (values[int(rng.integers(3))] for values in (NOISES_M, REGISTRATIONS, UNEVEN))
            edits = standing_off(model, rng)
            set_ups = tuple(set_up(f"S{k}", p - model.origin, number, k, poses) for k, p in enumerate(positions))
            scanner = replace(
                PRESETS["fast"], angular_step=math.radians(arguments.step_deg), sigma_range=noise, sigma_signal=0.0
            )
            bumps = Unevenness(uneven, 0.6, number) if uneven > 0 else None
            scan_to_files(Campaign(model, scanner, set_ups, edits, (), number, poses, unevenness=bumps), scan, None)
            own: dict[str, list[tuple[float, float]]] = {}
            rows = dimensions(verify(model, [scan], VerifyOptions(sigma=noise)))
            print(opening_shares(rows))
            for row in rows:
                if row.value is not None and row.sigma is not None and (value := true_value(row, model, edits)) is not None:
                    within = "of an opening" if len(row.between) == 1 else "of a door"
                    place = within if row.opening else "between two elements"
                    kind = f"{row.what} {place}"
                    own.setdefault(kind, []).append((row.value - value, row.sigma))
            print(
                f"noise {1000 * noise:g} mm, registration {1000 * poses[0]:g} mm, uneven {1000 * uneven:g} mm: {told(own)}",
                flush=True,
            )
            for kind, values in own.items():
                kinds.setdefault(kind, []).extend(values)
    for kind, values in kinds.items():
        error, sigma = np.array(values).T
        print(
            f"{kind}: {told({kind: values})}; error {1000 * np.sqrt(np.mean(error**2)):.2f} mm rms (worst "
            f"{1000 * np.abs(error).max():.2f}), sigma {1000 * np.median(sigma):.2f} mm"
        )
    print(f"all: {told(kinds)}")


def told(kinds: dict[str, list[tuple[float, float]]]) -> str:
    """How often intervals hold, over all kinds."""
    error, sigma = np.array([pair for values in kinds.values() for pair in values]).T
    return f"95 % intervals hold {int((np.abs(error) <= 1.96 * sigma).sum())} of {len(error)}"


if __name__ == "__main__":
    main()
