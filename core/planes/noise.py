"""Error of one return: along its ray and across it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PointNoise:
    """Standard deviations of a scanner: range [m] at zero and per metre of range, and the direction [rad]."""

    sigma_range: float = 0.002
    per_metre: float = 0.0
    sigma_angle: float = 4e-5

    def along(self, distance: Array) -> Array:
        """(N,) metres along the rays."""
        return np.asarray(self.sigma_range + self.per_metre * distance)

    def across(self, distance: Array) -> Array:
        """(N,) metres across the rays, in any direction."""
        return np.asarray(self.sigma_angle * distance)

    def along_normal(self, distance: Array, cos_incidence: Array) -> Array:
        """(N,) metres along the surface's normal: the range's error falls with the incidence, the angle's grows."""
        cos2 = np.square(cos_incidence)
        return np.sqrt(np.square(self.along(distance)) * cos2 + np.square(self.across(distance)) * (1.0 - cos2))
