"""The planned surface, ready to be asked for the nearest place of a given orientation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..errors import BimVerifyError
from ..model.elements import BuildingModel
from ..model.samples import SurfaceSamples

MOST_SAMPLES = 300_000
"""Query positions kept for the search; the plane through each is exact, so their spacing does not limit the
accuracy."""
NORMAL_SCALE_M = 0.3
"""Metres that a unit difference of normals counts in the search: a face 10 cm further away but of the same orientation
wins over one at right angles, and the back of a wall never wins over its front."""
COMPATIBLE_COS = 0.82
"""Least cosine (35 degrees) between a return's normal and the planned one: holds 3 degrees of a coarse pose and the
error of a normal from a dozen returns, and tells faces at 45 degrees apart."""


@dataclass(frozen=True)
class Matches:
    """Pairs of a return and a place on the planned surface."""

    row: NDArray[np.int64]
    """(M,) rows of the returns that were asked for."""
    residual: NDArray[np.float64]
    """(M,) metres, of the return from the planned plane along its outward normal."""
    normal: NDArray[np.float64]
    """(M, 3) outward normals of the planned surface."""
    patch: NDArray[np.int32]
    """(M,) rows of ``PlannedSurface.patch_element``."""


class PlannedSurface:
    """Exposed query positions of a model with a search tree over position and normal."""

    def __init__(self, model: BuildingModel, samples: SurfaceSamples) -> None:
        chosen = np.flatnonzero(samples.exposed)
        if not len(chosen):
            raise BimVerifyError(f"{model.path or 'The model'} has no surface that a scanner could see to align to.")
        stride = -(-len(chosen) // MOST_SAMPLES)
        chosen = chosen[::stride]
        self.position = samples.position[chosen]
        self.normal = samples.normal[chosen]
        self.area = samples.area[chosen] * stride
        self.element = samples.element[chosen]
        self.spacing = np.sqrt(self.area)
        self.bounds = np.stack([self.position.min(axis=0), self.position.max(axis=0)])
        self.patch, self.patch_element = _patches(self.element, self.normal)
        key = np.hstack([self.position, NORMAL_SCALE_M * self.normal])
        self._tree = cKDTree(key, balanced_tree=False, compact_nodes=False)

    def near(self, position: NDArray[np.float64], margin: float) -> NDArray[np.bool_]:
        """(N,) the position [m] lies inside the bounds of the exposed surface, widened by ``margin`` [m]."""
        return ((position > self.bounds[0] - margin) & (position < self.bounds[1] + margin)).all(axis=1)

    def distance(self, position: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N,) distance in the search space of positions [m] and normals to the nearest place."""
        return self._tree.query(np.hstack([position, NORMAL_SCALE_M * normal]), workers=-1)[0]

    def match(
        self,
        position: NDArray[np.float64],
        normal: NDArray[np.float64],
        gate: float,
        to_station: NDArray[np.float64] | None = None,
    ) -> Matches:
        """The nearest compatible place for each return (N, 3) [m] with normals (N, 3), both in the local frame.

        Only places closer than ``gate`` along and not much further across the planned normal, whose normal agrees, and
        that are turned to the station (``to_station`` (N, 3) points there) count.
        """
        reach = np.hypot(1.5 * gate + 0.1, NORMAL_SCALE_M * np.sqrt(2.0 - 2.0 * COMPATIBLE_COS))
        _, index = self._tree.query(
            np.hstack([position, NORMAL_SCALE_M * normal]), distance_upper_bound=reach, workers=-1
        )
        row = np.flatnonzero(index < len(self.position))
        at = index[row]
        delta = position[row] - self.position[at]
        planned = self.normal[at]
        residual = np.einsum("ij,ij->i", delta, planned)
        across = np.linalg.norm(delta - residual[:, None] * planned, axis=1)
        good = (np.abs(residual) < gate) & (across < 1.5 * self.spacing[at] + 0.3 * gate)
        good &= np.einsum("ij,ij->i", planned, normal[row]) > COMPATIBLE_COS
        if to_station is not None:
            good &= np.einsum("ij,ij->i", planned, to_station[row]) > 0
        return Matches(row[good], residual[good], planned[good], self.patch[at[good]])


def _patches(
    element: NDArray[np.int32], normal: NDArray[np.float64]
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Number the patches: the faces of an element that look the same way (26 directions of a cube's grid)."""
    grid = np.round(normal / np.abs(normal).max(axis=1, keepdims=True) * 1.2).astype(np.int64).clip(-1, 1) + 1
    code = element.astype(np.int64) * 27 + grid @ np.array([9, 3, 1])
    unique, patch = np.unique(code, return_inverse=True)
    return patch.astype(np.int32), (unique // 27).astype(np.int32)
