"""On which planned surface does a return lie?"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..evidence.sightings import surfaces_at
from ..model.raycast import RayScene


def planned_at(
    scene: RayScene, origin: NDArray[np.float64], point: NDArray[np.float64], window: float
) -> NDArray[np.int32]:
    """(K,) the element whose planned outer surface returns (K, 3) of stations at ``origin`` (K, 3) lie on, within ``window``
    along its normal; -1 for none. Metres, local frame."""
    nearest = np.full(len(point), window)
    out = np.full(len(point), -1, np.int32)
    for away, element in surfaces_at(scene, origin, point, window):
        better = away < nearest
        nearest[better] = away[better]
        out[better] = element[better]
    return out
