"""A comparison seen from above and from two sides: every voxel, what changed in front of what did not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..change.results import DISAPPEARED, NEW, ChangeResult
from .palette import VOXEL_COLORS, to_bytes
from .pictures import png

MOST_PIXELS = 1000
FAINTEST = 0.15
"""Even a single voxel that did not change leaves this much colour."""
PLAIN_CHANGE = 4
"""So many changed voxels behind each other cover what did not change; fewer, the noise of surfaces, only tint it."""
MOST_CUT = 0.002
"""Share of the voxels at either end of each axis that pictures may leave out: single things far away would shrink the rest."""
MARGIN = 0.05
"""Of the extent of the others, kept around them."""
VIEWS = (("From above", 0, 1), ("From the south (-y)", 0, 2), ("From the east (+x)", 1, 2))


@dataclass(frozen=True)
class VoxelView:
    """One picture."""

    title: str
    image: str
    """PNG, base64."""
    width: int
    height: int


def voxel_views(result: ChangeResult) -> list[VoxelView]:
    """Pictures of all voxels with a state; none without voxels.

    Each pixel is a line of sight through the building: yellow or red where anything on it is new or gone (of the two, what
    there is more of), else green or blue, the stronger the more voxels lie behind it, so walls stand out from floors.
    """
    cloud = result.voxels
    if not len(cloud.index):
        return []
    low, high = np.quantile(cloud.index, [MOST_CUT, 1.0 - MOST_CUT], axis=0)
    edge = MARGIN * (high - low).max()
    near = ((cloud.index >= low - edge) & (cloud.index <= high + edge)).all(axis=1)
    place, state = cloud.index[near], cloud.state[near]
    return [VoxelView(title, *_picture(place[:, [across, up]], state)) for title, across, up in VIEWS]


def _picture(place: NDArray[np.int64], state: NDArray[np.uint8]) -> tuple[str, int, int]:
    place = place - place.min(axis=0)
    place //= -(-(int(place.max()) + 1) // MOST_PIXELS)
    width, height = (int(v) + 1 for v in place.max(axis=0))
    pixel = (height - 1 - place[:, 1]) * width + place[:, 0]
    counts = np.stack([np.bincount(pixel[state == s], minlength=width * height) for s in range(len(VOXEL_COLORS))])
    changed, still = counts[[NEW, DISAPPEARED]], counts[:NEW]
    depth = still.sum(axis=0)
    full = max(float(np.quantile(depth[depth > 0], 0.95)), 1.0) if depth.any() else 1.0
    strength = np.where(depth > 0, np.clip(depth / full, FAINTEST, 1.0), 0.0)
    color = 1.0 - strength[:, None] * (1.0 - VOXEL_COLORS[still.argmax(axis=0)])
    cover = np.clip(changed.sum(axis=0) / PLAIN_CHANGE, 0.0, 1.0)[:, None]
    color = (1.0 - cover) * color + cover * VOXEL_COLORS[NEW + changed.argmax(axis=0)]
    return png(to_bytes(color).reshape(height, width, 3)), width, height
