"""Is the stated uncertainty right? Many simulated campaigns with known truth.

    python scripts/bench_uncertainty.py [--campaigns 24] [--seed 3000] [MODEL.ifc ...]

Conditions (angular step, range noise, registration error of the stations, size and wavelength of unevenness, number of
stations) are spread evenly over the campaigns and shuffled by the seed. Prints, per campaign and over all, how often
Displacement +- 1.96 DisplacementSigma holds the true shift along its direction, how often an element that did not move is
called significantly moved, and how often a position of which the belief says occupied really lies within the level.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from headless_entry import package

PACKAGE = package()

from bim_verify.core.jobs import verify  # noqa: E402
from bim_verify.core.model.elements import BuildingModel  # noqa: E402
from bim_verify.core.model.load import load_model  # noqa: E402
from bim_verify.core.options import VerifyOptions  # noqa: E402
from bim_verify.core.results import VerificationResult  # noqa: E402
from bim_verify.core.sensing.loa import UPPER_BOUND_M  # noqa: E402
from bim_verify.core.simulation.box_building import building_model, four_rooms  # noqa: E402
from bim_verify.core.simulation.campaign import Campaign, make_campaign, write_campaign  # noqa: E402
from bim_verify.core.simulation.house import write_demo_house  # noqa: E402
from bim_verify.core.simulation.scanner import PRESETS  # noqa: E402
from bim_verify.core.simulation.scene import Unevenness  # noqa: E402
from bim_verify.core.simulation.score import score  # noqa: E402

WRONG_PLACE_M = 0.012
"""An error beyond this is a wrong place chosen, not a wrong uncertainty; counted apart."""
BINS = (0.0, 0.5, 0.8, 0.95, 0.99, 1.0001)


@dataclass(frozen=True)
class Condition:
    """What one campaign is like; lengths in metres."""

    model: int
    step_deg: float
    sigma: float
    pose_noise: tuple[float, float]
    unevenness: float
    wavelength: float
    stations: int
    seed: int


def conditions(count: int, models: int, seed: int) -> list[Condition]:
    random = np.random.default_rng(seed)

    def spread(values: list[Any]) -> list[Any]:
        return [values[k] for k in random.permutation(np.resize(np.arange(len(values)), count))]

    columns = (
        spread(list(range(models))), spread([0.25, 0.36, 0.5]), spread([0.0006, 0.0012, 0.002, 0.003]),
        spread([(0.0, 0.0), (0.0008, 3e-5), (0.002, 1e-4)]), spread([0.0, 0.0005, 0.001]), spread([0.3, 0.6, 1.5, 3.0]),
        spread([3, 6, 9]), list(range(seed, seed + count)),
    )
    return [Condition(*row) for row in zip(*columns, strict=True)]


def campaign(model: BuildingModel, c: Condition) -> Campaign:
    scanner = replace(PRESETS["fast"], angular_step=math.radians(c.step_deg), sigma_range=c.sigma)
    made = make_campaign(
        model, seed=c.seed, stations=c.stations, shift_share=0.4, scanner=scanner, pose_noise=c.pose_noise
    )
    return replace(made, unevenness=Unevenness(c.unevenness, c.wavelength, c.seed) if c.unevenness > 0 else None)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("models", nargs="*", type=Path)
    parser.add_argument("--campaigns", type=int, default=24)
    parser.add_argument("--spacing-mm", type=float, default=100.0)
    parser.add_argument("--seed", type=int, default=3000)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if arguments.models:
            models = [load_model(path) for path in arguments.models]
        else:
            house = Path(folder) / "house.ifc"
            write_demo_house(house)
            models = [load_model(house), building_model(four_rooms()), building_model(four_rooms(), turn=0.35)]
        shifted, still, wrong, significant, unmoved, believed = [], [], 0, 0, 0, []
        for c in conditions(arguments.campaigns, len(models), arguments.seed):
            target = Path(folder) / "campaign"
            truth = write_campaign(campaign(models[c.model], c), target).truth
            result = verify(
                models[c.model], [target / "scan.e57"], VerifyOptions(sample_spacing=arguments.spacing_mm / 1000)
            )
            z, z0, off = normalized_errors(result, truth)
            own = score(result, truth).unmoved_significant
            shifted, still, wrong = shifted + z, still + z0, wrong + off
            significant, unmoved = significant + sum(own), unmoved + len(own)
            believed.append(believed_and_true(result, truth))
            print(
                f"model {c.model}, {c.stations} stations, {c.step_deg} deg, noise {1000 * c.sigma:.1f} mm, registration "
                f"{1000 * c.pose_noise[0]:.1f} mm (estimated {1000 * result.stations[0].registration_sigma:.1f}), uneven "
                f"{1000 * c.unevenness:.1f} mm over {c.wavelength} m: shifted {held(z)}, still {held(z0)}",
                flush=True,
            )
        print(f"95 % interval of Displacement holds the truth: shifted {held(shifted)}, not moved {held(still)}, "
              f"all {held(shifted + still)} cases; wrong place found for {wrong}")
        print(f"median |error| / sigma {np.median(np.abs(shifted + still)):.2f} (0.67 if exact)")
        print(f"significant without a shift: {significant} of {unmoved} ({100 * significant / max(unmoved, 1):.1f} %)")
        belief, right = (np.concatenate(part) for part in zip(*believed, strict=True))
        for low, high in pairwise(BINS):
            own_bin = (belief >= low) & (belief < high)
            if own_bin.any():
                print(f"belief occupied {low:.2f} to {min(high, 1):.2f}: mean {belief[own_bin].mean():.3f}, surface really "
                      f"within the level {right[own_bin].mean():.3f} of {own_bin.sum()} positions in view")


def held(z: list[float]) -> str:
    inside = int(np.sum(np.abs(z) < 1.96)) if z else 0
    return f"{inside}/{len(z)} ({100 * inside / max(len(z), 1):.1f} %)"


def normalized_errors(result: VerificationResult, truth: dict[str, Any]) -> tuple[list[float], list[float], int]:
    """Errors over sigma of shifted and of unmoved elements where the true direction is determined, and wrong places."""
    shifted, still, wrong = [], [], 0
    for verdict in result.verdicts:
        fact = truth["elements"].get(verdict.global_id)
        if fact is None or fact["edit"] == "remove" or fact["witnessed"] < 0.3 or not verdict.displacement_sigma:
            continue
        vector = np.array(verdict.displacement_vector)
        moved = fact["edit"] == "shift"
        direction = np.array(fact["direction"]) if moved else vector / max(float(np.linalg.norm(vector)), 1e-12)
        error = float(vector @ direction) - (fact["offset"] if moved else 0.0)
        if abs(error) > WRONG_PLACE_M:
            wrong += 1
        else:
            (shifted if moved else still).append(error / verdict.displacement_sigma)
    return shifted, still, wrong


def believed_and_true(result: VerificationResult, truth: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Belief of every position in view, and whether the surface really stands within the level's bound there."""
    bound = UPPER_BOUND_M[result.options.loa]
    offset, known = np.full((len(result.verdicts), 3), np.nan), np.zeros(len(result.verdicts), dtype=bool)
    for row, verdict in enumerate(result.verdicts):
        fact = truth["elements"].get(verdict.global_id)
        if fact is not None:
            known[row] = True
            offset[row] = np.inf if fact["edit"] == "remove" else fact["offset"] * np.array(fact["direction"])
    of = result.samples.element
    with np.errstate(invalid="ignore"):
        across = np.abs(np.einsum("ij,ij->i", offset[of], result.samples.normal))
    evidence = result.evidence
    seen = result.samples.exposed & (evidence.m_unk < 0.5) & known[of]
    return evidence.m_occ[seen].astype(np.float64), (across[seen] <= bound).astype(np.float64)


if __name__ == "__main__":
    main()
