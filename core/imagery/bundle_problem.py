"""What a bundle adjustment is given: cameras, tie points, control points, and what is free."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from .camera import Camera, Interior
from .cameras_file import FARTHEST_COORDINATE_M

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FARTHEST_PX = 1e6
LEAST_SIGMA, LARGEST_SIGMA = 1e-9, 1e6
INSIDE_NAMES = ("f", "cx", "cy", "k1", "k2", "p1", "p2", "k3")


@dataclass(frozen=True)
class ImageObservations:
    """Where points are seen in images: camera (N,), point (N,), pixel (N, 2) as in the image, sigma (N,) pixels."""

    camera: Ints
    point: Ints
    pixel: Floats
    sigma: Floats

    def __len__(self) -> int:
        return len(self.camera)


@dataclass(frozen=True)
class Control:
    """Points with known coordinates: point (K,), coordinates (K, 3) and standard deviations (K, 3), metres."""

    point: Ints
    coordinates: Floats
    sigma: Floats

    @staticmethod
    def none() -> Control:
        return Control(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)))


@dataclass(frozen=True)
class BundleProblem:
    """Cameras that share interiors, points with start coordinates, and what was observed.

    ``inside_of`` (C,) the interior of each camera, ``free`` the names of the interior's parameters to estimate.
    """

    cameras: tuple[Camera, ...]
    interiors: tuple[Interior, ...]
    inside_of: Ints
    points: Floats
    """(M, 3) metres."""
    observed: ImageObservations
    control: Control = field(default_factory=Control.none)
    free: tuple[str, ...] = ()

    def check(self) -> None:
        """Raise BimVerifyError when indices or numbers cannot be right."""
        o, m, c = self.observed, len(self.points), len(self.cameras)
        if not c or not m or not len(o):
            raise BimVerifyError("A bundle adjustment needs cameras, points and observations; one of them is missing.")
        for name, index, size in (("camera", o.camera, c), ("point", o.point, m), ("point", self.control.point, m)):
            if len(index) and (index.min() < 0 or index.max() >= size):
                wrong = int(index.max() if index.max() >= size else index.min())
                raise BimVerifyError(f"An observation names {name} {wrong}; they are numbered 0 to {size - 1}.")
        if unknown := set(self.free) - set(INSIDE_NAMES):
            raise BimVerifyError(f"{', '.join(sorted(unknown))} cannot be calibrated; choose from {', '.join(INSIDE_NAMES)}.")
        poses = [*(k.rotation for k in self.cameras), *(k.position for k in self.cameras)]
        if not all(np.isfinite(a).all() for a in (self.points, o.pixel, self.control.coordinates, *poses)):
            raise BimVerifyError("The project holds numbers that are not finite; take those points or cameras out.")
        places = (self.points, self.control.coordinates, *(k.position for k in self.cameras))
        far = max(float(np.abs(place).max(initial=0.0)) for place in places)
        if far > FARTHEST_COORDINATE_M or np.abs(o.pixel).max() > FARTHEST_PX:
            raise BimVerifyError(
                f"The project holds coordinates beyond {FARTHEST_COORDINATE_M:g} m or pixels beyond {FARTHEST_PX:g}; take "
                "those points or cameras out."
            )
        for sigma in (o.sigma, self.control.sigma):
            if not ((sigma >= LEAST_SIGMA) & (sigma <= LARGEST_SIGMA)).all():
                raise BimVerifyError(
                    "Every observation needs a standard deviation larger than zero, pixels or metres: "
                    f"{LEAST_SIGMA:g} to {LARGEST_SIGMA:g}."
                )
        index, times = np.unique(self.control.point, return_counts=True)
        if (times > 1).any():
            raise BimVerifyError(f"The control points name point {index[times > 1][0]} twice; give each point once.")
