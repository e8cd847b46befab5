"""How accurate a pose from lines is: tables 7.1 and 7.2 of Meyer (2023) again, their limit, and wrong matches.

    python scripts/bench_coregistration.py [--runs 100] [--quick] [--json FILE]

The camera is that of the source (36 mm sensor, 30 mm focal length, 1600 x 1200 pixels). Its room is not published; the one
here has 36 edges of a room, two windows and furniture in front of that camera, so cells need not agree, only compare.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from headless_entry import package
from numpy.typing import NDArray

PACKAGE = package()

from scipy.stats import chi2  # noqa: E402

from bim_verify.core.imagery.camera import (  # noqa: E402
    Camera,
    Interior,
    from_omega_phi_kappa,
    to_omega_phi_kappa,
)
from bim_verify.core.imagery.cameras_file import KnownCamera  # noqa: E402
from bim_verify.core.imagery.detect_lines import ImageLines  # noqa: E402
from bim_verify.core.imagery.edge_bearers import free_edges  # noqa: E402
from bim_verify.core.imagery.line_pose import (  # noqa: E402
    PoseEstimate,
    estimate_calibrated,
    estimate_projective,
    pose_difference,
)
from bim_verify.core.imagery.register_image import adjust_matches, match_lines, search_pose  # noqa: E402
from bim_verify.core.imagery.uncertain_lines import LineMatches, join  # noqa: E402
from bim_verify.core.imagery.visible_edges import VisibleEdges  # noqa: E402
from bim_verify.core.sensing.loa import LEVELS, level_sigma  # noqa: E402

Array = NDArray[np.float64]
LENS = Interior(1600, 1200, 30 / 36 * 1600, 30 / 36 * 1600, 799.5, 599.5)
TRUE = Camera("room", LENS, from_omega_phi_kappa(*np.radians([-67.318, 1.8, 29.498])), np.array([43.907, 28.847, 8.053]))
NOISE_PX = (0.0, 0.5, 1.0, 1.5, 3.0)
LEAST_PX = 0.01
COARSE_M, COARSE_DEG = 0.15, 1.0
SOURCE = {
    50: ((0.003, 0.015, 0.026, 0.045, 0.086), (0.002, 0.010, 0.020, 0.030, 0.072), (0.002, 0.007, 0.014, 0.023, 0.045),
         (0.031, 0.137, 0.251, 0.464, 0.901), (0.015, 0.060, 0.123, 0.183, 0.366), (0.026, 0.105, 0.222, 0.319, 0.667)),
    40: ((0.017, 0.028, 0.035, 0.051, 0.084), (0.012, 0.017, 0.025, 0.038, 0.063), (0.009, 0.014, 0.018, 0.025, 0.047),
         (0.160, 0.223, 0.297, 0.461, 0.813), (0.072, 0.093, 0.126, 0.199, 0.394), (0.124, 0.148, 0.216, 0.385, 0.706)),
    30: ((0.052, 0.054, 0.058, 0.070, 0.113), (0.041, 0.040, 0.048, 0.053, 0.066), (0.026, 0.030, 0.033, 0.041, 0.060),
         (0.398, 0.473, 0.571, 0.588, 0.980), (0.203, 0.241, 0.284, 0.310, 0.452), (0.372, 0.442, 0.506, 0.487, 0.767)),
}
"""Tables 7.1 and 7.2: standard deviations of X0, Y0, Z0 [m], alpha, beta, gamma [deg], for the five noise levels."""
NAMES = ("X0 m", "Y0 m", "Z0 m", "angle 1", "angle 2", "angle 3")
BY_SIZE = {"angle 1": 3, "angle 2": 5, "angle 3": 4}
"""The source does not say about which axes alpha, beta and gamma turn: angles are paired by size, largest first (alpha, gamma,
beta there). Its rows, in that order."""
WRONG = 0.4
ROOM = (
    ((41.0, 23.3, 6.4), (47.2, 30.5, 9.3)), ((42.2, 23.2, 7.3), (43.8, 23.3, 8.6)), ((45.0, 23.2, 7.3), (46.4, 23.3, 8.6)),
    ((42.4, 25.6, 6.4), (43.6, 26.3, 7.14)), ((44.3, 26.4, 6.4), (45.5, 27.2, 7.14)), ((45.9, 23.3, 6.4), (47.2, 23.9, 7.6)),
    ((41.0, 24.0, 6.4), (41.4, 25.4, 8.3)), ((44.0, 23.8, 6.4), (44.6, 24.5, 7.5)), ((43.2, 26.9, 6.4), (43.7, 27.3, 7.4)),
)
COUNT = 36


@dataclass(frozen=True)
class Cell:
    """One level and noise: errors (runs, 6) of X0, Y0, Z0 [m] and omega, phi, kappa [deg], and what was predicted."""

    errors: Array
    squares: Array
    """(runs,) squared error in units of the predicted covariance; chi-square with six degrees."""
    efficiency: float
    factor: float
    limit: Array
    """(6,) the least standard deviations that any unbiased estimate has (Cramer-Rao), in the units of ``errors``."""

    @property
    def spread(self) -> Array:
        return np.asarray(self.errors.std(axis=0, ddof=1))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--quick", action="store_true", help="20 runs a cell")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None)
    runs = 20 if options.quick else options.runs
    begin = time.perf_counter()
    start, end = edges()
    cells = {
        (kind, level, noise): cell(kind, start, end, level_sigma(level), noise, runs)
        for level in reversed(LEVELS) for noise in NOISE_PX for kind in ("projective", "calibrated")
    }
    found = tables(cells, runs) | consistency(cells, runs) | outliers(start, end, runs)
    print(f"\n{time.perf_counter() - begin:.0f} s")
    if options.json:
        options.json.write_text(json.dumps(found, indent=1), encoding="ascii")


def edges() -> tuple[Array, Array]:
    """The 36 edges of the room with the longest pictures, cut at the image's border; both ends (36, 3)."""
    kept = []
    for low, high in ROOM:
        for corner in range(8):
            for axis in range(3):
                if corner >> axis & 1:
                    continue
                a = np.where([corner >> k & 1 for k in range(3)], high, low).astype(float)
                b = np.where(np.arange(3) == axis, high, a)
                place = a + np.linspace(0, 1, 401)[:, None] * (b - a)
                pixel = TRUE.project(place)
                with np.errstate(invalid="ignore"):
                    seen = np.flatnonzero(((pixel > 0) & (pixel < [LENS.width - 1, LENS.height - 1])).all(axis=1))
                if len(seen) > 10:
                    ends = seen[[0, -1]]
                    kept.append((float(np.linalg.norm(np.diff(pixel[ends], axis=0))), place[ends[0]], place[ends[1]]))
    kept.sort(key=lambda k: -k[0])
    return np.array([k[1] for k in kept[:COUNT]]), np.array([k[2] for k in kept[:COUNT]])


def observed(start: Array, end: Array, sigma: float, noise: float, rng: np.random.Generator) -> tuple[LineMatches, Camera]:
    """Lines and edges with noise, and a start 15 cm and 1 degree off; without noise when ``rng`` draws nothing."""
    ends = [TRUE.project(p) + rng.normal(0, 1, (len(p), 2)) * noise for p in (start, end)]
    spread = max(noise, LEAST_PX)
    image = np.tile(np.eye(2) * spread**2, (len(start), 1, 1))
    line, cov = join(ends[0], ends[1], image, image)
    model = np.tile(np.eye(3) * sigma**2, (len(start), 1, 1))
    shaken = [p + rng.normal(0, sigma, p.shape) for p in (start, end)]
    return LineMatches(line, cov, shaken[0], shaken[1], model, model), coarse(rng)


def coarse(rng: np.random.Generator) -> Camera:
    return TRUE.moved(np.radians(rng.normal(0, COARSE_DEG, 3)), rng.normal(0, COARSE_M, 3))


def cell(kind: str, start: Array, end: Array, sigma: float, noise: float, runs: int) -> Cell:
    """Many runs of one level and noise."""
    def estimate(matches: LineMatches, at: Camera) -> PoseEstimate:
        return estimate_projective(matches, at) if kind == "projective" else estimate_calibrated(matches, at)

    exact = bound(kind, start, end, sigma, noise)
    errors, squares, normal, factors = [], [], [], []
    for run in range(runs):
        matches, at = observed(start, end, sigma, noise, np.random.default_rng((run, int(1e6 * sigma), int(10 * noise))))
        found = estimate(matches, at)
        away = pose_difference(found.camera, TRUE)
        errors.append(np.concatenate([away[3:], angles(found.camera)]))
        squares.append(float(away @ np.linalg.solve(found.covariance, away)))
        normal.append(float(away @ np.linalg.solve(exact, away)))
        factors.append(found.variance_factor)
    efficiency = 6.0 / float(np.mean(normal))
    return Cell(np.array(errors), np.array(squares), efficiency, float(np.mean(factors)), limits(exact))


def bound(kind: str, start: Array, end: Array, sigma: float, noise: float) -> Array:
    """The Cramer-Rao bound (6, 6): the covariance at the true values."""
    image = np.tile(np.eye(2) * max(noise, LEAST_PX) ** 2, (len(start), 1, 1))
    line, cov = join(TRUE.project(start), TRUE.project(end), image, image)
    model = np.tile(np.eye(3) * sigma**2, (len(start), 1, 1))
    matches = LineMatches(line, cov, start, end, model, model)
    found = estimate_projective(matches, TRUE) if kind == "projective" else estimate_calibrated(matches, TRUE)
    return found.covariance


def limits(exact: Array) -> Array:
    """(6,) standard deviations of X0, Y0, Z0 [m] and of omega, phi, kappa [deg] of a pose's covariance at the true values."""
    step = 1e-6
    turn = np.column_stack([angles(TRUE.moved(step * axis, np.zeros(3))) / step for axis in np.eye(3)])
    return np.sqrt(np.concatenate([np.diag(exact)[3:], np.diag(turn @ exact[:3, :3] @ turn.T)]))


def angles(camera: Camera) -> Array:
    """(3,) degrees that omega, phi and kappa are off."""
    away = np.degrees(np.array(to_omega_phi_kappa(camera.rotation)) - np.array(to_omega_phi_kappa(TRUE.rotation)))
    return np.asarray((away + 180.0) % 360.0 - 180.0)


def tables(cells: dict[tuple[str, int, float], Cell], runs: int) -> dict[str, object]:
    """Print the tables; how many cells are at or below the source's, and how much better the calibrated pose is."""
    below = total = 0
    gains: list[tuple[float, float, float]] = []
    for level in reversed(LEVELS):
        print(f"\nLOA{level} (sigma {1000 * level_sigma(level):g} mm), {runs} runs a cell: source / projective / calibrated")
        print("           " + "".join(f"{f'{noise} px':>26}" for noise in NOISE_PX))
        for row, name in enumerate(NAMES):
            text = f"{name:<11}"
            for column, noise in enumerate(NOISE_PX):
                both = [cells[kind, level, noise] for kind in ("projective", "calibrated")]
                ours, best = (by_size(one.spread)[row] for one in both)
                least = [by_size(one.limit)[row] for one in both]
                theirs = SOURCE[level][BY_SIZE.get(name, row)][column] if level in SOURCE else math.nan
                text += f"{theirs:10.3f} {ours:7.4f} {best:7.4f}"
                if level in SOURCE:
                    total += 1
                    below += ours <= theirs
                    gains.append((theirs / best, ours / best, least[0] / least[1]))
            print(text)
    theirs_over, ours_over, limit_over = np.array(gains).T
    off = ours_over / limit_over
    above = sum(
        float(cells["projective", level, noise].spread[row]) > SOURCE[level][row][column]
        for level in SOURCE for row in range(6) for column, noise in enumerate(NOISE_PX)
    )
    print(f"\n{below} of {total} cells of LOA50 to LOA30 are at or below the source's (12-element projection matrix).")
    print(f"With omega, phi and kappa paired with the source's rows as they stand there, {above} would be above.")
    print(
        f"Calibrated against the source: {theirs_over.min():.1f} to {theirs_over.max():.1f} times better (median "
        f"{np.median(theirs_over):.1f}); against the 12 elements here: {ours_over.min():.1f} to {ours_over.max():.1f} "
        f"(median {np.median(ours_over):.1f}), 3 times or more in {(ours_over >= 3).sum()} cells."
    )
    each = [limit_over.reshape(len(SOURCE), len(NAMES), -1)[:, row] for row in range(len(NAMES))]
    print(
        f"The Cramer-Rao bounds of the two are {limit_over.min():.1f} to {limit_over.max():.1f} times apart (median "
        f"{np.median(limit_over):.1f}; 3 times or more in {(limit_over >= 3).sum()} cells): "
        + ", ".join(f"{name} {one.min():.1f} to {one.max():.1f}" for name, one in zip(NAMES, each, strict=True)) + "."
    )
    print(
        f"Measured over that, cell by cell: {off.min():.2f} to {off.max():.2f}, {np.exp(np.log(off).mean()):.3f} in the mean "
        f"(of {runs} runs each, chance alone scatters it by up to {1.0 / math.sqrt(runs - 1):.2f})."
    )
    return {
        "cells_below": below, "cells": total, "least_gain_source": float(theirs_over.min()),
        "least_gain": float(ours_over.min()), "median_gain": float(np.median(ours_over)),
        "median_gain_of_bounds": float(np.median(limit_over)),
    }


def by_size(spread: Array) -> list[float]:
    """Standard deviations of X0, Y0, Z0 [m] and of the three angles [deg], largest first."""
    values = [float(v) for v in spread]
    return values[:3] + sorted(values[3:], reverse=True)


def consistency(cells: dict[tuple[str, int, float], Cell], runs: int) -> dict[str, object]:
    """Predicted against empirical covariance, and the efficiency against the Cramer-Rao bound."""
    found: dict[str, object] = {}
    low, high = chi2.ppf([0.005, 0.995], 6 * runs) / runs
    print("\nMean squared error in units of the predicted covariance; 6 expected,", end=" ")
    print(f"99 % of such means lie between {low:.2f} and {high:.2f}")
    for kind in ("projective", "calibrated"):
        inside = shown = 0
        for level in reversed(LEVELS):
            text = f"{kind:<11} LOA{level} "
            for noise in NOISE_PX:
                mean = float(cells[kind, level, noise].squares.mean())
                inside += low <= mean <= high
                shown += 1
                text += f"{mean:7.2f}"
            print(text)
        usual = [c for (k, _, noise), c in cells.items() if k == kind and noise <= 1.5]
        efficiency = 1.0 / float(np.mean([1.0 / c.efficiency for c in usual]))
        good = [c for (k, level, noise), c in cells.items() if k == kind and noise <= 1.5 and level >= 30]
        tight = 1.0 / float(np.mean([1.0 / c.efficiency for c in good]))
        error = math.sqrt(2.0 / (6 * runs * len(good)))
        print(
            f"{kind}: {inside} of {shown} cells inside; efficiency against the bound up to 1.5 px: {tight:.3f} +- {error:.3f} "
            f"(LOA50 to LOA30), {efficiency:.3f} (all levels)"
        )
        found |= {f"{kind}_inside": inside, f"{kind}_cells": shown, f"{kind}_efficiency": tight}
    return found


def outliers(start: Array, end: Array, runs: int) -> dict[str, object]:
    """The whole matching with 40 % of the lines wrong: turned and shifted ones in place of the right ones."""
    sigma, noise = level_sigma(40), 1.0
    errors: dict[bool, list[Array]] = {False: [], True: []}
    failed = 0
    for run in range(runs):
        for spoiled in (False, True):
            rng = np.random.default_rng((run, 7))
            shaken = [p + rng.normal(0, sigma, p.shape) for p in (start, end)]
            seen = [TRUE.project(p) + rng.normal(0, noise, (len(p), 2)) for p in (start, end)]
            at = KnownCamera(coarse(rng), COARSE_M, math.radians(COARSE_DEG))
            if spoiled:
                for k in rng.permutation(len(start))[: round(WRONG * len(start))]:
                    shift, turn = rng.uniform(6, 60) * rng.choice([-1, 1]), rng.uniform(-0.05, 0.05)
                    along = seen[1][k] - seen[0][k]
                    across = np.array([-along[1], along[0]]) / np.linalg.norm(along)
                    seen[0][k] += (shift - turn * np.linalg.norm(along) / 2) * across
                    seen[1][k] += (shift + turn * np.linalg.norm(along) / 2) * across
            camera = place(shaken, seen, at, sigma, noise, run)
            if camera is None:
                failed += 1
            errors[spoiled].append(np.full(6, np.nan) if camera is None else pose_difference(camera, TRUE))
    clean, wrong = (np.array(errors[key]) for key in (False, True))
    rms = [np.sqrt(np.nanmean(e**2, axis=0)) for e in (clean, wrong)]
    ratio = float(np.sqrt((rms[1] ** 2 / rms[0] ** 2).mean()))
    worst = float((rms[1] / rms[0]).max())
    print(
        f"\n{WRONG:.0%} wrong lines (LOA40, 1 px, from 15 cm and 1 deg, matches unknown): position "
        f"{1000 * np.linalg.norm(rms[0][3:]):.1f} mm without, {1000 * np.linalg.norm(rms[1][3:]):.1f} mm with; rotation "
        f"{math.degrees(np.linalg.norm(rms[0][:3])):.3f} and {math.degrees(np.linalg.norm(rms[1][:3])):.3f} deg; ratio "
        f"{ratio:.2f} (worst parameter {worst:.2f}); {failed} of {2 * runs} not placed."
    )
    return {"outlier_ratio": ratio, "outlier_worst": worst, "outlier_failed": failed}


def place(
    model: list[Array], seen: list[Array], at: KnownCamera, sigma: float, noise: float, seed: int
) -> Camera | None:
    """Search, matching and adjustment as for a photo."""
    length = np.linalg.norm(seen[1] - seen[0], axis=1)
    order = np.argsort(-length)
    zero = np.zeros(len(length))
    lines = ImageLines(
        seen[0][order], seen[1][order], np.full(len(length), noise / math.sqrt(2)), noise * math.sqrt(2) / length[order], zero,
        zero,
    )
    index = np.arange(len(length))
    pixel = np.column_stack([at.camera.project(model[0]), at.camera.project(model[1])])
    visible = VisibleEdges(model[0], model[1], free_edges(index), index, pixel)
    found = search_pose(visible, lines, at, sigma, 200.0, seed)
    if found is None:
        return None
    known = KnownCamera(found[0], at.position_sigma, at.rotation_sigma)
    pairs = match_lines(visible, lines, known, sigma)
    if pairs is None:
        return None
    return adjust_matches(visible, lines, pairs[1], pairs[0], at, sigma, False)[0].camera


if __name__ == "__main__":
    main()
