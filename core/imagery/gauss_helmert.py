"""The Gauss-Helmert model with constraints for lines in an image and edges of a model.

For each match the image line l and two points X, Y of the model edge are observed. Two conditions hold between them and the
projection matrix P: l^T P X = 0 and l^T P Y = 0. They span the two independent rows of Gamma(L) P^T l = 0 (Förstner and Wrobel
2016), so the estimate is the same. Observations are spherically normalised, which is kept by constraints on them
(Meidow, Beder and Förstner 2009).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from .uncertain_lines import tangent

Vector = NDArray[np.float64]
MOST_ROUNDS = 60
SMALL_STEP = 1e-3
"""A step below this share of the parameters' own standard deviations ends the iteration."""


@dataclass(frozen=True)
class Observations:
    """Normalised lines (N, 3) and points (N, 4), with singular covariances along themselves."""

    line: Vector
    start: Vector
    end: Vector
    line_cov: Vector
    start_cov: Vector
    end_cov: Vector


@dataclass(frozen=True)
class Parametrisation:
    """What the parameters are: how P (3, 4) follows from a state, and how a step changes the state."""

    matrix: Callable[[object], Vector]
    jacobian: Callable[[object], Vector]
    """(12, u): d vec(P) / d parameters, rows of P one after the other."""
    step: Callable[[object, Vector], object]
    constraint: Callable[[object], tuple[Vector, Vector]] | None = None
    """State -> H (u, h) and h (h,), with H^T step = -h."""
    prior: Callable[[object], tuple[Vector, Vector]] | None = None
    """State -> information (u, u) and its product with (prior - state) (u,)."""


@dataclass(frozen=True)
class Adjustment:
    """The estimate: ``state``, ``covariance`` (u, u) before scaling by the variance factor, and how well it fits."""

    state: object
    covariance: Vector
    variance_factor: float
    redundancy: int
    test: Vector
    """(N,) of each match: its contradiction against the estimate, chi-square distributed with two degrees."""
    rounds: int


def adjust(
    observed: Observations, state: object, parameters: Parametrisation, weight: Vector | None = None
) -> Adjustment:
    """Estimate the parameters from all matches; ``weight`` (N,) down-weights single ones.

    Raises BimVerifyError when the normal equations are singular or the iteration does not settle.
    """
    weight = np.ones(len(observed.line)) if weight is None else np.maximum(weight, 1e-12)
    current = observed
    rounds = 0
    for _ in range(MOST_ROUNDS):
        rounds += 1
        p = parameters.matrix(state)
        a_p, blocks = _jacobians(current, p)
        design = a_p.reshape(-1, 12) @ parameters.jacobian(state)
        design = design.reshape(len(weight), 2, -1)
        cov, misclosure = _contradictions(observed, current, blocks, p)
        cov = cov / weight[:, None, None]
        inverse = np.linalg.inv(cov)
        normal = np.einsum("nki,nkl,nlj->ij", design, inverse, design)
        right = np.einsum("nki,nkl,nl->i", design, inverse, misclosure)
        step, covariance = _solve(normal, right, state, parameters)
        state = parameters.step(state, step)
        scaled = np.einsum("nkl,nl->nk", inverse, np.einsum("nki,i->nk", design, step) - misclosure)
        current = _corrected(observed, blocks, scaled, current)
        if np.all(np.abs(step) <= SMALL_STEP * np.sqrt(np.maximum(np.diag(covariance), 0.0)) + 1e-14):
            break
    else:
        raise BimVerifyError(
            "The pose does not settle: the lines contradict each other or do not fix it; check the matches and the start."
        )
    redundancy = 2 * len(weight) - design.shape[2] + (0 if parameters.constraint is None else 1)
    contradiction = np.einsum("nkl,nl->nk", cov, scaled)
    own = cov - np.einsum("nki,ij,nlj->nkl", design, covariance, design)
    test = np.einsum("nk,nkl,nl->n", contradiction, np.linalg.pinv(own, hermitian=True), contradiction)
    factor = float(np.einsum("nk,nkl,nl->", scaled, cov, scaled)) / max(redundancy, 1)
    return Adjustment(state, covariance, factor, redundancy, test, rounds)


def _jacobians(current: Observations, p: Vector) -> tuple[Vector, tuple[Vector, Vector, Vector]]:
    """Of the two conditions: to vec(P) (N, 2, 12), and to line (N, 2, 3), start (N, 4) and end (N, 4)."""
    line, ends = current.line, np.stack([current.start, current.end], axis=1)
    to_p = np.einsum("ni,nkj->nkij", line, ends).reshape(len(line), 2, 12)
    to_line = ends @ p.T
    to_point = line @ p
    return to_p, (to_line, to_point, to_point)


def _contradictions(
    observed: Observations, current: Observations, blocks: tuple[Vector, Vector, Vector], p: Vector
) -> tuple[Vector, Vector]:
    """Covariance (N, 2, 2) of the contradictions, and what is left of them at the observed values (N, 2)."""
    to_line, to_start, to_end = blocks
    line_cov = _transported(observed.line_cov, current.line)
    cov = to_line @ line_cov @ to_line.transpose(0, 2, 1)
    cov[:, 0, 0] += np.einsum("ni,nij,nj->n", to_start, _transported(observed.start_cov, current.start), to_start)
    cov[:, 1, 1] += np.einsum("ni,nij,nj->n", to_end, _transported(observed.end_cov, current.end), to_end)
    floor = 1e-24 + 1e-12 * np.trace(cov, axis1=1, axis2=2)
    cov[:, [0, 1], [0, 1]] += floor[:, None]
    value = np.einsum("ni,nki->nk", current.line, to_line)
    value = value + np.einsum("nki,ni->nk", to_line, _along(current.line, observed.line - current.line))
    value[:, 0] += np.einsum("ni,ni->n", to_start, _along(current.start, observed.start - current.start))
    value[:, 1] += np.einsum("ni,ni->n", to_end, _along(current.end, observed.end - current.end))
    return cov, -value


def _transported(cov: Vector, unit: Vector) -> Vector:
    """Covariances in the tangent space of the corrected observations, where the constraints on them hold."""
    projector = tangent(unit)
    return projector @ cov @ projector


def _along(unit: Vector, difference: Vector) -> Vector:
    """The part of a difference that lies in the tangent space; the constraints take the rest."""
    return np.asarray(difference - unit * np.einsum("ni,ni->n", unit, difference)[:, None])


def _corrected(
    observed: Observations, blocks: tuple[Vector, Vector, Vector], scaled: Vector, current: Observations
) -> Observations:
    """Observations plus residuals -Sigma B lambda, on the sphere again."""
    to_line, to_start, to_end = blocks
    line = _moved(observed.line, observed.line_cov, np.einsum("nki,nk->ni", to_line, scaled), current.line)
    start = _moved(observed.start, observed.start_cov, to_start * scaled[:, :1], current.start)
    end = _moved(observed.end, observed.end_cov, to_end * scaled[:, 1:], current.end)
    return Observations(line, start, end, observed.line_cov, observed.start_cov, observed.end_cov)


def _moved(observed: Vector, cov: Vector, gradient: Vector, current: Vector) -> Vector:
    residual = np.einsum("nij,nj->ni", _transported(cov, current), gradient)
    moved = current + _along(current, observed - current) - residual
    return np.asarray(moved / np.linalg.norm(moved, axis=1, keepdims=True))


def _solve(normal: Vector, right: Vector, state: object, parameters: Parametrisation) -> tuple[Vector, Vector]:
    """Step and covariance (u, u) from the normal equations, bordered by the constraint."""
    count = len(right)
    if parameters.prior is not None:
        information, pull = parameters.prior(state)
        normal, right = normal + information, right + pull
    if parameters.constraint is not None:
        border, value = parameters.constraint(state)
        normal = np.block([[normal, border], [border.T, np.zeros((border.shape[1],) * 2)]])
        right = np.concatenate([right, -value])
    scale = 1.0 / np.sqrt(np.maximum(np.abs(np.diag(normal)), 1e-300))
    scale[count:] = 1.0
    try:
        inverse = np.linalg.inv(normal * scale[:, None] * scale[None, :]) * scale[:, None] * scale[None, :]
    except np.linalg.LinAlgError as error:
        raise BimVerifyError("The matched lines do not fix the camera's pose; match more lines in other directions.") from error
    step = inverse @ right
    if not np.isfinite(step).all():
        raise BimVerifyError("The matched lines do not fix the camera's pose; match more lines in other directions.")
    return step[:count], inverse[:count, :count]
