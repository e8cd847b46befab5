"""The datum of a block without control: the mean of its cameras stays where it is (a free network, inner constraints)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from .bundle_kernels import POSE
from .camera import Camera, rotation_vector
from .datum import common_moves

Floats = NDArray[np.float64]
HELD_M = 1e-3
"""How firmly the mean is held: no more than a measurement is worth, and not so stiff that the way to the minimum is long."""
LEAST_BASE_M = 1e-3


class FreeNet:
    """Seven conditions on how all cameras move from their start: no common shift, turn, or scale.

    Raises BimVerifyError where the cameras stand at one place, which fixes no scale.
    """

    name = "datum"

    def __init__(self, cameras: Sequence[Camera]) -> None:
        self._start = tuple(cameras)
        position = np.array([c.position for c in cameras])
        centre = position.mean(axis=0)
        base = float(np.sqrt(((position - centre) ** 2).sum(axis=1).mean()))
        if base < LEAST_BASE_M:
            raise BimVerifyError(
                f"The block has no control points and its cameras ({len(cameras)}) stand at one place, so nothing fixes its "
                "scale; give control points."
            )
        size = max(base, 1.0)
        weight = np.tile(np.concatenate([np.full(3, size**2), np.ones(3)]), len(cameras))
        flat = common_moves(cameras, centre, size).reshape(-1, 7)
        weighted = weight[:, None] * flat
        self._information = weighted @ np.linalg.solve(flat.T @ weighted, weighted.T) / HELD_M**2

    def normals(self, cameras: Sequence[Camera]) -> tuple[Floats, Floats, float, int]:
        """See ``bundle.Term``."""
        moved = np.concatenate([
            np.concatenate([rotation_vector(c.rotation @ s.rotation.T), c.position - s.position])
            for c, s in zip(cameras, self._start, strict=True)
        ])
        push = -self._information @ moved
        return self._information, push, float(-moved @ push), POSE + 1
