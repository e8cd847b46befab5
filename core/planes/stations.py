"""What the errors of the stations' poses do to a face: steps between stations are taken out of its returns, and what stays
unknown goes into its covariance.

On a face, an error of a station's pose is a shift along the normal and two turns about the station. Where stations saw the
same pieces of the face, the differences between them tell their errors but for what is common to them; elsewhere nothing is
known of an error but its usual size.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .fit import Plane

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

CELL_M = 0.25
"""Pieces of a face that stations are compared on."""
LEAST_SIGMA_M = 1e-6
LEAST_TURN_RAD = 1e-8


@dataclass(frozen=True)
class Poses:
    """Standard deviations of a station's pose: its position along any axis [m], and a turn about any axis [rad]."""

    sigma: float = 0.0
    turn: float = 0.0


EXACT = Poses()


@dataclass(frozen=True)
class FaceBlocks:
    """Means of the returns of one station in one piece of a face."""

    cell: Rows
    station: Rows
    count: Array
    residual: Array
    """(B,) from the plane [m]."""
    at: Array
    """(B, 2) place along the plane's axes, from its centroid [m]."""
    within: float
    """Variance of the residuals within the blocks [m2]."""


def face_blocks(plane: Plane, points: Array, station: Rows) -> FaceBlocks:
    """Of (N, 3) points that ``station`` (N,) saw."""
    q = points - plane.centroid
    at, off = q @ plane.axes.T, q @ plane.normal
    number = np.floor((at - at.min(axis=0)) / CELL_M).astype(np.int64)
    cell = number[:, 0] * (int(number[:, 1].max()) + 1) + number[:, 1]
    many = int(station.max()) + 1
    used, block = np.unique(cell * many + station, return_inverse=True)
    count = np.bincount(block).astype(np.float64)
    mean = np.bincount(block, off) / count
    places = np.column_stack([np.bincount(block, at[:, k]) / count for k in (0, 1)])
    within = float(((off - mean[block]) ** 2).sum() / max(len(off) - len(used), 1))
    return FaceBlocks(used // many, used % many, count, mean, places, max(within, 1e-14))


@dataclass(frozen=True)
class PoseErrors:
    """Of the stations that saw a face, after their steps were taken out."""

    places: Array
    """(S, 3) stations [m]."""
    axes: Array
    """(2, 3) of the face."""
    covariance: Array
    """(3 S, 3 S) of shift [m], turn, turn [rad], station by station."""

    def rows(self, points: Array, station: Rows) -> Array:
        """(N, 3 S) how far each point moves along the normal when the errors change by one."""
        lever = (points - self.places[station]) @ self.axes.T
        return spread(np.column_stack([np.ones(len(points)), lever]), station, len(self.places))

    def unit_errors(self, points: Array, station: Rows) -> Array:
        """(N, K) how far each point moves with each of K independent errors of size one."""
        return np.asarray(self.rows(points, station) @ np.linalg.cholesky(self.covariance))

    def of_plane(self, plane: Plane, points: Array, station: Rows) -> Array:
        """(3, 3) what the errors add to the covariance of a plane that was fitted to the points."""
        at = (points - plane.centroid) @ plane.axes.T
        gradient = np.column_stack([-at / (at**2).sum(axis=0), np.full(len(at), 1.0 / len(at))])
        change = gradient.T @ self.rows(points, station)
        return np.asarray(change @ self.covariance @ change.T)


def spread(values: Array, station: Rows, stations: int) -> Array:
    """(N, 3 S): (N, 3) in the columns of each row's station."""
    out = np.zeros((len(values), stations, 3))
    out[np.arange(len(values)), station] = values
    return out.reshape(len(values), -1)


def levelled(plane: Plane, points: Array, station: Rows, places: Array, poses: Poses) -> tuple[Array, PoseErrors]:
    """The points without the steps between stations, and what is left unknown of these.

    ``station`` (N,) are rows of ``places`` (S, 3), ``plane`` a fit to the points.
    """
    blocks = face_blocks(plane, points, station)
    around = plane.centroid + blocks.at @ plane.axes
    prior = np.tile([max(poses.sigma, LEAST_SIGMA_M), *(max(poses.turn, LEAST_TURN_RAD),) * 2], len(places)) ** 2.0
    errors = PoseErrors(places, plane.axes, np.diag(prior))
    weight = blocks.count / blocks.within
    cell = np.unique(blocks.cell, return_inverse=True)[1]
    total = np.bincount(cell, weight)

    def about_cell(values: Array) -> Array:
        """Minus the mean of the piece of surface: what that is like is not asked."""
        mean = np.column_stack([np.bincount(cell, weight * v) for v in values.T]) / total[:, None]
        return np.asarray(values - mean[cell])

    design = about_cell(errors.rows(around, blocks.station))
    value = about_cell(blocks.residual[:, None])[:, 0]
    matrix, right, factor = design.T @ (weight[:, None] * design), design.T @ (weight * value), 1.0
    freedom = len(value) - len(total)
    for _ in range(2):
        covariance = np.linalg.inv(matrix / factor + np.diag(1.0 / prior))
        found = covariance @ right / factor
        if freedom > 0:
            # where blocks differ by more than their noise, because a piece is not seen at the same places, they tell less
            factor = max(1.0, float(weight @ (value - design @ found) ** 2) / freedom)
    errors = PoseErrors(places, plane.axes, 0.5 * (covariance + covariance.T))
    return points - (errors.rows(points, station) @ found)[:, None] * plane.normal, errors
