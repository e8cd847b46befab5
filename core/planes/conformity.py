"""Is it plumb, square, parallel, flat? Tests with p-values, against nothing and against the limits of DIN 18202."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, norm

from .derived import angle_between, plumb_deviation
from .fit import Plane

Array = NDArray[np.float64]

UPRIGHT = np.sin(np.radians(5.0))
Z90 = float(norm.ppf(0.95))
LEAST_IN_CELL = 5
STEADY = 10.0
"""Returns that the scatter of all cells weighs as many as."""
ANGLE_LIMITS_MM = ((0.5, 3.0), (1.0, 6.0), (3.0, 8.0), (6.0, 12.0), (15.0, 16.0), (30.0, 20.0), (np.inf, 30.0))
"""DIN 18202:2013 table 2: up to that length [m], this offset [mm] from plumb, level or a right angle."""
FLATNESS_LIMITS_MM: Mapping[str, tuple[tuple[float, float], ...]] = {
    "finished floor": ((0.1, 2.0), (1.0, 4.0), (4.0, 10.0), (10.0, 12.0), (15.0, 15.0)),
    "raw wall": ((0.1, 5.0), (1.0, 10.0), (4.0, 15.0), (10.0, 25.0), (15.0, 30.0)),
    "finished wall": ((0.1, 3.0), (1.0, 5.0), (4.0, 10.0), (10.0, 20.0), (15.0, 25.0)),
}
"""DIN 18202:2013 table 3, rows 3, 5 and 6: distance of the measuring points [m], largest gap [mm]."""


@dataclass(frozen=True)
class Conformity:
    """A test: ``value`` and ``sigma`` in SI units; ``p_value`` of no deviation at all; ``p_limit`` of keeping the limit."""

    name: str
    value: float
    sigma: float
    p_value: float
    limit: float
    p_limit: float

    @property
    def significant(self) -> bool:
        """It deviates, at 95 %."""
        return self.p_value < 0.05

    @property
    def exceeds(self) -> bool:
        """It breaks the limit, at 95 %."""
        return self.p_limit < 0.05

    @property
    def keeps(self) -> bool:
        """It keeps the limit, at 95 %. Where neither holds, the question is open."""
        return bool(not self.exceeds and abs(self.value) + Z90 * self.sigma < self.limit)


def angle_limit(length: float) -> float:
    """Largest offset [m] allowed over ``length`` [m]."""
    return next(mm for reach, mm in ANGLE_LIMITS_MM if length <= reach) / 1000.0


def plumb(plane: Plane, height: float) -> Conformity:
    """A wall against the vertical, as an offset [m] over its ``height`` [m]."""
    lean = plumb_deviation(plane)
    return _offset("plumb", float(np.tan(lean.value)) * height, lean.sigma * height, angle_limit(height))


def orthogonality(first: Plane, second: Plane, length: float) -> Conformity:
    """Two planes against the right angle, as an offset [m] over ``length`` [m]."""
    angle = angle_between(first, second)
    return _offset("orthogonality", (angle.value - np.pi / 2) * length, angle.sigma * length, angle_limit(length))


def parallelism(first: Plane, second: Plane, length: float) -> Conformity:
    """Two planes against being parallel, as an offset [m] over ``length`` [m].

    Of upright planes in plan only: how they lean is ``plumb``'s. Of others two turns count at once, so the test is a
    chi-square one with two degrees.
    """
    other = second.normal if first.normal @ second.normal > 0 else -second.normal
    limit = angle_limit(length)
    if max(abs(first.normal[2]), abs(second.normal[2])) < UPRIGHT:
        level = np.array([-first.normal[1], first.normal[0], 0.0])
        level /= np.linalg.norm(level)
        turns = [p.axes @ level for p in (first, second)]
        variance = sum(float(t @ p.covariance[:2, :2] @ t) for t, p in zip(turns, (first, second), strict=True))
        offset = abs(float(level @ (other - first.normal))) * length
        return _offset("parallelism", offset, math.sqrt(variance) * length, limit)
    turn = first.axes @ (other - first.normal)
    across = first.axes @ second.axes.T
    covariance = first.covariance[:2, :2] + across @ second.covariance[:2, :2] @ across.T
    size = float(np.linalg.norm(turn))
    p = float(chi2.sf(turn @ np.linalg.solve(covariance, turn), 2))
    unit = turn / max(size, 1e-15)
    sigma = float(np.sqrt(unit @ covariance @ unit)) * length
    return Conformity("parallelism", size * length, sigma, p, limit, _keeps(size * length, sigma, limit))


def flatness(
    plane: Plane, points: Array, kind: str = "finished wall", cell: float = 0.1, shared_sigma: float = 0.0,
    unit_errors: Array | None = None,
) -> list[Conformity]:
    """Gaps under a straightedge in both directions of the plane, for each distance of the table that the cells resolve.

    ``shared_sigma`` [m] is what the mean of a cell may be off by however many points it has; ``unit_errors`` (N, K) [m] how
    far each point moves with each of K independent errors of size one, as those of stations. Heights are means of cells of
    ``cell`` metres, so noise is averaged; the gap is that of the middle under the line through two places. The largest of
    many gaps is tested, with Bonferroni's bound.
    """
    q = np.asarray(points) - plane.centroid
    at, off = q @ plane.axes.T, q @ plane.normal
    number = ((at - at.min(axis=0)) / cell).astype(np.int64)
    shape = tuple((number.max(axis=0) + 1).tolist())
    flat = number[:, 0] * shape[1] + number[:, 1]
    count = np.bincount(flat, minlength=shape[0] * shape[1]).reshape(shape)
    with np.errstate(invalid="ignore", divide="ignore"):
        height = np.bincount(flat, off, shape[0] * shape[1]).reshape(shape) / count
        square = np.bincount(flat, off**2, shape[0] * shape[1]).reshape(shape) / count
    enough = count >= LEAST_IN_CELL
    inner = np.maximum(square - height**2, 0.0)[enough]
    within = float(np.sqrt((inner * count[enough]).sum() / (count[enough] - 1).sum())) if enough.any() else 0.0
    # noise differs over a face with the incidence: a cell's own scatter counts where it is larger than that of all
    with np.errstate(invalid="ignore", divide="ignore"):
        spread = np.maximum(square - height**2, 0.0) * count + STEADY * within**2
        variance = np.maximum(spread / (np.maximum(count - 1, 0) + STEADY), within**2) / count
    common = np.zeros((*shape, 0))
    if unit_errors is not None:
        with np.errstate(invalid="ignore", divide="ignore"):
            common = np.stack([
                np.bincount(flat, e, shape[0] * shape[1]).reshape(shape) / count for e in unit_errors.T
            ], axis=2)
    out = []
    for distance, limit in FLATNESS_LIMITS_MM[kind]:
        step = round(distance / cell / 2)
        if not step:
            continue
        gaps, sigmas = [], []
        for axis in (0, 1):
            if shape[axis] <= 2 * step:
                continue
            h, v, good, e = (np.moveaxis(a, axis, 0) for a in (height, variance, enough, common))
            ok = good[: -2 * step] & good[step:-step] & good[2 * step :]
            gap = h[step:-step] - 0.5 * (h[: -2 * step] + h[2 * step :])
            own = v[step:-step] + 0.25 * (v[: -2 * step] + v[2 * step :])
            stations = e[step:-step] - 0.5 * (e[: -2 * step] + e[2 * step :])
            sigma = np.sqrt(own + 1.5 * shared_sigma**2 + (stations**2).sum(axis=-1))
            gaps.append(np.abs(gap[ok]))
            sigmas.append(sigma[ok])
        if not gaps or not sum(len(g) for g in gaps):
            continue
        gap, sigma = np.concatenate(gaps), np.maximum(np.concatenate(sigmas), 1e-9)
        worst = int(np.argmax(gap - limit / 1000.0))
        p_zero = min(1.0, float((2 * norm.sf(gap / sigma)).min()) * len(gap))
        p_limit = min(1.0, float(norm.sf((gap - limit / 1000.0) / sigma).min()) * len(gap))
        name = f"flatness {distance:g} m"
        out.append(Conformity(name, float(gap[worst]), float(sigma[worst]), p_zero, limit / 1000.0, p_limit))
    return out


def _offset(name: str, offset: float, sigma: float, limit: float) -> Conformity:
    sigma = max(sigma, 1e-15)
    return Conformity(name, offset, sigma, float(2 * norm.sf(abs(offset) / sigma)), limit, _keeps(offset, sigma, limit))


def _keeps(offset: float, sigma: float, limit: float) -> float:
    """How likely so large an offset is where the limit is just kept."""
    sigma = max(sigma, 1e-15)
    return float(norm.sf((abs(offset) - limit) / sigma) + norm.sf((abs(offset) + limit) / sigma))
