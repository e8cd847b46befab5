"""A flat component modelled again from its returns: plane by least squares, outline from the outermost returns.

This is the smallest modelling that has the errors of all modelling: noise tilts and shifts the plane, and an outline is
known no better than the returns next to it. Tables of expected error and the check against simulated scans both use it.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .face_returns import FaceReturns
from .faces import Face

Array = NDArray[np.float64]
TRIM_SIGMAS = 3.0
LEAST_GATE_M = 0.001
BAND_SPACINGS = 2.5
"""Width of the bands in which the outermost return is looked for."""
OUTSIDE_SPACINGS = 0.4
"""The edge lies so many spacings (across it) beyond the outermost return of a band: half a spacing where rows run along
the edge, 0.29 where they cross it."""
FEWEST = 12
GATE_NOISES = 6.0
"""Returns this many times the noise around the median may lie on the surface."""
MARGIN_M = 0.06
"""Returns this far outside the planned outline still take part: the built outline may lie there."""


@njit(cache=True, nogil=True)
def fit_plane(u, v, w, gate):  # type: ignore[no-untyped-def]
    """(a0, a1, a2, sigma, count) of w = a0 + a1 u + a2 v by least squares, from ``gate`` around the median on, then without
    outliers."""
    if len(w) < FEWEST:
        return 0.0, 0.0, 0.0, 0.0, len(w)
    a0, a1, a2, sigma, used = np.median(w), 0.0, 0.0, 0.0, 0
    for _ in range(3):
        s = su = sv = suu = suv = svv = sw = swu = swv = sww = 0.0
        for i in range(len(u)):
            if abs(w[i] - a0 - a1 * u[i] - a2 * v[i]) <= gate:
                s += 1.0
                su += u[i]
                sv += v[i]
                suu += u[i] * u[i]
                suv += u[i] * v[i]
                svv += v[i] * v[i]
                sw += w[i]
                swu += w[i] * u[i]
                swv += w[i] * v[i]
                sww += w[i] * w[i]
        used = int(s)
        if used < FEWEST:
            return a0, a1, a2, sigma, used
        mu, mv, mw = su / s, sv / s, sw / s
        cuu, cuv, cvv = suu - s * mu * mu, suv - s * mu * mv, svv - s * mv * mv
        cwu, cwv, cww = swu - s * mw * mu, swv - s * mw * mv, sww - s * mw * mw
        determinant = cuu * cvv - cuv * cuv
        if determinant <= 1e-9 * cuu * cvv:
            return a0, a1, a2, sigma, 0
        a1 = (cwu * cvv - cwv * cuv) / determinant
        a2 = (cwv * cuu - cwu * cuv) / determinant
        a0 = mw - a1 * mu - a2 * mv
        sigma = np.sqrt(max(cww - a1 * cwu - a2 * cwv, 0.0) / max(s - 3.0, 1.0))
        gate = max(TRIM_SIGMAS * sigma, LEAST_GATE_M)
    return a0, a1, a2, sigma, used


@njit(cache=True, nogil=True)
def side_position(along, across, inlier, low, high, spacing_along, spacing_across):  # type: ignore[no-untyped-def]
    """Where the points end towards larger ``across``: median over bands of ``along`` (low to high) of their outermost.

    NaN with fewer than one band that holds a point.
    """
    width = max(BAND_SPACINGS * spacing_along, 0.01)
    bands = max(int((high - low) / width), 1)
    outermost = np.full(bands, -1e30)
    for i in range(len(along)):
        if not inlier[i]:
            continue
        k = int((along[i] - low) / (high - low) * bands)
        if 0 <= k < bands and across[i] > outermost[k]:
            outermost[k] = across[i]
    known = np.sort(outermost[outermost > -1e29])
    if len(known) == 0:
        return np.nan
    return 0.5 * (known[(len(known) - 1) // 2] + known[len(known) // 2]) + OUTSIDE_SPACINGS * spacing_across


@njit(cache=True, nogil=True)
def remodel(u, v, w, width, height, along, across, gate):  # type: ignore[no-untyped-def]
    """(surface error, errors of the right, left, top and bottom side) [m] of a rectangle modelled from points.

    The rectangle is 0..width x 0..height in the plane w = 0. The first number is the mean distance of the modelled plane
    from the true one at the corners. NaN where the points do not carry a model. ``along`` and ``across`` (4,) are the
    distances between the points near each side.
    """
    sides = np.full(4, np.nan)
    a0, a1, a2, sigma, used = fit_plane(u, v, w, gate)
    if used < FEWEST:
        return np.nan, sides
    surface = 0.25 * (
        abs(a0) + abs(a0 + a1 * width) + abs(a0 + a2 * height) + abs(a0 + a1 * width + a2 * height)
    )
    limit = max(TRIM_SIGMAS * sigma, LEAST_GATE_M)
    inlier = np.abs(w - a0 - a1 * u - a2 * v) <= limit
    inset_u, inset_v = 0.05 * width, 0.05 * height
    sides[0] = abs(side_position(v, u, inlier, inset_v, height - inset_v, along[0], across[0]) - width)
    sides[1] = abs(side_position(v, -u, inlier, inset_v, height - inset_v, along[1], across[1]))
    sides[2] = abs(side_position(u, v, inlier, inset_u, width - inset_u, along[2], across[2]) - height)
    sides[3] = abs(side_position(u, -v, inlier, inset_u, width - inset_u, along[3], across[3]))
    return surface, sides


def remodel_face(face: Face, points: Array, returns: FaceReturns, window: float) -> tuple[float, Array]:
    """``remodel`` of a planned face from returns (N, 3) [m, local frame] within ``window`` of its plane."""
    place = (points - face.corner) @ face.axes.T
    u, v, w = (np.ascontiguousarray(place[:, k]) for k in range(3))
    near = (np.abs(w) <= window) & (u >= -MARGIN_M) & (u <= face.width + MARGIN_M)
    near &= (v >= -MARGIN_M) & (v <= face.height + MARGIN_M)
    surface, sides = remodel(
        u[near], v[near], w[near], face.width, face.height, returns.along, returns.across, GATE_NOISES * returns.noise
    )
    return float(surface), sides
