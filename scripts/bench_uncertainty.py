"""Is the stated uncertainty right? Many simulated campaigns of the demo house, or of any model, with known truth.

    python scripts/bench_uncertainty.py [--campaigns 12] [MODEL.ifc ...]

Prints, per campaign and over all, how often the 95 % interval of the displacement holds the true shift, how right the
verdicts are, how often an element that did not move is called significantly moved, and how often a position of which the
belief says it is occupied really lies within the level's bound.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from headless_entry import package

PACKAGE = package()

from bim_verify.core.jobs import verify  # noqa: E402
from bim_verify.core.model.load import load_model  # noqa: E402
from bim_verify.core.options import VerifyOptions  # noqa: E402
from bim_verify.core.simulation.campaign import make_campaign, write_campaign  # noqa: E402
from bim_verify.core.simulation.house import write_demo_house  # noqa: E402
from bim_verify.core.simulation.scanner import PRESETS  # noqa: E402
from bim_verify.core.simulation.score import score  # noqa: E402

SETTINGS = (
    # angular step [deg], range sigma [m], pose noise (m, rad), unevenness [m]
    (0.36, 0.0012, (0.0, 0.0), 0.0),
    (0.30, 0.0020, (0.002, 0.0001), 0.0),
    (0.36, 0.0015, (0.001, 0.00005), 0.0005),
    (0.25, 0.0025, (0.003, 0.0001), 0.001),
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("models", nargs="*", type=Path)
    parser.add_argument("--campaigns", type=int, default=12)
    parser.add_argument("--spacing-mm", type=float, default=50.0)
    parser.add_argument("--seed", type=int, default=100)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        models = arguments.models or [Path(folder) / "house.ifc"]
        if not arguments.models:
            write_demo_house(models[0])
        errors, right, scored, still, moved = [], 0, 0, 0, 0
        for number in range(arguments.campaigns):
            model = load_model(models[number % len(models)])
            step, sigma, pose_noise, unevenness = SETTINGS[number % len(SETTINGS)]
            scanner = replace(PRESETS["fast"], angular_step=np.radians(step), sigma_range=sigma)
            campaign = make_campaign(
                model, seed=arguments.seed + number, stations=6, shift_share=0.4, scanner=scanner, pose_noise=pose_noise,
                unevenness=unevenness,
            )
            target = Path(folder) / f"campaign_{number}"
            written = write_campaign(campaign, target)
            truth = written.truth
            result = verify(model, [target / "scan.e57"], VerifyOptions(sample_spacing=arguments.spacing_mm / 1000))
            found = score(result, truth)
            z = np.abs(found.normalized_errors)
            errors += z.tolist()
            right, scored = right + found.right, scored + found.scored
            unmoved = [
                v.significant for v in result.verdicts
                if v.significant is not None and truth["elements"].get(v.global_id, {}).get("edit") == "none"
            ]
            still, moved = still + len(unmoved), moved + sum(unmoved)
            print(
                f"{models[number % len(models)].stem} seed {arguments.seed + number}: verdicts {found.right}/{found.scored}, "
                f"interval holds {np.sum(z < 1.96)}/{len(z)}, registration {1000 * result.stations[0].registration_sigma:.1f} "
                f"mm (true {1000 * pose_noise[0]:.1f}), shift error median {1000 * found.shift_error_median:.2f} mm",
                flush=True,
            )
        z = np.array(errors)
        print(f"95 % interval of Displacement holds the truth in {100 * np.mean(z < 1.96):.1f} % of {len(z)} cases")
        print(f"median |error| / sigma {np.median(z):.2f} (0.67 if exact)")
        print(f"verdicts right: {right} of {scored} ({100 * right / max(scored, 1):.1f} %)")
        print(f"significant without a shift: {moved} of {still} ({100 * moved / max(still, 1):.1f} %)")


if __name__ == "__main__":
    main()
