"""Lines on edges of the model as observations of a bundle: they tie selected images of a series to the model.

Between them tie points carry the poses; what drifts there is pulled straight, and both ends of a loop meet on the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from .bundle_kernels import POSE
from .camera import Camera, rotation_vector
from .edge_bearers import EdgeBearers, together
from .element_errors import joint_covariance, line_distances
from .mistaken_lines import mistaken_px
from .uncertain_lines import LineMatches

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ImageEdges:
    """Lines of one image with the model edges they lie on, in the frame of the block; ideal pixels."""

    camera: int
    matches: LineMatches
    bearers: EdgeBearers
    """What an element bears shares its error, in all images."""


class PosePriors:
    """Coarse poses of some images as observations: what they are worth until lines say it better. See ``bundle.Term``."""

    name = "coarse poses"

    def __init__(self, cameras: Sequence[Camera], chosen: Sequence[int], position_sigma: float, rotation_sigma: float) -> None:
        """``cameras`` as given, the numbers of those that count, and their sigmas per axis [m], [rad]."""
        self._given = {k: cameras[k] for k in chosen}
        self._weight = np.repeat([rotation_sigma**-2, position_sigma**-2], 3)

    def normals(self, cameras: Sequence[Camera]) -> tuple[Floats, Floats, float, int]:
        """See ``bundle.Term``."""
        information, push = np.zeros((POSE * len(cameras),) * 2), np.zeros(POSE * len(cameras))
        squares = 0.0
        for k, given in self._given.items():
            here = cameras[k]
            away = np.concatenate([rotation_vector(given.rotation @ here.rotation.T), given.position - here.position])
            rows = np.arange(POSE * k, POSE * (k + 1))
            information[rows, rows] = self._weight
            push[rows] = self._weight * away
            squares += float(self._weight @ away**2)
        return information, push, squares, POSE * len(self._given)


class LineTerm:
    """See ``bundle.Term``. ``model_sigma`` [m] per axis is that of the model's edges.

    Weights are those at the poses that the images were placed with, so the squares have one minimum.
    """

    name = "lines on edges"

    def __init__(self, images: Sequence[ImageEdges], model_sigma: float, placed: Sequence[Camera]) -> None:
        """``placed`` are the cameras of ``images``, as they were placed, in the frame of the block."""
        self.images, self._model_sigma = tuple(images), model_sigma
        bearers = together([i.bearers for i in images])
        parts = [line_distances(i.matches, c, model_sigma, False) for i, c in zip(images, placed, strict=True)]
        to_point, own = (np.concatenate([p[k] for p in parts]) for k in (2, 3))
        mistaken = np.array([mistaken_px(c.interior.width) ** 2 for c in placed]).repeat([len(i.matches) for i in images])
        cov = joint_covariance(to_point, own + mistaken[:, None, None], bearers, model_sigma)
        self._factor = cho_factor(cov, lower=True)

    def normals(self, cameras: Sequence[Camera]) -> tuple[Floats, Floats, float, int]:
        """See ``bundle.Term``."""
        parts = [line_distances(i.matches, cameras[i.camera], self._model_sigma, False) for i in self.images]
        value = np.concatenate([p[0] for p in parts])
        design = np.zeros((len(value), POSE * len(cameras)))
        row = 0
        for image, part in zip(self.images, parts, strict=True):
            rows = len(part[0])
            design[row : row + rows, POSE * image.camera : POSE * (image.camera + 1)] = part[1]
            row += rows
        used = np.concatenate([np.arange(POSE * i.camera, POSE * (i.camera + 1)) for i in self.images])
        weighted = cho_solve(self._factor, np.column_stack([design[:, used], value]))
        information = np.zeros((POSE * len(cameras),) * 2)
        information[np.ix_(used, used)] = design[:, used].T @ weighted[:, :-1]
        push = np.zeros(POSE * len(cameras))
        push[used] = -design[:, used].T @ weighted[:, -1]
        return information, push, float(value @ weighted[:, -1]), len(value)
