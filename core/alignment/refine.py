"""From a coarse pose to the pose where most faces of the model fit the returns."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..progress import Progress
from . import transform as se3
from .consensus import HALF_SUPPORT, agreement, search
from .planned_surface import Matches, PlannedSurface
from .robust_fit import FineWeights, coarse_weights, fine_weights, jacobian
from .subset import ReturnSubset

COARSE_SCALES_M = (0.6, 0.6, 0.6, 0.4, 0.4, 0.4, 0.28, 0.28, 0.2, 0.2, 0.14, 0.14, 0.1, 0.1, 0.07, 0.07, 0.05, 0.05)
"""Scales of the graduated kernel, metres: the first is about how far 0.5 m and 3 degrees move a wall at 5 m, the
last is well above noise and tolerance, so that the fine stage starts where its medians mean something."""
ALL_RETURNS_SCALE_M = 0.14
"""Scale from which all coarse returns are used, metres; wider ones take fewer: a wide search is slow, and rough."""
GATE_SCALES = 2.0
"""Matches further away than this many scales are left out: their kernel weight is below 4 %."""
COARSE_RETURNS = 8_000
SEARCH_RETURNS = 60_000
FINE_RETURNS = 60_000
SEARCH_GATE_M = 0.2
"""Gate of the search for the consensus, metres: twelve centimetres of a moved slab and what it drags the coarse
pose."""
CANDIDATES = 3
FINE_GATE_M = 0.05
"""Gate of the fine stage, metres: 2.5 times the widest spread that is believed."""
LARGEST_SPREAD_M = 0.02
"""Widest spread between faces that is believed to be building tolerance, metres (LOA20 allows 25 mm); a wider one is a
bad fit, and must not let moved elements in."""
STILL_M = 2e-6
"""The pose stands still when no match moves further than this, metres: a thousandth of the noise of a usual scanner."""
MATCH_STEPS = 8
WEIGHT_STEPS = 10
FEWEST_MATCHES = 300
"""Matched returns below which nothing is said about a campaign of any size."""
ADVICE = "Check that model and scans are of the same building and in the same units, or let the pose be searched."
DAMPING = 1e-7
"""Share of the trace added to the normal equations, so that a direction that nothing fixes stays where it is."""


@dataclass(frozen=True)
class Fit:
    """A refined pose and the matches that carry it."""

    pose: NDArray[np.float64]
    """(4, 4) scan frame to local frame."""
    center: NDArray[np.float64]
    """(3,) local frame, metres: centre of the matches."""
    extent: float
    """Root mean square distance of the matches from the centre, metres."""
    position: NDArray[np.float64]
    """(M, 3) matched returns, local frame."""
    matches: Matches
    station: NDArray[np.int32]
    """(M,) station of each match."""
    weights: FineWeights
    asked: int
    """Returns that were offered for matching."""


def refine(
    surface: PlannedSurface,
    returns: ReturnSubset,
    start: NDArray[np.float64],
    *,
    sigma: float,
    seed: int = 0,
    scales: tuple[float, ...] = COARSE_SCALES_M,
    progress: Progress | None = None,
) -> Fit:
    """Refine ``start`` (4x4, scan frame to local frame): coarse fit, search for the consensus, reweighted fine fit.

    Raises BimVerifyError when too few returns come to lie on the planned surface.
    """
    progress = progress or Progress()
    flat = np.flatnonzero(returns.flat)
    pose = coarse_pose(surface, returns, flat[:COARSE_RETURNS], start, scales, progress.part(0.0, 0.3))
    best: Fit | None = None
    support = -1.0
    candidates = _candidates(surface, returns, flat[:SEARCH_RETURNS], pose, sigma, seed)
    for k, candidate in enumerate(candidates):
        part = progress.part(0.3 + 0.7 * k / len(candidates), 0.3 + 0.7 * (k + 1) / len(candidates))
        fit = _settle(surface, returns, flat[:FINE_RETURNS], candidate, sigma, part)
        votes = _votes(surface, fit, sigma)
        if best is None or votes > support:
            best, support = fit, votes
    assert best is not None
    return best


def _candidates(
    surface: PlannedSurface,
    returns: ReturnSubset,
    chosen: NDArray[np.int64],
    pose: NDArray[np.float64],
    sigma: float,
    seed: int,
) -> list[NDArray[np.float64]]:
    position, matches = _match(surface, returns, chosen, pose, SEARCH_GATE_M)
    center, extent = _center(position, np.ones(len(position)))
    motions = search(
        position - center, matches, len(surface.patch_element), extent,
        sigma=sigma, gate=SEARCH_GATE_M, seed=seed, keep=CANDIDATES,
    )
    return [se3.exp_about(motion, center) @ pose for motion in motions]


def _settle(
    surface: PlannedSurface,
    returns: ReturnSubset,
    chosen: NDArray[np.int64],
    pose: NDArray[np.float64],
    sigma: float,
    progress: Progress,
) -> Fit:
    """Reweighted point-to-plane steps until the pose stands still; matches are made anew in each outer step."""
    for outer in range(MATCH_STEPS):
        progress.update(outer / MATCH_STEPS, "Refining the alignment")
        position, matches = _match(surface, returns, chosen, pose, FINE_GATE_M)
        if len(matches.row) < FEWEST_MATCHES:
            raise BimVerifyError(
                f"Too few returns agree with the model: {len(matches.row)} of {len(chosen)} lie on it. {ADVICE}"
            )
        center, extent = _center(position, np.ones(len(position)))
        rows = jacobian(position - center, matches.normal)
        total, matches, weights = adjust(rows, matches, len(surface.patch_element), extent, sigma)
        pose = se3.exp_about(total, center) @ pose
        if _reach(total, extent) < 10 * STILL_M:
            break
    station = returns.station[chosen[matches.row]]
    return Fit(pose, center, extent, position, matches, station, weights, len(chosen))


def adjust(
    rows: NDArray[np.float64], matches: Matches, faces: int, extent: float, sigma: float
) -> tuple[NDArray[np.float64], Matches, FineWeights]:
    """Reweighted steps on fixed matches: the motion (6,), the matches with their residuals after it, and the weights.

    ``rows`` (M, 6) is the Jacobian of the matches, ``extent`` [m] their radius, ``sigma`` [m] the noise of a return.
    """
    residual, total = matches.residual, np.zeros(6)
    for _ in range(WEIGHT_STEPS):
        weights = fine_weights(matches, faces, sigma=sigma, largest=LARGEST_SPREAD_M)
        twist = _solve(rows, matches.residual, weights.match, extent)
        total = total + twist
        matches = replace(matches, residual=residual + rows @ total)
        if _reach(twist, extent) < STILL_M:
            break
    return total, matches, weights


def _votes(surface: PlannedSurface, fit: Fit, sigma: float) -> float:
    """Sum over faces of the share of it that agrees, each face counting as in the search."""
    count = np.bincount(fit.matches.patch, minlength=len(surface.patch_element))
    value = agreement(fit.matches.residual, sigma, SEARCH_GATE_M)
    mean = np.bincount(fit.matches.patch, weights=value, minlength=len(count)) / np.maximum(count, 1)
    return float(np.sum(mean * count / (count + HALF_SUPPORT)))


def _reach(twist: NDArray[np.float64], extent: float) -> float:
    return float(np.linalg.norm(twist[3:]) + extent * np.linalg.norm(twist[:3]))


def coarse_pose(
    surface: PlannedSurface,
    returns: ReturnSubset,
    chosen: NDArray[np.int64],
    start: NDArray[np.float64],
    scales: tuple[float, ...],
    progress: Progress,
) -> NDArray[np.float64]:
    """Graduated Geman-McClure fit of the chosen returns, one step a scale."""
    pose = start
    for step, scale in enumerate(scales):
        progress.update(step / len(scales), "Coarse alignment")
        part = chosen[: max(int(len(chosen) * min(1.0, ALL_RETURNS_SCALE_M / scale)), FEWEST_MATCHES)]
        position, matches = _match(surface, returns, part, pose, GATE_SCALES * scale)
        if len(matches.row) < 6:
            continue
        weight = coarse_weights(matches, len(surface.patch_element), scale)
        center, extent = _center(position, weight)
        rows = jacobian(position - center, matches.normal)
        pose = se3.exp_about(_solve(rows, matches.residual, weight, extent), center) @ pose
    return pose


def _match(
    surface: PlannedSurface, returns: ReturnSubset, chosen: NDArray[np.int64], pose: NDArray[np.float64], gate: float
) -> tuple[NDArray[np.float64], Matches]:
    position = se3.apply(pose, returns.position[chosen])
    normal = se3.rotate(pose, returns.normal[chosen])
    station = returns.station[chosen]
    to_station = se3.apply(pose, returns.station_position)[station] - position
    known = returns.known[station]
    if not known.all():
        normal = _planned_side(surface, position, normal, known)
        to_station = np.where(known[:, None], to_station, normal)
    matches = surface.match(position, normal, gate, to_station)
    return position[matches.row], matches


def _planned_side(
    surface: PlannedSurface, position: NDArray[np.float64], normal: NDArray[np.float64], known: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Turn the normals whose side is open (no scanner position) to the side of the nearest planned face."""
    back = ~known & (surface.distance(position, -normal) < surface.distance(position, normal))
    return np.where(back[:, None], -normal, normal)


def _center(position: NDArray[np.float64], weight: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    total = weight.sum()
    if total <= 0:
        return np.zeros(3), 1.0
    center = weight @ position / total
    square = np.square(position - center).sum(axis=1)
    return center, float(np.sqrt(weight @ square / total))


def _solve(
    rows: NDArray[np.float64], residual: NDArray[np.float64], weight: NDArray[np.float64], extent: float
) -> NDArray[np.float64]:
    """(6,) step; rotations are scaled by the extent so that the damping treats all six alike."""
    scale = np.array([extent] * 3 + [1.0] * 3)
    scaled = rows / scale
    matrix = scaled.T @ (weight[:, None] * scaled)
    matrix += (DAMPING * np.trace(matrix) + 1e-300) * np.eye(6)
    return -np.linalg.solve(matrix, scaled.T @ (weight * residual)) / scale
