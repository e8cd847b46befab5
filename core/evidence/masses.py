"""Belief masses of one return on one query position, and their limits.

With S the station, P the return, r0 the unit ray from S to P and Q the query position: dx = (Q - P).r0 (negative in
front of the return) and dy = |(Q - P) x r0|. The masses are those of Hebel et al. (2013) in the corrected form

    m_emp = (1 - s(lambda dx + c)) g,   m_occ = (s(lambda dx + c) - s(lambda dx - c)) g,   m_unk = 1 - m_emp - m_occ

with s(x) = 1 / (1 + exp(-x)) and g = exp(-kappa dy^2).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.special import erf


@njit(cache=True, nogil=True, inline="always")
def logistic(x: float) -> float:
    """1 / (1 + exp(-x)) without overflow."""
    if x >= 0.0:
        return 1.0 / (1.0 + math.exp(-x))
    e = math.exp(x)
    return e / (1.0 + e)


FAR_FROM_STEP = 40.0
"""s(-40) is 4e-18: beside 1 it is nothing in double precision."""


@njit(cache=True, nogil=True, inline="always")
def ray_masses(dx: float, dy2: float, c: float, lam: float, kappa: float) -> tuple[float, float]:
    """(m_occ, m_emp) of one return; dx [m], dy2 [m2], lam [1/m], kappa [1/m2]."""
    step = lam * dx
    if step - c > FAR_FROM_STEP:
        return 0.0, 0.0
    g = math.exp(-kappa * dy2)
    if step + c < -FAR_FROM_STEP:
        return 0.0, g
    upper = logistic(step + c)
    lower = logistic(step - c)
    return (upper - lower) * g, (1.0 - upper) * g


@njit(cache=True, nogil=True, inline="always")
def log_one_minus(x: float) -> float:
    """log(1 - x) for 0 <= x < 1 to double precision; most masses are small, and need no logarithm."""
    if x < 1e-3:
        return -x * (1.0 + x * (0.5 + x * (1.0 / 3.0 + x * (0.25 + x * (0.2 + x / 6.0)))))
    return math.log1p(-x)


@njit(cache=True, nogil=True)
def ray_masses_array(
    dx: NDArray[np.float64], dy: NDArray[np.float64], c: float, lam: float, kappa: float
) -> NDArray[np.float64]:
    """(N, 3) masses m_occ, m_emp, m_unk for distances dx, dy (N,) [m]."""
    out = np.empty((len(dx), 3))
    for i in range(len(dx)):
        occ, emp = ray_masses(dx[i], dy[i] * dy[i], c, lam, kappa)
        out[i, 0] = occ
        out[i, 1] = emp
        out[i, 2] = 1.0 - occ - emp
    return out


def level_conversion(sigma: NDArray[np.float64], level_sigma: float) -> NDArray[np.float64]:
    """(N,) factor on the beliefs of points of standard deviation ``sigma`` (N,) at a level: P(|x| <= level sigma) / 0.95.

    Eq. 5.24 of Meyer (2023) with the divisor of its table 5.4; no more than 1, so that masses stay masses. Metres.
    """
    return np.asarray(np.minimum(erf(level_sigma / (math.sqrt(2.0) * sigma)) / 0.95, 1.0))


def surface_masses(
    offset: NDArray[np.float64], normal: NDArray[np.float64], c: float, lam: float, kappa: float
) -> NDArray[np.float64]:
    """(N, 3) masses m_occ, m_emp (zero), m_unk of dense points without a known ray.

    ``offset`` (N, 3) is X - Q [m], ``normal`` (3,) the unit normal of the surface at Q: dx = (X - Q).n and
    dy = |(X - Q) x n|.
    """
    dx = offset @ normal
    dy = np.linalg.norm(np.cross(offset, normal), axis=1)
    masses = ray_masses_array(dx, dy, c, lam, kappa)
    masses[:, 1] = 0.0
    masses[:, 2] = 1.0 - masses[:, 0]
    return masses
