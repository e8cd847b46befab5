"""Which pose do most faces of the model agree on? A search over small motions near a coarse pose."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .planned_surface import Matches
from .robust_fit import FEWEST_IN_PATCH, jacobian

Array = NDArray[np.float64]

PER_FACE = 24
"""Returns that stand for a face in the search; they hold its offset to a fifth of the noise, and its tilt."""
TRIALS = 600
"""Random draws of faces. With half of the faces moved, one draw in 32 is free of them: 600 give nineteen good ones."""
FACES_PER_TRIAL = 5
"""Three faces fix a pose when they are at right angles; two more make most random draws well-conditioned."""
HALF_SUPPORT = 50
"""Matches at which a face counts half: a large face counts as one face, not by its area, so a moved slab is one
vote."""
PRIOR_M = 0.1
"""How far from the coarse pose a draw may wander in directions that its faces do not fix, metres."""
RIVAL = 0.9
"""Share of the best score from which another motion is worth a fine fit of its own."""
POLISHED = 12
"""Best draws that are polished on all faces before the last ranking."""
POLISH_STEPS = 8


def search(
    position: Array, matches: Matches, faces: int, extent: float, *, sigma: float, gate: float, seed: int, keep: int
) -> list[Array]:
    """Motions (6,) about the origin of ``position`` on which most faces agree, best first, at most ``keep`` distinct
    ones.

    ``position`` (M, 3) are the matched returns [m] from the centre of rotation, ``extent`` their radius. Random draws
    of a few faces each give a motion (Fischler and Bolles 1981, with a local polish); it is ranked by the sum over all
    faces of a Cauchy-like agreement, which needs no scale of the building's own deviations: ``sigma`` is the noise of a
    return, ``gate`` the distance at which a match stops counting.
    """
    rows, residual, face, vote = _representatives(position, matches, faces, extent)
    if len(vote) < 3:
        return [np.zeros(6)]
    normal_of, gradient_of = _face_equations(rows, residual, face, len(vote), sigma)
    rng = np.random.default_rng(seed)
    score = Score(rows, residual, face, vote, sigma, gate)
    share = vote / vote.sum()
    size = min(FACES_PER_TRIAL, len(vote))
    draws = np.stack([rng.choice(len(vote), size, replace=False, p=share) for _ in range(TRIALS)])
    prior = np.eye(6) / PRIOR_M**2
    motion = -np.linalg.solve(normal_of[draws].sum(axis=1) + prior, gradient_of[draws].sum(axis=1)[:, :, None])[:, :, 0]
    motion = np.vstack([np.zeros(6), motion])
    best = np.argsort(-score.of(motion), kind="stable")[:POLISHED]
    polished = np.stack([score.polish(motion[b]) for b in best])
    value = score.of(polished)
    chosen: list[Array] = []
    for k in np.argsort(-value, kind="stable"):
        if value[k] > RIVAL * value.max() and all(np.linalg.norm(polished[k] - c) > sigma for c in chosen):
            chosen.append(polished[k])
    for motion_k in chosen:
        motion_k[:3] /= extent
    return chosen[:keep]


def agreement(residual: Array, sigma: float, gate: float) -> Array:
    """1 at zero, falling with the logarithm of the residual, 0 from the gate on (a cut Cauchy log-likelihood)."""
    floor = sigma**2
    value = np.log((floor + gate**2) / (floor + np.square(residual)))
    return np.clip(value / np.log1p(gate**2 / floor), 0.0, None)


class Score:
    """Votes of the faces for a motion; motions (K, 6) with rotations scaled by the extent."""

    def __init__(
        self, rows: Array, residual: Array, face: NDArray[np.int64], vote: Array, sigma: float, gate: float
    ) -> None:
        self.rows, self.residual, self.sigma, self.gate = rows, residual, sigma, gate
        self.weight = (vote / np.bincount(face, minlength=len(vote)))[face]

    def of(self, motion: Array) -> Array:
        """(K,) sum of votes."""
        moved = self.residual[None, :] + motion @ self.rows.T
        return agreement(moved, self.sigma, self.gate) @ self.weight

    def polish(self, motion: Array) -> Array:
        """A few reweighted steps uphill."""
        for _ in range(POLISH_STEPS):
            moved = self.residual + self.rows @ motion
            weight = self.weight / (self.sigma**2 + np.square(moved)) * (np.abs(moved) < self.gate)
            matrix = self.rows.T @ (weight[:, None] * self.rows)
            matrix += 1e-6 * np.trace(matrix) * np.eye(6)
            motion = motion - np.linalg.solve(matrix, self.rows.T @ (weight * moved))
        return motion


def _representatives(
    position: Array, matches: Matches, faces: int, extent: float
) -> tuple[Array, Array, NDArray[np.int64], Array]:
    """The first few matches of each face that has enough (they come in random order), and its vote."""
    count = np.bincount(matches.patch, minlength=faces)
    order = np.argsort(matches.patch, kind="stable")
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order)) - (np.cumsum(count) - count)[matches.patch[order]]
    chosen = np.flatnonzero((rank < PER_FACE) & (count[matches.patch] >= FEWEST_IN_PATCH))
    kept, face = np.unique(matches.patch[chosen], return_inverse=True)
    rows = jacobian(position[chosen], matches.normal[chosen])
    rows[:, :3] /= extent
    return rows, matches.residual[chosen], face, count[kept] / (count[kept] + HALF_SUPPORT)


def _face_equations(
    rows: Array, residual: Array, face: NDArray[np.int64], faces: int, sigma: float
) -> tuple[Array, Array]:
    """(F, 6, 6) and (F, 6) normal equations of each face alone, after a cut about its own median."""
    order = np.lexsort((residual, face))
    count = np.bincount(face, minlength=faces)
    middle = residual[order][np.cumsum(count) - count + (count - 1) // 2]
    inner = residual - middle[face]
    weight = 1.0 / (sigma**2 + np.square(inner))
    matrix = np.zeros((faces, 6, 6))
    gradient = np.zeros((faces, 6))
    np.add.at(matrix, face, weight[:, None, None] * rows[:, :, None] * rows[:, None, :])
    np.add.at(gradient, face, (weight * residual)[:, None] * rows)
    return matrix, gradient
