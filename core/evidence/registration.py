"""How well are the stations registered? Their position errors' variance, estimated from what they saw.

A linear mixed model: every station s has an unknown position error e_s, independent normal with the same standard deviation
along each axis. Two kinds of observations tell of it:

- A piece of surface that two stations saw: the difference of their residuals is n.(e_s - e_t). What was built, and the
  plan, are the same for both.
- The mean residual of an element's face: n.(mean of e_s) + what that face is off from its plan. The spread of these over
  the faces of the building is part of the model; faces far off (moved elements) lose their weight.

The variance is estimated by restricted maximum likelihood (EM), which also says on how many degrees of freedom it rests.
Without a plan (``estimate_agreement``) only the first kind is there; slopes of the differences then tell of turns.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from .blocks import Blocks

Array = NDArray[np.float64]

FALLBACK_M = 0.002
"""Assumed where nothing tells: a usual target- or cloud-based registration."""
LEAST_FREEDOM = 3.0
LEAST_RETURNS = 12
LEVER_M = 20.0
"""A turn of a station is as usual as its shift over this length."""
LEAST_EXTENT_M = 0.3
"""Standard deviation of the places along a face below which differences say nothing of turns."""
TUKEY = 4.685
ROUNDS = 15
EM_STEPS = 200
SMALLEST_M = 1e-5


@dataclass(frozen=True)
class Registration:
    """Standard deviation of a station's position along one axis, and the degrees of freedom that it rests on."""

    sigma: float
    """Metres."""
    freedom: float

    @property
    def widening(self) -> float:
        """Factor on ``sigma`` so that 1.96 of it hold 95 %, as Student's distribution has it."""
        return float(stdtrit(self.freedom, 0.975)) / 1.96 if np.isfinite(self.freedom) else 1.0


def estimate_registration(elements: Iterable[Blocks], stations: int) -> Registration:
    """Estimate from the blocks of many elements, seen from ``stations`` stations."""
    differences, levels = [], []
    for blocks in elements:
        for face in range(int(blocks.face.max(initial=-1)) + 1):
            own = blocks.face == face
            normal = blocks.normal[own].mean(axis=0)
            if blocks.count[own].sum() < LEAST_RETURNS or np.linalg.norm(normal) < 0.9:
                continue
            differences += _differences(blocks, own, normal, stations)
            levels.append(_level(blocks, own, normal, stations))
    return _estimated(differences, levels, stations, LEAST_FREEDOM)


def estimate_agreement(faces: Iterable[Blocks], stations: int) -> tuple[Registration, Registration]:
    """Of the stations' positions, and of their turns as metres over ``LEVER_M``, from faces of which nothing is planned.

    Each of ``faces`` is one plane face, its residuals are from any plane near it.
    """
    shifts: list[Observation] = []
    turns: list[Observation] = []
    for blocks in faces:
        normal = blocks.normal[0]
        shifts += _differences(blocks, np.ones(len(blocks), dtype=np.bool_), normal, stations)
        turns += _slopes(blocks, normal, stations)
    # two stations that share a room tell of all three directions, and no more
    least = LEAST_FREEDOM - 0.5
    return _estimated(shifts, [], stations, least), _estimated(turns, [], stations, least)


def _estimated(
    differences: list[Observation], levels: list[Observation], stations: int, least_freedom: float
) -> Registration:
    if not differences and not levels:
        return Registration(FALLBACK_M, LEAST_FREEDOM)
    sigma, freedom = _mixed_model(differences, levels, stations)
    return Registration(sigma, freedom) if freedom >= least_freedom else Registration(FALLBACK_M, LEAST_FREEDOM)


Observation = tuple[Array, float, float]
"""Coefficients (3 S,) of the stations' errors, value [m], variance of its noise [m2]."""


def _differences(blocks: Blocks, own: NDArray[np.bool_], normal: Array, stations: int) -> list[Observation]:
    """One observation for each pair of stations that saw common pieces of a face."""
    found = []
    row = np.flatnonzero(own)
    for s, t in combinations(np.unique(blocks.station[row]).tolist(), 2):
        a, b = _common(blocks, row, s, t)
        if len(a) == 0 or min(blocks.count[a].sum(), blocks.count[b].sum()) < LEAST_RETURNS:
            continue
        noise = blocks.variance[a] + blocks.variance[b]
        weight = 1.0 / (noise + float(np.median(noise)))
        weight /= weight.sum()
        coefficient = np.zeros((stations, 3))
        coefficient[s], coefficient[t] = normal, -normal
        found.append((
            coefficient.ravel(), float(weight @ (blocks.residual[a] - blocks.residual[b])),
            float((weight**2) @ noise),
        ))
    return found


def _common(blocks: Blocks, row: NDArray[np.int64], s: int, t: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows of the blocks of two stations on the same pieces of surface."""
    a, b = row[blocks.station[row] == s], row[blocks.station[row] == t]
    _, i, j = np.intersect1d(blocks.cell[a], blocks.cell[b], assume_unique=True, return_indices=True)
    return a[i], b[j]


def _slopes(blocks: Blocks, normal: Array, stations: int) -> list[Observation]:
    """For each pair of stations how their difference changes along a face, in two directions, times ``LEVER_M``."""
    found = []
    first = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    first /= np.linalg.norm(first)
    axes = np.stack([first, np.cross(normal, first)])
    for s, t in combinations(np.unique(blocks.station).tolist(), 2):
        a, b = _common(blocks, np.arange(len(blocks)), s, t)
        noise = blocks.variance[a] + blocks.variance[b]
        if len(a) < 4:
            continue
        weight = 1.0 / (noise + float(np.median(noise)))
        place = 0.5 * (blocks.point[a] + blocks.point[b]) @ axes.T
        place = place - weight @ place / weight.sum()
        if np.sqrt(np.linalg.eigvalsh(np.cov(place.T))[0]) < LEAST_EXTENT_M:
            continue
        gain = np.linalg.solve((place * weight[:, None]).T @ place, (place * weight[:, None]).T)
        value = gain @ (blocks.residual[a] - blocks.residual[b])
        variance = (gain**2) @ noise
        for k, axis in enumerate(axes):
            coefficient = np.zeros((stations, 3))
            # a turn w moves the surface along the normal by w . (axis x normal) for each metre along the axis
            coefficient[s] = np.cross(axis, normal)
            coefficient[t] = -coefficient[s]
            found.append((coefficient.ravel(), LEVER_M * float(value[k]), LEVER_M**2 * float(variance[k])))
    return found


def _level(blocks: Blocks, own: NDArray[np.bool_], normal: Array, stations: int) -> Observation:
    """The mean residual of a face, every station with the share of its blocks."""
    weight = 1.0 / (blocks.variance[own] + float(np.median(blocks.variance[own])))
    weight /= weight.sum()
    coefficient = np.bincount(blocks.station[own], weight, minlength=stations)[:, None] * normal
    return coefficient.ravel(), float(weight @ blocks.residual[own]), float((weight**2) @ blocks.variance[own])


def _mixed_model(differences: list[Observation], levels: list[Observation], stations: int) -> tuple[float, float]:
    """(sigma [m], degrees of freedom) of the stations' errors.

    The freedom counts the combinations of errors that the observations would show if they were of the usual size; with
    errors too small to be seen the estimate goes to zero, and that is knowledge too.
    """
    kinds = [_stack(kind, stations) for kind in (differences, levels)]
    error = np.zeros(3 * stations)
    variance = FALLBACK_M**2
    values = vectors = projected = np.zeros(0)
    for _ in range(ROUNDS):
        normal_matrix, right = np.zeros((3 * stations, 3 * stations)), np.zeros(3 * stations)
        for a, d, noise in kinds:
            if not len(d):
                continue
            residual = d - a @ error
            beyond = max(2.198 * float(np.median(residual**2)) - float(np.median(noise)), 1e-10)
            u = residual / (TUKEY * np.sqrt(beyond + noise))
            weight = np.where(np.abs(u) < 1, (1 - u**2) ** 2, 0.0) / (beyond + noise)
            normal_matrix += (a * weight[:, None]).T @ a
            right += a.T @ (weight * d)
        values, vectors = np.linalg.eigh(normal_matrix)
        values = np.maximum(values, 0.0)
        projected = vectors.T @ right
        for _ in range(EM_STEPS):
            spread = 1.0 / (values + 1.0 / variance)
            variance = max(float(np.mean((spread * projected) ** 2 + spread)), SMALLEST_M**2)
        error = vectors @ (projected / (values + 1.0 / variance))
    freedom = float(np.sum(values / (values + FALLBACK_M**-2)))
    return float(np.sqrt(variance)), freedom


def _stack(kind: list[Observation], stations: int) -> tuple[Array, Array, Array]:
    if not kind:
        return np.zeros((0, 3 * stations)), np.zeros(0), np.zeros(0)
    return np.array([k[0] for k in kind]), np.array([k[1] for k in kind]), np.array([k[2] for k in kind])
