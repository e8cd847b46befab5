"""Does a pose make sense at all: do returns lie on the planned surface, and do rays stay out of its solids?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.elements import BuildingModel
from ..model.raycast import RayScene
from . import transform as se3
from .subset import ReturnSubset

GRAZING_COS = 0.17
"""Least cosine of incidence on the planned face (80 degrees): a flatter ray passes or hits by a millimetre's chance."""


@dataclass(frozen=True)
class RayAgreement:
    """Shares of the rays asked, for each pose."""

    agree: NDArray[np.float64]
    """(K,) the ray ends where it first meets the outer side of the planned surface."""
    through: NDArray[np.float64]
    """(K,) the ray passes through the planned surface, or starts inside a solid."""
    near: NDArray[np.float64]
    """(K,) the ray meets the planned surface at all."""

    @property
    def score(self) -> NDArray[np.float64]:
        """(K,) agreement less contradiction: a return that is in front of a planned face counts for nothing."""
        return self.agree - self.through


def ray_agreement(
    scene: RayScene,
    model: BuildingModel,
    returns: ReturnSubset,
    chosen: NDArray[np.int64],
    poses: NDArray[np.float64],
    tolerance: float,
) -> RayAgreement:
    """Cast the chosen returns' rays against the plan for each of ``poses`` (K, 4, 4), scan frame to local frame.

    ``tolerance`` [m] along the ray. A ray that
    passes through glass contradicts nothing. Only returns of stations with a known position should be chosen.
    """
    count = len(poses)
    agree, through, near = np.zeros(count), np.zeros(count), np.zeros(count)
    start = returns.station_position[returns.station[chosen]]
    ray = returns.position[chosen] - start
    length = np.linalg.norm(ray, axis=1)
    ray = ray / length[:, None]
    for k, pose in enumerate(poses):
        direction = se3.rotate(pose, ray)
        distance, triangle = scene.first_hit(se3.apply(pose, start), direction, length + 50.0)
        hit = triangle >= 0
        cosine = np.where(hit, np.einsum("ij,ij->i", direction, scene.normal[triangle]), 0.0)
        closed = model.closed[scene.element[triangle]]
        steep = np.abs(cosine) > GRAZING_COS
        front = cosine < 0
        gap = np.where(hit, distance, np.inf) - length
        near[k] = hit.mean()
        agree[k] = (hit & front & steep & (np.abs(gap) < tolerance)).mean()
        steep &= ~model.transparent[triangle] | (np.abs(gap) < tolerance)
        through[k] = (hit & steep & np.where(front, gap < -tolerance, closed & (gap < tolerance))).mean()
    return RayAgreement(agree, through, near)
