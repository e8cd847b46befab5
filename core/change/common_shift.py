"""What all elements are off by together: an error of the whole visit's place, or of the building's, not of any element.

Whether the poses of a visit are right cannot be told from its stations alone: they may all be off by the same. What the fits
of the elements share can.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from ..evidence.decide import Place, enough_seen
from ..evidence.robust_fit import fit_agreeing, normal_matrix
from ..evidence.thresholds import Thresholds
from ..model.elements import BuildingModel
from .results import CommonShift

Array = NDArray[np.float64]

LEAST_ELEMENTS = 3
"""A direction is fixed when the fits of so many elements agree along it: one or two may have moved."""
LEAST_FOR_TURN = 20
"""... and a turn when so many do, in all: of fewer, one that moved may look like it."""
AGREES = 0.5
"""A fit agrees with what the others share when it keeps this much of its weight."""
LEAST_AGREEING = 0.5
"""... and no less than this share of those that tell."""
EXPECTED_M = 0.001
"""Elements are built no closer to each other than this, whatever their fits say."""
ON_AXIS = 0.9
"""An axis of the model is fixed when this much of it lies in the fixed directions."""
LARGEST_SPREAD_M = 0.02
"""Elements that scatter more than this about what they share share nothing (see ``alignment.voting``)."""


@dataclass(frozen=True)
class Fits:
    """Where the fits of E elements say that they stand against the plan; nothing of those that were not found."""

    middle: Array
    """(E, 3) of the elements' boxes, metres, local frame."""
    shift: Array
    """(E, 3) metres."""
    covariance: Array
    """(E, 3, 3)"""
    known: Array
    """(E, 3, 3) projectors on the directions that the scan determines."""

    @classmethod
    def of(cls, model: BuildingModel, plans: Sequence[Place], best: Sequence[Place], t: Thresholds) -> Fits:
        """From the place at which each element fits best."""
        count = len(plans)
        shift, covariance, known = np.zeros((count, 3)), np.zeros((count, 3, 3)), np.zeros((count, 3, 3))
        for e, place in enumerate(best):
            enough = enough_seen(place, (place.at + place.beyond) / max(place.exposed, 1e-12), t)
            if enough and place.share >= t.present_share:
                shift[e], covariance[e] = place.fit.vector, place.fit.covariance
                known[e] = place.fit.determined.T @ place.fit.determined
        low, high = model.element_bounds
        return cls(0.5 * (low + high), shift, covariance, known)

    def since(self, before: Fits) -> Fits:
        """How the elements stand against where they stood ``before``, in the directions that both determine."""
        values, axes = np.linalg.eigh(self.known + before.known)
        both = np.einsum("eik,ek,ejk->eij", axes, values > 1.999, axes)
        return Fits(self.middle, self.shift - before.shift, self.covariance + before.covariance, both)


def common_shift(fits: Fits) -> CommonShift | None:
    """The shift, and the turn where it shows, that most elements share; None where too few tell, or share none.

    Elements that moved for themselves lose their weight. Each counts once along every direction that its fit knows.
    """
    values, axes = np.linalg.eigh(fits.known)
    element, axis = np.nonzero(values > 0.5)
    normal = axes[element, :, axis]
    basis = _supported(np.eye(3), normal, np.ones(len(normal), np.bool_))
    if not len(basis):
        return None
    residual = np.einsum("ni,ni->n", normal, fits.shift[element])
    variance = np.einsum("ni,nij,nj->n", normal, fits.covariance[element], normal)
    basis, found, robust, spread2 = fit_agreeing(normal, residual, variance, EXPECTED_M**2, basis)
    basis, found, robust, spread2 = _kept(normal, residual, variance, basis, found, robust, spread2)
    if not len(basis) or math.sqrt(spread2) > LARGEST_SPREAD_M or np.mean(robust > AGREES) < LEAST_AGREEING:
        return None
    arm = fits.middle[element] - np.average(fits.middle[element], axis=0, weights=robust)
    turned = _turned(element, normal, arm, residual, variance, basis, robust, spread2)
    turn = np.zeros(3)
    if turned is not None:
        shift, turn, covariance, robust = turned
        arm = arm - np.average(arm, axis=0, weights=robust)
    else:
        a = normal @ basis.T
        shift = basis.T @ found
        covariance = basis.T @ np.linalg.inv(normal_matrix(a, robust / (variance + spread2))) @ basis
    inside = basis @ covariance @ basis.T
    on_axis = np.linalg.norm(basis, axis=0) > ON_AXIS
    statistic = float((basis @ shift) @ np.linalg.solve(inside, basis @ shift))
    length = float(np.linalg.norm(shift))
    along = shift / length if length > 1e-12 else basis[0]
    lever2 = float(np.average((np.cross(turn, arm) ** 2).sum(axis=1), weights=robust))
    x, y, z = (float(v) for v in shift)
    return CommonShift(
        (x, y, z), None if turned is None else (float(turn[0]), float(turn[1]), float(turn[2])),
        math.sqrt(float(along @ covariance @ along)), len(np.unique(element[robust > AGREES])),
        (bool(on_axis[0]), bool(on_axis[1]), bool(on_axis[2])),
        turned is not None or statistic > chdtri(len(basis), 0.05), math.sqrt((length**2 + lever2) / 3.0),
    )


def _supported(basis: Array, rows: Array, agreeing: NDArray[np.bool_]) -> Array:
    """Directions (K, D) within ``basis`` on which at least ``LEAST_ELEMENTS`` of ``rows`` (N, D) are ``agreeing`` (N,)."""
    if not len(basis) or not agreeing.any():
        return basis[:0]
    a = rows[agreeing] @ basis.T
    values, axes = np.linalg.eigh(a.T @ a)
    supported: Array = axes[:, values >= LEAST_ELEMENTS - 1e-9].T @ basis
    return supported


def _kept(
    rows: Array, residual: Array, variance: Array, basis: Array, found: Array, robust: Array, spread2: float
) -> tuple[Array, Array, Array, float]:
    """The same fit, in the directions that enough elements agree on."""
    while len(basis) and len(kept := _supported(basis, rows, robust > AGREES)) < len(basis):
        basis, found, robust, spread2 = fit_agreeing(rows, residual, variance, EXPECTED_M**2, kept)
    return basis, found, robust, spread2


def _turned(
    element: NDArray[np.int64], normal: Array, arm: Array, residual: Array, variance: Array, basis: Array, robust: Array,
    spread2: float,
) -> tuple[Array, Array, Array, Array] | None:
    """(shift (3,), turn (3,) [rad], covariance (3, 3) of the shift, weights) where a turn shows at 99 %, else None.

    All directions of the shift must stay fixed beside it.
    """
    extent = math.sqrt(float(np.average((arm**2).sum(axis=1), weights=robust)))
    if extent < 1e-3:
        return None
    rows = np.hstack([normal, np.cross(arm, normal) / extent])
    whole = np.zeros((len(basis) + 3, 6))
    whole[: len(basis), :3] = basis
    whole[len(basis) :, 3:] = np.eye(3)
    start = _supported(whole, rows, np.ones(len(rows), np.bool_))
    if len(start) <= len(basis):
        return None
    both, found, weight, spread2 = fit_agreeing(rows, residual, variance, EXPECTED_M**2, start)
    both, found, weight, spread2 = _kept(rows, residual, variance, both, found, weight, spread2)
    agreeing = weight > AGREES
    if len(both) <= len(basis) or len(np.unique(element[agreeing])) < LEAST_FOR_TURN or agreeing.mean() < LEAST_AGREEING:
        return None
    weighted = weight / (variance + spread2)
    a, alone = rows @ both.T, normal @ basis.T
    covariance = both.T @ np.linalg.inv(normal_matrix(a, weighted)) @ both
    without = np.linalg.solve(normal_matrix(alone, weighted), (alone * weighted[:, None]).T @ residual)
    gain = float(weighted @ ((residual - alone @ without) ** 2 - (residual - a @ found) ** 2))
    if gain <= chdtri(len(both) - len(basis), 0.01):
        return None
    twist = both.T @ found
    middle = np.average(arm, axis=0, weights=weight)
    there = np.hstack([np.eye(3), np.cross(np.eye(3), middle).T / extent])  # the shift of the middle of those that agree
    return there @ twist, twist[3:] / extent, there @ covariance @ there.T, weight
