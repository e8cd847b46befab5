"""Elements so slender that they may stand beside their own outline, and still within the tolerance of their place.

Rays through the planned place of a bar of 12 mm that stands 15 mm off pass it: it must be looked for step by step, and what
returns from close beside it may be the bar.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .hypotheses import face_groups
from .scenery import Scenery

Array = NDArray[np.float64]

MOST_AXES = 3
SAME_AXIS = 0.97
LEAST_STEP_M = 0.005
ALONG_COS = float(np.sqrt(0.5))
SLENDER_SHARE = 0.25
"""Where more than this of an element's surface lies along an axis, a place must be over its outline to fit."""


@dataclass(frozen=True)
class Axes:
    """The main axes of an element's faces."""

    directions: Array
    """(K, 3)"""
    extent: Array
    """(K,) of the element along each [m]."""
    outlined: NDArray[np.bool_]
    """(K,) so much of the surface lies along the axis that half of it must overlap for a place to fit."""

    @classmethod
    def of(cls, scenery: Scenery, e: int) -> Axes:
        """Of element ``e``; no more than three."""
        triangle = slice(*scenery.model.triangle_start[[e, e + 1]])
        corner, normal = scenery.surfaces.corner[triangle], scenery.surfaces.normal[triangle]
        area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
        axes: list[Array] = []
        for direction in face_groups(normal, area)[1]:
            if all(abs(float(direction @ axis)) < SAME_AXIS for axis in axes):
                axes.append(direction)
        if len(axes) > MOST_AXES:
            axes = _round_axes(axes[0], normal, area)
        directions = np.array(axes).reshape(-1, 3)
        along = area @ (np.abs(normal @ directions.T) < ALONG_COS) / max(area.sum(), 1e-12)
        return cls(directions, np.ptp(corner.reshape(-1, 3) @ directions.T, axis=0), along > SLENDER_SHARE)

    def steps(self, window: float) -> Array:
        """(K,) metres: one of the places so far apart puts any face within the ``window``, and half of the element over its own
        outline."""
        fine = np.maximum(0.5 * self.extent, LEAST_STEP_M)
        return np.minimum(np.where(self.outlined, fine, np.inf), 1.5 * window)

    def slender(self, window: float) -> bool:
        """Whether the element may stand beside its own outline, and within the ``window`` of its place."""
        return bool((self.outlined & (self.extent < window)).any())


def _round_axes(first: Array, normal: Array, area: Array) -> list[Array]:
    """Of an element whose faces look everywhere around: ``first``, the axis that they lie along most, and across both."""
    along = np.linalg.eigh(np.einsum("k,ki,kj->ij", area, normal, normal))[1][:, 0]
    across = np.cross(along, first)
    if np.linalg.norm(across) < 1.0 - SAME_AXIS:
        return [first]
    across /= np.linalg.norm(across)
    return [np.cross(across, along), across, along]
