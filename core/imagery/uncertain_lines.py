"""Straight lines in images and edges of models as uncertain homogeneous entities.

After Förstner and Wrobel (2016). Entities are conditioned (shifted to their centroid, scaled to size one) and spherically
normalised before an adjustment; covariances of normalised entities are singular along the entity itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class LineMatches:
    """Image lines and the model edges they are taken for.

    ``line`` (N, 3) homogeneous image lines with ``line_cov`` (N, 3, 3), pixels; ``start`` and ``end`` (N, 3) two points on
    each model edge with covariances (N, 3, 3), metres.
    """

    line: Vector
    line_cov: Vector
    start: Vector
    end: Vector
    start_cov: Vector
    end_cov: Vector

    def __len__(self) -> int:
        return len(self.line)

    def rows(self, chosen: NDArray[np.bool_] | NDArray[np.int64]) -> LineMatches:
        """Only the chosen matches."""
        return LineMatches(*(getattr(self, name)[chosen] for name in self.__dataclass_fields__))


def join(first: Vector, second: Vector, first_cov: Vector, second_cov: Vector) -> tuple[Vector, Vector]:
    """Lines (N, 3) through pairs of image points (N, 2) with covariances (N, 2, 2), and their covariances (N, 3, 3).

    l = x cross y, and by propagation S_ll = S(y) S_xx S(y)^T + S(x) S_yy S(x)^T.
    """
    x, y = homogeneous(first), homogeneous(second)
    line = np.cross(x, y)
    sx, sy = skew(x), skew(y)
    cov = sy @ pad(first_cov) @ sy.transpose(0, 2, 1) + sx @ pad(second_cov) @ sx.transpose(0, 2, 1)
    return line, cov


def hessian(line: Vector, cov: Vector) -> tuple[Vector, Vector]:
    """Direction of the normal [rad] and distance from the origin [px], (N, 2), with covariances (N, 2, 2)."""
    a, b, c = line.T
    s = np.hypot(a, b)
    value = np.column_stack([np.arctan2(b, a), -c / s])
    jacobian = np.zeros((len(line), 2, 3))
    jacobian[:, 0, 0], jacobian[:, 0, 1] = -b / s**2, a / s**2
    jacobian[:, 1, 0], jacobian[:, 1, 1], jacobian[:, 1, 2] = a * c / s**3, b * c / s**3, -1.0 / s
    return value, jacobian @ cov @ jacobian.transpose(0, 2, 1)


def homogeneous(points: Vector) -> Vector:
    """(N, d) to (N, d + 1) with a last coordinate of one."""
    return np.column_stack([points, np.ones(len(points))])


def pad(cov: Vector) -> Vector:
    """Covariances (N, d, d) of Euclidean points as those of homogeneous ones (N, d + 1, d + 1)."""
    size = cov.shape[-1]
    out = np.zeros((len(cov), size + 1, size + 1))
    out[:, :size, :size] = cov
    return out


def skew(vectors: Vector) -> Vector:
    """(N, 3) to the matrices (N, 3, 3) of the cross product."""
    out = np.zeros((len(vectors), 3, 3))
    out[:, 0, 1], out[:, 0, 2], out[:, 1, 2] = -vectors[:, 2], vectors[:, 1], -vectors[:, 0]
    return out - out.transpose(0, 2, 1)


def normalise(entity: Vector, cov: Vector) -> tuple[Vector, Vector]:
    """Spherically normalised entities (N, d) and their covariances (N, d, d)."""
    norm = np.linalg.norm(entity, axis=1)
    unit = entity / norm[:, None]
    jacobian = tangent(unit) / norm[:, None, None]
    return unit, jacobian @ cov @ jacobian.transpose(0, 2, 1)


def tangent(unit: Vector) -> Vector:
    """Projectors (N, d, d) onto the tangent space of the sphere at unit vectors (N, d)."""
    return np.asarray(np.eye(unit.shape[1]) - unit[:, :, None] * unit[:, None, :])


def conditioning(points: Vector) -> Vector:
    """Matrix (d + 1, d + 1) that shifts points (N, d) to their centroid and scales the farthest to one."""
    centre = points.mean(axis=0)
    size = float(np.linalg.norm(points - centre, axis=1).max()) or 1.0
    out = np.eye(points.shape[1] + 1)
    out[:-1, -1] = -centre
    out[-1, -1] = size
    return out
