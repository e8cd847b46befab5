"""Print how accurate, how honest and how fast the alignment is, on scenes made here.

    python scripts/bench_alignment.py [--runs 60] [--step-deg 0.9]

Accuracy: four rooms (48 elements, 15 % of them moved by 2-12 cm, 2 mm noise) from random poses 0.5 m and 3 degrees off,
built to plan but for the moved elements. Honesty: the same with every element 1, 3 and 6 mm (one sigma, each axis) off
its place; the squared pose error over its covariance should follow chi-square with six degrees of freedom.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

if __package__ in (None, ""):
    import importlib.util

    root = Path(__file__).resolve().parents[1]
    if importlib.util.find_spec("bim_verify") is None:
        spec = importlib.util.spec_from_file_location(
            "bim_verify", root / "__init__.py", submodule_search_locations=[str(root)]
        )
        assert spec is not None and spec.loader is not None
        sys.modules["bim_verify"] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(sys.modules["bim_verify"])

from bim_verify.core.alignment import transform as se3
from bim_verify.core.alignment.auto import align_auto
from bim_verify.core.alignment.fine import align_fine
from bim_verify.core.alignment.transform import TransformedSource
from bim_verify.core.model.sample_surface import sample_surface
from bim_verify.core.simulation.box_building import (
    ArraySource,
    build_inaccurately,
    building_model,
    four_room_stations,
    four_rooms,
    scan,
)

SIGMA = 0.002
CENTER = np.array([6.0, 4.5, 1.3])


def main() -> None:
    """Run all parts and print one table each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--runs", type=int, default=60)
    parser.add_argument("--step-deg", type=float, default=0.9)
    arguments = parser.parse_args()
    model = building_model(four_rooms())
    samples = sample_surface(model, 0.05)
    print("deviation  translation error mm    rotation error mrad     squared error / covariance (chi2 6)      s/run")
    print("    mm     median  p95   max       median  p95   max       mean (6)  median (5.3)  below 95 %  below 50 %")
    for deviation in (0.0, 0.001, 0.003, 0.006):
        errors, squares, seconds = [], [], []
        for run in range(arguments.runs):
            source = _campaign(deviation, run, arguments.step_deg)
            motion = _disturbance(run)
            begin = time.perf_counter()
            record = align_fine(model, samples, TransformedSource(source, motion), sigma=SIGMA, loa=30)
            seconds.append(time.perf_counter() - begin)
            assert record.center is not None and record.covariance is not None
            error = se3.log_about(record.transform @ motion, record.center)
            errors.append(error)
            squares.append(error @ np.linalg.solve(record.covariance, error))
        _print_row(deviation, np.array(errors), np.array(squares), float(np.mean(seconds)))
    _automatic(model, samples, arguments.step_deg)


def _campaign(deviation: float, run: int, step: float) -> ArraySource:
    built, _ = build_inaccurately(four_rooms(), moved_share=0.15, largest_move=0.12, deviation=deviation, seed=run)
    return scan(building_model(built), four_room_stations(), step_deg=step, noise=SIGMA, seed=run)


def _disturbance(run: int) -> NDArray[np.float64]:
    rng = np.random.default_rng(1000 + run)
    axes = rng.normal(size=(2, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return se3.exp_about(np.concatenate([axes[0] * np.radians(3.0), axes[1] * 0.5]), CENTER)


def _print_row(deviation: float, errors: NDArray[np.float64], squares: NDArray[np.float64], seconds: float) -> None:
    shift = np.linalg.norm(errors[:, 3:], axis=1) * 1e3
    turn = np.linalg.norm(errors[:, :3], axis=1) * 1e3
    print(
        f"{deviation * 1e3:6.0f}     "
        + "  ".join(f"{value:5.2f}" for value in (np.median(shift), np.quantile(shift, 0.95), shift.max()))
        + "     "
        + "  ".join(f"{value:5.3f}" for value in (np.median(turn), np.quantile(turn, 0.95), turn.max()))
        + f"      {squares.mean():6.2f}   {np.median(squares):8.2f}      {(squares < chi2.ppf(0.95, 6)).mean():8.2f}"
        f"   {(squares < chi2.ppf(0.5, 6)).mean():8.2f}      {seconds:5.1f}",
        flush=True,
    )


def _automatic(model, samples, step: float) -> None:  # type: ignore[no-untyped-def]
    print("\nwithout a pose: heading deg, shift m -> error mm, mrad, s")
    for run, heading in enumerate((0.0, 33.0, 137.0, 181.0, 270.0)):
        motion = se3.exp_about(np.array([0.02, -0.02, np.radians(heading), 20.0 * run, -9.0 * run, 3.0]), CENTER)
        begin = time.perf_counter()
        record = align_auto(model, samples, TransformedSource(_campaign(0.0, run, step), motion), sigma=SIGMA, loa=30)
        took = time.perf_counter() - begin
        assert record.center is not None
        error = se3.log_about(record.transform @ motion, record.center) * 1e3
        print(
            f"{heading:6.0f}  {np.linalg.norm(motion[:3, 3]):6.1f}  ->  {np.linalg.norm(error[3:]):6.2f}  "
            f"{np.linalg.norm(error[:3]):6.3f}  {took:5.1f}"
        )


if __name__ == "__main__":
    main()
