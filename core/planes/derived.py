"""Vertices, edges, angles, slopes and distances of planes, each with its covariance (first order).

Jarzabek-Rychard and Maas 2023, equations 3.2.18-3.5.1. Planes are independent of each other unless said otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from ..errors import BimVerifyError
from ..sensing.loa import UPPER_BOUND_M
from .fit import Plane

Array = NDArray[np.float64]

Z95 = float(norm.ppf(0.975))
WEAKEST_ANGLE_RAD = 1e-3
"""Planes closer to parallel than this do not meet in an edge that anything could be said of."""


@dataclass(frozen=True)
class Estimate:
    """A number with its standard deviation, in SI units."""

    value: float
    sigma: float

    @property
    def interval(self) -> tuple[float, float]:
        """95 %."""
        return self.value - Z95 * self.sigma, self.value + Z95 * self.sigma

    def p_value(self, expected: float) -> float:
        """How likely so large a difference from ``expected`` is if there is none (two-sided)."""
        return float(2.0 * norm.sf(abs(self.value - expected) / max(self.sigma, 1e-300)))


@dataclass(frozen=True)
class Vertex:
    """Where three planes meet."""

    position: Array
    """(3,) metres."""
    covariance: Array
    """(3, 3)"""

    @property
    def sigma(self) -> float:
        """Root of the trace: the standard deviation of the position in space [m]."""
        return float(np.sqrt(np.trace(self.covariance)))


@dataclass(frozen=True)
class Edge:
    """Where two planes meet."""

    point: Array
    """(3,) metres: the place of the line nearest to the planes' centroids."""
    direction: Array
    """(3,) unit vector, up if it is not level."""
    covariance: Array
    """(3, 3) of the direction; of rank two."""

    @property
    def slope(self) -> Estimate:
        """Inclination to the level plane, rad."""
        return _slope(self.direction, self.covariance)

    @property
    def lean(self) -> tuple[Estimate, Estimate]:
        """Of an edge that goes up: how far it leans towards x and y over one metre of height [m]."""
        x, y, z = self.direction
        rows = np.array([[1.0 / z, 0.0, -x / z**2], [0.0, 1.0 / z, -y / z**2]])
        sigma = np.sqrt(np.maximum(np.diag(rows @ self.covariance @ rows.T), 0.0))
        return Estimate(float(x / z), float(sigma[0])), Estimate(float(y / z), float(sigma[1]))


def intersect_three(first: Plane, second: Plane, third: Plane) -> Vertex:
    """The vertex of three planes. Raises BimVerifyError when they do not meet in one place."""
    planes = (first, second, third)
    about = np.mean([p.centroid for p in planes], axis=0)
    normals = np.stack([p.normal for p in planes])
    if abs(np.linalg.det(normals)) < WEAKEST_ANGLE_RAD:
        raise BimVerifyError("Three planes do not meet in one place: two of them are parallel, or all share a line.")
    position = about + np.linalg.solve(normals, [-float(p.distance(about)[0]) for p in planes])
    # each plane moves along its normal by what its own covariance says at that place
    variance = np.diag([float(p.sigma_at(position)[0]) ** 2 for p in planes])
    inverse = np.linalg.inv(normals)
    return Vertex(position, inverse @ variance @ inverse.T)


def intersect_two(first: Plane, second: Plane) -> Edge:
    """The edge of two planes. Raises BimVerifyError when they are parallel."""
    cross = np.cross(first.normal, second.normal)
    length = float(np.linalg.norm(cross))
    if length < WEAKEST_ANGLE_RAD:
        raise BimVerifyError("Two planes are parallel and meet in no edge.")
    about = 0.5 * (first.centroid + second.centroid)
    direction = cross / length
    rows = np.stack([first.normal, second.normal, direction])
    point = about + np.linalg.solve(rows, [-float(first.distance(about)[0]), -float(second.distance(about)[0]), 0.0])
    sign = -1.0 if direction[2] < 0 else 1.0
    direction = sign * direction
    unit = sign * (np.eye(3) - np.outer(direction, direction)) / length
    jacobian = np.hstack([-unit @ _cross_matrix(second.normal), unit @ _cross_matrix(first.normal)])
    covariance = np.zeros((6, 6))
    covariance[:3, :3], covariance[3:, 3:] = _normal_covariance(first), _normal_covariance(second)
    return Edge(point, direction, jacobian @ covariance @ jacobian.T)


def plane_slope(plane: Plane) -> Estimate:
    """Angle between the plane and the level plane, rad: 0 for a floor, pi / 2 for a plumb wall."""
    normal, level = _slope(plane.normal, _normal_covariance(plane)), np.pi / 2
    return Estimate(level - abs(normal.value), normal.sigma)


def rise(plane: Plane) -> tuple[Estimate, Estimate]:
    """Of a plane that is not upright: how far it rises over one metre along x and along y [m]."""
    x, y, z = plane.normal
    rows = np.array([[-1.0 / z, 0.0, x / z**2], [0.0, -1.0 / z, y / z**2]])
    sigma = np.sqrt(np.maximum(np.diag(rows @ _normal_covariance(plane) @ rows.T), 0.0))
    return Estimate(float(-x / z), float(sigma[0])), Estimate(float(-y / z), float(sigma[1]))


def plumb_deviation(plane: Plane) -> Estimate:
    """How far a wall leans, rad: positive when its normal points up."""
    return _slope(plane.normal, _normal_covariance(plane), absolute=False)


def angle_between(first: Plane, second: Plane) -> Estimate:
    """Angle between the normals, rad. Near 0 and pi it is not normally distributed; use ``parallelism`` there."""
    cosine = float(np.clip(first.normal @ second.normal, -1.0, 1.0))
    sine = max(float(np.sqrt(1.0 - cosine**2)), 1e-12)
    variance = (
        second.normal @ _normal_covariance(first) @ second.normal + first.normal @ _normal_covariance(second) @ first.normal
    )
    return Estimate(float(np.arccos(cosine)), float(np.sqrt(max(float(variance), 0.0))) / sine)


def distance_between(first: Plane, second: Plane, place: Array | None = None) -> Estimate:
    """Distance [m] from the first plane to the second one along the mean of their normals, at ``place`` (3,).

    For faces of a wall or of a room. ``place`` is the middle of both centroids unless given.
    """
    about = 0.5 * (first.centroid + second.centroid) if place is None else place
    other = second.normal if first.normal @ second.normal > 0 else -second.normal
    mean = first.normal + other
    mean /= np.linalg.norm(mean)
    t1 = -float(first.distance(about)[0]) / float(first.normal @ mean)
    t2 = float((second.centroid - about) @ other) / float(other @ mean)
    s1 = float(first.sigma_at(about + t1 * mean)[0]) / float(first.normal @ mean)
    s2 = float(second.sigma_at(about + t2 * mean)[0]) / float(other @ mean)
    return Estimate(abs(t2 - t1), float(np.hypot(s1, s2)))


def edge_length(first: Plane, second: Plane, start: Plane, end: Plane) -> Estimate:
    """Length [m] of the edge of two planes between two others; that both its ends lie on the first two is counted.

    Raises BimVerifyError when it does not end on them.
    """
    here, there = (intersect_three(first, second, p).position for p in (start, end))
    length = float(np.linalg.norm(there - here))
    unit = (there - here) / max(length, 1e-12)
    at_start, at_end = (unit @ np.linalg.inv(np.stack([first.normal, second.normal, p.normal])) for p in (start, end))
    variance = (at_start[2] * float(start.sigma_at(here)[0])) ** 2 + (at_end[2] * float(end.sigma_at(there)[0])) ** 2
    for k, plane in enumerate((first, second)):
        change = at_end[k] * plane.shift_row(there)[0] - at_start[k] * plane.shift_row(here)[0]
        variance += float(change @ plane.covariance @ change)
    return Estimate(length, float(np.sqrt(variance)))


def level_of_accuracy(sigma: float) -> str:
    """The finest level of accuracy whose upper bound holds the 95 % interval of a position [m]; NONE beyond the last."""
    fitting = [level for level, bound in UPPER_BOUND_M.items() if Z95 * sigma <= bound]
    return f"LOA{max(fitting)}" if fitting else "NONE"


def _slope(direction: Array, covariance: Array, *, absolute: bool = True) -> Estimate:
    level = float(np.hypot(direction[0], direction[1]))
    value = float(np.arctan2(direction[2], level))
    if level < 1e-9:
        # straight up: any change of direction lowers it
        return Estimate(abs(value), float(np.sqrt(max(covariance[0, 0] + covariance[1, 1], 0.0))))
    gradient = np.array([-direction[2] * direction[0] / level, -direction[2] * direction[1] / level, level])
    sigma = float(np.sqrt(max(gradient @ covariance @ gradient, 0.0)))
    return Estimate(abs(value) if absolute else value, sigma)


def _normal_covariance(plane: Plane) -> Array:
    return np.asarray(plane.axes.T @ plane.covariance[:2, :2] @ plane.axes)


def _cross_matrix(v: Array) -> Array:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
