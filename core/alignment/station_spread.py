"""How well the stations of a campaign are registered to each other, from the faces that several of them saw."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .refine import Fit
from .robust_fit import MAD_TO_SIGMA, tukey

Array = NDArray[np.float64]

FEWEST_PER_STATION = 8
"""Matches of one station on one face below which their mean is not used."""
UNKNOWN_M = 0.002
"""Assumed where no face was seen by two stations, metres: a usual registration by targets or clouds."""
ROUNDS = 5
DETERMINED = 1e-3
"""Least eigenvalue, as a share of the largest, of a combination of shifts that the common faces fix."""


def station_spread(fit: Fit) -> float:
    """Standard deviation of a station's position along an axis, metres; 0 for a single station.

    Means of residuals of different stations on one face differ by the stations' shifts along its normal, whatever the
    face's own deviation. The shifts of all stations are adjusted to these differences by reweighted least squares, and
    their mean square, less what the scatter of the differences explains, is the variance sought.
    """
    stations, station = np.unique(fit.station, return_inverse=True)
    if len(stations) < 2:
        return 0.0
    rows, value, weight = _differences(fit, station, len(stations))
    if not len(value):
        return UNKNOWN_M
    shift, axes = np.zeros(rows.shape[1]), np.eye(rows.shape[1])
    robust, sigma = weight, 0.0
    for _ in range(ROUNDS):
        normal = rows.T @ (robust[:, None] * rows)
        scale, axes = np.linalg.eigh(normal)
        fixed = scale > DETERMINED * scale[-1]
        axes = axes[:, fixed] / np.sqrt(scale[fixed])
        shift = axes @ (axes.T @ (rows.T @ (robust * value)))
        left = value - rows @ shift
        sigma = MAD_TO_SIGMA * float(np.median(np.abs(left))) + 1e-9
        robust = weight * tukey(left / sigma)
    count = axes.shape[1]
    explained = sigma**2 * float(np.square(axes).sum()) * float(weight.mean())
    return float(np.sqrt(max(float(shift @ shift) - explained, 0.0) / count))


def _differences(fit: Fit, station: NDArray[np.int64], stations: int) -> tuple[Array, Array, Array]:
    """Rows (K, 3 S), values (K,) and weights (K,) of means per face and station, less the mean over the face's stations."""
    used = fit.weights.match > 0
    patch = fit.matches.patch[used].astype(np.int64)
    code, pair, count = np.unique(patch * stations + station[used], return_inverse=True, return_counts=True)
    mean = np.bincount(pair, weights=fit.matches.residual[used]) / count
    normal = np.stack([np.bincount(pair, weights=fit.matches.normal[used, k]) / count for k in range(3)], axis=1)
    keep = count >= FEWEST_PER_STATION
    code, mean, normal, count = code[keep], mean[keep], normal[keep], count[keep]
    face, own = np.unique(code // stations, return_inverse=True)
    weight = count / (count + 50.0)
    rows = np.zeros((len(code), stations, 3))
    rows[np.arange(len(code)), code % stations] = normal
    rows = rows.reshape(len(code), -1)
    total = np.bincount(own, weights=weight, minlength=len(face))
    center = np.zeros((len(face), rows.shape[1]))
    np.add.at(center, own, weight[:, None] * rows)
    rows = rows - (center / np.maximum(total, 1e-12)[:, None])[own]
    value = mean - (np.bincount(own, weights=weight * mean, minlength=len(face)) / np.maximum(total, 1e-12))[own]
    several = (np.bincount(own, minlength=len(face)) > 1)[own]
    return rows[several], value[several], weight[several]
