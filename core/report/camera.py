"""Where a picture of the model is taken from. Metres, local frame of the model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Camera:
    """A parallel projection: every ray runs along ``forward``."""

    center: NDArray[np.float64]
    """(3,) the point in the middle of the picture."""
    forward: NDArray[np.float64]
    """(3,) unit vector, from the viewer into the picture."""
    up: NDArray[np.float64]
    """(3,) unit vector, upwards in the picture."""
    width: float
    """Metres across the picture."""
    reach: float
    """Rays start this far before ``center``: outside the model."""
    cut_z: float | None = None
    """Height above which the model is cut away."""
    bottom_z: float | None = None
    """Below this nothing is drawn; only together with ``cut_z``."""

    @property
    def right(self) -> NDArray[np.float64]:
        """(3,) unit vector, to the right in the picture."""
        return np.cross(self.forward, self.up)

    @property
    def sight(self) -> float:
        """How far the rays go, metres: from the cutting plane to ``bottom_z``, else to infinity."""
        if self.cut_z is None or self.bottom_z is None or self.forward[2] > -1e-6:
            return np.inf
        return float((self.bottom_z - self.cut_z) / self.forward[2])

    def project(self, xyz: NDArray[np.float64], size: tuple[int, int]) -> NDArray[np.float64]:
        """(N, 3) positions to (N, 2) pixel coordinates (column, row) in a picture of ``size`` (width, height)."""
        scale = size[0] / self.width
        offset = np.asarray(xyz, dtype=np.float64) - self.center
        return np.stack([size[0] / 2 + scale * (offset @ self.right), size[1] / 2 - scale * (offset @ self.up)], axis=1)


def view_of_box(
    bounds: NDArray[np.float64],
    azimuth: float,
    elevation: float,
    size: tuple[int, int],
    *,
    cut_z: float | None = None,
    bottom_z: float | None = None,
    margin: float = 0.04,
) -> Camera:
    """A camera that shows the whole box ``bounds`` (2, 3) from a side.

    ``azimuth``: the compass side of the viewer in degrees, counter-clockwise from +x (225 looks from -x, -y).
    ``elevation``: degrees above the horizon; 90 is a plan with +y upwards. ``size``: (width, height) in pixels.
    ``cut_z``, ``bottom_z``: heights between which the model is drawn.
    """
    low, high = np.array(bounds, dtype=np.float64)
    if cut_z is not None:
        low[2] = low[2] if bottom_z is None else max(low[2], bottom_z)
        high[2] = max(min(high[2], cut_z), low[2] + 1e-3)
    a, e = np.radians(azimuth), np.radians(elevation)
    forward = -np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    up = np.array([0.0, 1.0, 0.0]) if elevation > 89.9 else np.array([0.0, 0.0, 1.0])
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    corners = np.stack(np.meshgrid(*np.stack([low, high], axis=1), indexing="ij"), axis=-1).reshape(-1, 3)
    across, along = corners @ right, corners @ up
    width = max(np.ptp(across), np.ptp(along) * size[0] / size[1]) * (1 + 2 * margin)
    middle = (
        right * (across.max() + across.min()) / 2
        + up * (along.max() + along.min()) / 2
        + forward * ((low + high) / 2 @ forward)
    )
    reach = float(np.linalg.norm(high - low)) + 1.0
    return Camera(middle, forward, up, float(max(width, 1e-3)), reach, cut_z, bottom_z)
