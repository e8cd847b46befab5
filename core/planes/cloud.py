"""All returns of a campaign in one array near a local origin, each with its station."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..progress import Progress
from ..scans.campaign import ScanSource

BYTES_PER_RETURN = 80
"""Peak while surfels are made: coordinates, keys, order."""
FARTHEST_M = 2000.0
"""Returns farther from their station than this are not a building's."""


@dataclass(frozen=True)
class Cloud:
    """Returns in a local frame: local = scan frame - ``origin``. Metres."""

    points: NDArray[np.float32]
    """(N, 3)"""
    station: NDArray[np.int32]
    """(N,) rows of ``stations``."""
    stations: NDArray[np.float64]
    """(S, 3) local frame."""
    origin: NDArray[np.float64]
    """(3,)"""
    total: int
    """Returns of the campaign; more than N where they were thinned to fit the memory."""


def read_cloud(source: ScanSource, memory_gb: float, progress: Progress | None = None) -> Cloud:
    """All returns, or evenly every k-th of them where they would not fit ``memory_gb``."""
    progress = progress or Progress()
    stations = np.array([s.position for s in source.stations], dtype=np.float64).reshape(-1, 3)
    origin = np.round(np.median(stations, axis=0))
    stations = stations - origin
    step = max(1, int(np.ceil(source.point_count * BYTES_PER_RETURN / (memory_gb * 1e9))))
    points, owner = [], []
    read = total = 0
    for block in source.blocks():
        reach = np.einsum("ij,ij->i", block.offsets, block.offsets) < FARTHEST_M**2
        offsets = block.offsets[reach]
        kept = offsets[(-read) % step :: step] if step > 1 else offsets
        points.append((kept + stations[block.station]).astype(np.float32))
        owner.append(np.full(len(kept), block.station, dtype=np.int32))
        read += len(offsets)
        total += len(block.offsets)
        progress.update(total / max(source.point_count, 1), f"Reading returns ({total / 1e6:.1f} million)")
    if not total:
        raise BimVerifyError(f"{', '.join(source.paths)} holds no return, so there is nothing to reconstruct from.")
    return Cloud(np.concatenate(points), np.concatenate(owner), stations, origin, total)
