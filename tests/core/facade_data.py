"""A painted photo of a planned facade as a file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from bim_verify.core.simulation.facade_photo import paint_facade, street_camera, truth_of
from bim_verify.core.simulation.facade_plan import FacadePlan, facade_plan


@dataclass(frozen=True)
class Photo:
    """Where it is and what it shows."""

    path: Path
    plan: FacadePlan
    truth: dict[str, Any]

    @property
    def corners(self) -> NDArray[np.float64]:
        """(4, 2) pixels."""
        return np.array(self.truth["corners_px"])


def photo_of(folder: Path, seed: int, size: int = 900) -> Photo:
    """The painted photo of the facade of a seed."""
    plan = facade_plan(seed)
    camera = street_camera(plan, size, np.random.default_rng((seed, 32)))
    path = folder / camera.name.replace(".jpg", ".png")
    Image.fromarray(paint_facade(plan, camera)).save(path)
    return Photo(path, plan, truth_of(plan, camera))
