"""How well a fit fixes each of the six degrees of freedom, counted in elements and not in returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from .refine import Fit
from .robust_fit import jacobian
from .station_spread import station_spread

Array = NDArray[np.float64]

UNFIXED = 1e-3
"""Least share of an average direction's information. Faces within 2 degrees of parallel to a direction, about what
a wavy floor or a badly modelled wall offers by accident, give 1e-3."""
FEWEST_RETURNS = 25.0
"""Least information along a direction, in returns that face it squarely: fewer may agree by accident in a 10 cm
gate."""
LARGEST_LEVERAGE = 0.9
"""Share of a direction's information beyond which an element is not left out of it: nothing would be left to check
it by."""
TUKEY_EFFICIENCY = 0.95
FEWEST_FREE = 2.0
"""Least number of elements counted as left over; fewer make the factor meaningless, and the jackknife speaks then."""
ALONE = 1.5
"""Effective number of elements below which a direction is said to hang on one of them."""
WORST_SIGMA_M = 0.05
"""Standard deviation of the weakest direction beyond which a pose is refused, metres: the gate of the fine stage."""


@dataclass(frozen=True)
class Uncertainty:
    """Covariance of a pose and the direction it is weakest in."""

    covariance: Array
    """(6, 6) of (rx, ry, rz [rad], tx, ty, tz [m]) about the fit's centre."""
    weakest: str
    """One sentence."""
    weakest_sigma: float
    """Metres, rotations times the extent."""


def assess(fit: Fit, patch_element: NDArray[np.int32], elements: int) -> Uncertainty:
    """Covariance and weakest direction of a fit. Raises BimVerifyError naming the directions that nothing fixes.

    The covariance is the larger, in every direction, of two estimates: the jackknife over elements (cluster-robust
    sandwich CR3 of Bell and McCaffrey 2002), which holds whatever the residuals inside an element do, and a model in
    which each element is off as a whole by the spread seen between all faces, which holds when few elements carry a
    direction. The first is raised by (sum w / sum psi')^2, because its slopes come from weights (Huber 1981, ch. 6),
    the second by the efficiency of the weights and by G / (G - 6) for the six unknowns that G elements gave. To that
    comes what the stations' registration to each other, as seen on common faces, does to a pose that moves all as one.
    """
    scale = np.array([fit.extent] * 3 + [1.0] * 3)
    rows = jacobian(fit.position - fit.center, fit.matches.normal) / scale
    element = patch_element[fit.matches.patch]
    weight = fit.weights.match
    weighted = weight[:, None] * rows
    own = _sum_by(element, weighted[:, :, None] * rows[:, None, :], elements)
    gradient = _sum_by(element, weighted * fit.matches.residual[:, None], elements)
    shift = _sum_by(element, weighted[:, :, None] * fit.matches.normal[:, None, :], elements)
    information = own.sum(axis=0)
    _check_fixed(information, rows[weight > 0])
    inverse = np.linalg.inv(information)
    jackknife = _jackknife(information, own, gradient)
    noise = fit.weights.within**2 * np.einsum("i,ij,ik->jk", weight**2, rows, rows)
    between = fit.weights.between**2 * np.einsum("eij,ekj->ik", shift, shift)
    lean = _sum_by(fit.station, weighted[:, :, None] * fit.matches.normal[:, None, :], int(fit.station.max()) + 1)
    stations = station_spread(fit) ** 2 * np.einsum("sij,skj->ik", lean, lean)
    model = inverse @ (noise + between) @ inverse / TUKEY_EFFICIENCY * _freedom_factor(information, own)
    scaled = _larger(model, _slope_factor(fit.weights.face) * jackknife) + inverse @ stations @ inverse
    sigma, direction = _largest(scaled)
    share = np.einsum("i,eij,j->e", direction, own, direction)
    carriers = float(share.sum() ** 2 / np.square(share).sum())
    sentence = f"{_describe(direction)} is fixed to {_amount(direction, sigma, fit.extent)} only"
    sentence += (
        ", and hangs on one element alone." if carriers < ALONE else f", by {carriers:.0f} elements."
    )
    if sigma > WORST_SIGMA_M:
        raise BimVerifyError(f"The alignment is too uncertain: {sentence} Scan more faces that are square to it.")
    return Uncertainty(scaled / np.outer(scale, scale), sentence[0].upper() + sentence[1:], sigma)


def _sum_by(group: NDArray[np.int32], values: Array, groups: int) -> Array:
    """(G, ...) sums of the values (M, ...) of each group."""
    flat = values.reshape(len(values), -1)
    sums = np.empty((groups, flat.shape[1]))
    for k, column in enumerate(flat.T):
        sums[:, k] = np.bincount(group, weights=column, minlength=groups)
    return sums.reshape(groups, *values.shape[1:])


def _check_fixed(information: Array, rows: Array) -> None:
    value, vector = np.linalg.eigh(information)
    count = np.square(rows @ vector).sum(axis=0)
    loose = (value < UNFIXED * information.trace() / 6.0) | (count < FEWEST_RETURNS)
    if loose.any():
        names = " and ".join(_describe(d) for d in _plain_directions(vector[:, loose]))
        raise BimVerifyError(
            f"The surfaces seen do not fix the alignment: nothing holds the {names}. "
            "Scan faces that are square to it, or verify without alignment."
        )


def _plain_directions(space: Array) -> list[Array]:
    """Pure shifts and pure rotations that span (6, K) orthonormal ``space`` where there are such; else its own
    columns."""
    out: list[Array] = []
    projector = space @ space.T
    for part in (slice(3, 6), slice(0, 3)):
        value, vector = np.linalg.eigh(projector[part, part])
        for k in np.flatnonzero(value > 0.9):
            direction = np.zeros(6)
            direction[part] = vector[:, k]
            out.append(direction)
    return out if len(out) == space.shape[1] else list(space.T)


def _jackknife(information: Array, own: Array, gradient: Array) -> Array:
    """Sum over elements of the squared change of the motion when the element is left out."""
    value, vector = np.linalg.eigh(information)
    root = vector / np.sqrt(value)
    out = np.zeros((6, 6))
    for matrix, slope in zip(own, gradient, strict=True):
        if not slope.any():
            continue
        leverage, axes = np.linalg.eigh(root.T @ matrix @ root)
        change = root @ (axes @ ((axes.T @ (root.T @ slope)) / (1.0 - np.clip(leverage, 0.0, LARGEST_LEVERAGE))))
        out += np.outer(change, change)
    return out


def _freedom_factor(information: Array, own: Array) -> float:
    """G / (G - 6), G the number of elements that would carry the motion as evenly as these do."""
    leverage = np.einsum("eij,ji->e", own, np.linalg.inv(information))
    elements = leverage.sum() ** 2 / np.square(leverage).sum()
    return float(elements / max(elements - 6.0, FEWEST_FREE))


def _larger(first: Array, second: Array) -> Array:
    """The smallest covariance that is at least ``second``, and ``first``, along the principal directions of their
    ratio."""
    root = np.linalg.cholesky(first)
    ratio = np.linalg.solve(root, np.linalg.solve(root, second).T)
    value, vector = np.linalg.eigh(0.5 * (ratio + ratio.T))
    axes = root @ vector
    larger: Array = (axes * np.maximum(value, 1.0)) @ axes.T
    return larger


def _slope_factor(face: Array) -> float:
    """(sum w / sum psi')^2 of the biweight: with u the standardised median, w = (1-u2)^2 and psi' = (1-u2)(1-5u2)."""
    inside = np.sqrt(face[face > 0])
    slope = float(np.sum(inside * (5.0 * inside - 4.0)))
    total = float(np.sum(np.square(inside)))
    return (total / max(slope, 0.3 * total)) ** 2


def _largest(scaled: Array) -> tuple[float, Array]:
    value, vector = np.linalg.eigh(scaled)
    return float(np.sqrt(value[-1])), vector[:, -1]


def _describe(direction: Array) -> str:
    turn, shift = direction[:3], direction[3:]
    if shift @ shift >= turn @ turn:
        return f"translation along {_axis(shift)}"
    return f"rotation about {_axis(turn)}"


def _amount(direction: Array, sigma: float, extent: float) -> str:
    turn, shift = direction[:3], direction[3:]
    if shift @ shift >= turn @ turn:
        return f"{sigma * 1e3:.2g} mm"
    return f"{sigma / extent * 1e3:.2g} mrad"


def _axis(vector: Array) -> str:
    unit = vector / np.linalg.norm(vector)
    unit = unit * np.sign(unit[np.argmax(np.abs(unit))])
    return "(" + ", ".join(f"{value + 0.0:.2f}" for value in np.round(unit, 2) + 0.0) + ")"
