"""Plane by orthogonal least squares, with the covariance of its parameters (Jarzabek-Rychard and Maas 2023, 3.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..errors import BimVerifyError
from .noise import PointNoise

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Plane:
    """normal . x + offset = 0, with what is known of it. Metres, any one frame; keep coordinates below 10 km.

    The three free parameters are two small turns of the normal, towards ``axes[0]`` and ``axes[1]`` [rad], and a shift of
    the centroid along the normal [m].
    """

    normal: Array
    """(3,) unit vector."""
    centroid: Array
    """(3,) weighted middle of the points."""
    axes: Array
    """(2, 3) unit vectors in the plane: the points' longer and shorter direction."""
    covariance: Array
    """(3, 3) of turn, turn, shift."""
    count: int
    residual_mean: float
    """Mean absolute distance of the points [m]."""
    residual_sigma: float
    """Root mean square distance of the points, three parameters counted [m]."""
    variance_factor: float
    """Squared residuals against their predicted variance: 1 when the noise is what was assumed."""

    @property
    def offset(self) -> float:
        """Metres."""
        return -float(self.normal @ self.centroid)

    @property
    def parameters(self) -> Array:
        """(4,) a, b, c, d."""
        return np.append(self.normal, self.offset)

    @property
    def parameter_covariance(self) -> Array:
        """(4, 4) of a, b, c, d; of rank three, because the normal stays a unit vector."""
        jacobian = np.zeros((4, 3))
        jacobian[:3, :2] = self.axes.T
        jacobian[3, :2] = -self.axes @ self.centroid
        jacobian[3, 2] = -1.0
        return np.asarray(jacobian @ self.covariance @ jacobian.T)

    @property
    def position_sigma(self) -> float:
        """Of the plane along its normal, at the centroid [m]."""
        return float(np.sqrt(self.covariance[2, 2]))

    def sigma_at(self, points: Array) -> Array:
        """(N,) standard deviation [m] of the plane along its normal at (N, 3) places."""
        row = self.shift_row(points)
        return np.asarray(np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", row, self.covariance, row), 0.0)))

    def shift_row(self, points: Array) -> Array:
        """(N, 3) how far the plane moves along its normal at (N, 3) places when its turns and its shift change by one."""
        q = np.atleast_2d(points) - self.centroid
        # a turn towards e lowers the plane along -(e . q)
        return np.column_stack([-(q @ self.axes.T), np.ones(len(q))])

    def distance(self, points: Array) -> Array:
        """(N,) signed distance [m] of (N, 3) points."""
        return np.asarray((np.atleast_2d(points) - self.centroid) @ self.normal)

    def facing(self, place: Array) -> Plane:
        """The same plane with its normal turned to the side of ``place`` (3,)."""
        if float(self.normal @ (place - self.centroid)) >= 0:
            return self
        flip = np.diag([-1.0, -1.0, -1.0])
        return self.replaced(normal=-self.normal, covariance=flip @ self.covariance @ flip)

    def replaced(self, *, normal: Array | None = None, covariance: Array | None = None) -> Plane:
        """The same plane with another sign of its normal, or another covariance."""
        return Plane(
            self.normal if normal is None else normal, self.centroid, self.axes,
            self.covariance if covariance is None else covariance, self.count, self.residual_mean,
            self.residual_sigma, self.variance_factor,
        )


def fit_plane(points: Array, stations: Array, noise: PointNoise, *, weighted: bool = False) -> Plane:
    """The plane through (N, 3) points measured from (N, 3) or (3,) stations, and its covariance by error propagation.

    The covariance is that of independent errors of the returns alone; ``unevenness.with_unevenness`` adds what
    neighbouring returns share. ``weighted`` weighs each point by its variance along the normal. Raises BimVerifyError
    when the points do not fix a plane.
    """
    points = np.ascontiguousarray(points, dtype=np.float64)
    if len(points) < 4:
        raise BimVerifyError(f"{len(points)} points do not fix a plane and its uncertainty; give at least four.")
    ray = points - np.asarray(stations, dtype=np.float64)
    distance = np.maximum(np.linalg.norm(ray, axis=1), 1e-9)
    ray = np.ascontiguousarray(ray / distance[:, None])
    along, across = noise.along(distance), noise.across(distance)
    weight = np.ones(len(points))
    centroid, values, axes = _axes(points, weight)
    if weighted:
        for _ in range(2):
            weight = 1.0 / np.maximum(noise.along_normal(distance, np.abs(ray @ axes[:, 0])), 1e-9) ** 2
            weight /= weight.mean()
            centroid, values, axes = _axes(points, weight)
    if values[1] <= 1e-12 * max(values[2], 1e-30) or values[1] <= values[0] * (1 + 1e-9):
        raise BimVerifyError("The points lie on a line or form no plane; nothing fixes how it is turned about them.")
    normal, axis = axes[:, 0], np.ascontiguousarray(axes[:, [2, 1]].T)
    covariance, predicted = _propagate(
        points - centroid, weight, ray, along, across, normal, axis, values[0] - values[[2, 1]], weight.sum()
    )
    residual = (points - centroid) @ normal
    return Plane(
        normal, centroid, axis, covariance, len(points), float(np.abs(residual).mean()),
        float(np.sqrt((residual**2).sum() / (len(points) - 3))),
        float((residual**2 / np.maximum(predicted, 1e-18)).sum() / (len(points) - 3)),
    )


def _axes(points: Array, weight: Array) -> tuple[Array, Array, Array]:
    centroid = weight @ points / weight.sum()
    q = points - centroid
    values, vectors = np.linalg.eigh((q * weight[:, None]).T @ q)
    return centroid, values, vectors


@njit(cache=True, nogil=True)
def _propagate(q, weight, ray, along, across, normal, axis, gap, total):  # type: ignore[no-untyped-def]
    """Sum over the points of J C J^T, J the Jacobian of the eigenvector and of the centroid (implicit functions)."""
    out = np.zeros((3, 3))
    predicted = np.empty(len(q))
    j = np.empty((3, 3))
    for i in range(len(q)):
        off = q[i, 0] * normal[0] + q[i, 1] * normal[1] + q[i, 2] * normal[2]
        for k in range(2):
            at = q[i, 0] * axis[k, 0] + q[i, 1] * axis[k, 1] + q[i, 2] * axis[k, 2]
            for m in range(3):
                j[k, m] = weight[i] * (at * normal[m] + off * axis[k, m]) / gap[k]
        for m in range(3):
            j[2, m] = weight[i] * normal[m] / total
        s2 = across[i] * across[i]
        extra = along[i] * along[i] - s2
        cosine = ray[i, 0] * normal[0] + ray[i, 1] * normal[1] + ray[i, 2] * normal[2]
        predicted[i] = s2 + extra * cosine * cosine
        for a in range(3):
            ja = j[a, 0] * ray[i, 0] + j[a, 1] * ray[i, 1] + j[a, 2] * ray[i, 2]
            for b in range(a, 3):
                jb = j[b, 0] * ray[i, 0] + j[b, 1] * ray[i, 1] + j[b, 2] * ray[i, 2]
                dot = j[a, 0] * j[b, 0] + j[a, 1] * j[b, 1] + j[a, 2] * j[b, 2]
                out[a, b] += s2 * dot + extra * ja * jb
    for a in range(3):
        for b in range(a):
            out[a, b] = out[b, a]
    return out, predicted
