"""How right are the verdicts? Simulated campaigns of the demo house, of a storey of boxes, or of any models, and their truth.

    python scripts/bench_verdicts.py [--seeds 1] [--first-seed 1] [--profiles plain,few] [--keep DIR] [--show] [MODEL.ifc ...]

Each model is scanned once per profile and seed: what is removed, moved (and how far), where the clutter and the stations
stand, all follows from the seed. Prints one line per campaign with its misses, then the totals per kind of truth. With
``--keep`` the campaigns stay in a folder and are used again. The rules of scoring are those of ``core/simulation/score.py``.
"""

from __future__ import annotations

import argparse
import json
import math
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from headless_entry import package

PACKAGE = package()

from bim_verify.core.jobs import verify  # noqa: E402
from bim_verify.core.model.elements import BuildingModel  # noqa: E402
from bim_verify.core.model.load import load_model  # noqa: E402
from bim_verify.core.options import VerifyOptions  # noqa: E402
from bim_verify.core.simulation.box_building import building_model, four_rooms  # noqa: E402
from bim_verify.core.simulation.campaign import SHIFTS_M, make_campaign, write_campaign  # noqa: E402
from bim_verify.core.simulation.house import write_demo_house  # noqa: E402
from bim_verify.core.simulation.scanner import PRESETS  # noqa: E402
from bim_verify.core.simulation.scene import Glass  # noqa: E402
from bim_verify.core.simulation.score import Score, score  # noqa: E402


@dataclass(frozen=True)
class Profile:
    """What kind of campaign. Lengths in metres."""

    step_deg: float = 0.36
    sigma_range: float = 0.0012
    stations: int | None = 5
    removed: float = 0.05
    shifted: float = 0.15
    clutter: int = 6
    people: int = 0
    pose_noise: tuple[float, float] = (0.0, 0.0)
    glass: Glass = "lossy"
    unevenness: float = 0.0
    any_face: bool = False
    """Shifts go along any of an element's face directions, not only along its thinnest."""


PROFILES: dict[str, Profile] = {
    "plain": Profile(),
    "few": Profile(stations=3, step_deg=0.3),
    "coarse": Profile(step_deg=0.5, sigma_range=0.003, removed=0.08),
    "fine": Profile(step_deg=0.15, stations=4, removed=0.08),
    "busy": Profile(removed=0.15, shifted=0.4, stations=6, clutter=10),
    "rough": Profile(
        pose_noise=(0.002, 1e-4), unevenness=0.001, sigma_range=0.0025, stations=7, removed=0.08, shifted=0.3, people=2
    ),
    "clear": Profile(glass="clear", shifted=0.3, stations=7, removed=0.1),
    "noisy": Profile(sigma_range=0.004, step_deg=0.3, shifted=0.3, removed=0.1, glass="opaque"),
    "sideways": Profile(any_face=True, shifted=0.4, removed=0.1, stations=7),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("models", nargs="*", type=Path)
    parser.add_argument("--seeds", type=int, default=1, help="campaigns per model and profile")
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--profiles", default=",".join(PROFILES))
    parser.add_argument("--spacing-mm", type=float, default=50.0)
    parser.add_argument("--sigma-mm", type=float, default=2.5)
    parser.add_argument("--loa", type=int, default=30)
    parser.add_argument("--keep", type=Path, help="folder for the campaigns")
    parser.add_argument("--show", action="store_true", help="print each miss with the reason given")
    arguments = parser.parse_args()
    options = VerifyOptions(
        sample_spacing=arguments.spacing_mm / 1000, sigma=arguments.sigma_mm / 1000, loa=arguments.loa
    )
    unknown = sorted(set(arguments.profiles.split(",")) - set(PROFILES))
    if unknown:
        parser.error(f"no such profile: {', '.join(unknown)}; there are {', '.join(PROFILES)}")
    with tempfile.TemporaryDirectory() as scratch:
        scores: list[Score] = []
        print(f"{'campaign':<44} {'right':>9}  {'confirmed':>9} {'deviating':>9} {'absent':>7} {'unseen':>7}  "
              f"{'shift error':>11} {'false sig.':>10} {'seconds':>7}", flush=True)
        for name, model in _models(arguments.models, Path(scratch)):
            for profile in arguments.profiles.split(","):
                for seed in range(arguments.first_seed, arguments.first_seed + arguments.seeds):
                    folder = (arguments.keep or Path(scratch)) / f"{name}_{profile}_{seed}"
                    scores.append(_campaign(name, model, profile, seed, folder, options, arguments.show))
        _totals(scores)


def _models(paths: list[Path], scratch: Path) -> list[tuple[str, BuildingModel]]:
    if paths:
        return [(path.stem if path.stem != "model" else path.parent.name, load_model(path)) for path in paths]
    house = scratch / "house.ifc"
    write_demo_house(house)
    return [("demo house", load_model(house)), ("four rooms", building_model(four_rooms()))]


def _campaign(
    name: str, model: BuildingModel, profile: str, seed: int, folder: Path, options: VerifyOptions, show: bool
) -> Score:
    scan, truth_path = folder / "scan.e57", folder / "truth.json"
    if not truth_path.exists():
        p = PROFILES[profile]
        campaign = make_campaign(
            model, seed=seed, stations=p.stations, remove_share=p.removed, shift_share=p.shifted, shifts_m=SHIFTS_M,
            clutter=p.clutter, people=p.people, pose_noise=p.pose_noise, glass=p.glass, unevenness=p.unevenness,
            any_face=p.any_face,
            scanner=replace(PRESETS["fast"], angular_step=math.radians(p.step_deg), sigma_range=p.sigma_range),
        )
        write_campaign(campaign, folder)
    truth = json.loads(truth_path.read_text(encoding="utf-8"))
    start = time.perf_counter()
    result = verify(model, [scan], options)
    found = score(result, truth)
    _line(f"{name} / {profile} {seed}", found, time.perf_counter() - start)
    for verdict, kind in found.wrong:
        fact = truth["elements"][verdict.global_id]
        x, y, z = fact["direction"]
        moved = f", moved {1000 * fact['offset']:+.0f} mm along ({x:.2f} {y:.2f} {z:.2f})" if fact["edit"] == "shift" else ""
        print(f"    {verdict.ifc_class} {verdict.name} {verdict.global_id}: {kind}{moved}, witnessed "
              f"{fact['witnessed']:.2f}, {fact['hits']} returns: called {verdict.status}", flush=True)
        if show:
            print(f"        {verdict.reason}", flush=True)
    return found


def _line(label: str, found: Score, seconds: float | None = None) -> None:
    kinds = [found.tally(kind) for kind in ("confirmed", "deviating", "absent", "unseen")]
    share = found.right / max(found.scored, 1)
    print(
        f"{label:<44} {share:9.3f}  {kinds[0]:>9} {kinds[1]:>9} {kinds[2]:>7} {kinds[3]:>7}  "
        f"{1000 * found.shift_error_median:8.2f} mm {100 * found.false_significant:8.1f} % "
        + (f"{seconds:7.1f}" if seconds is not None else ""),
        flush=True,
    )


def _totals(scores: list[Score]) -> None:
    total = Score()
    for part in scores:
        total.add(part)
    _line(f"all {len(scores)} campaigns", total)
    shares = np.array([s.right / max(s.scored, 1) for s in scores])
    print(f"worst campaign {shares.min():.3f}; below 0.95: {int(np.sum(shares < 0.95))} of {len(shares)}")
    for kind, statuses in total.per_kind.items():
        print(f"{kind}: {', '.join(f'{status} {count}' for status, count in Counter(statuses).most_common())}")


if __name__ == "__main__":
    main()
