"""Tie points with what is known of their accuracy, from an adjusted project or from one that is adjusted here."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from .bundle import BundleResult, adjust_bundle
from .bundle_problem import BundleProblem
from .bundle_project import problem_of, project_content
from .camera import Camera
from .cameras_file import POSITION_SIGMA_M, numbers, positive, read_camera_entries
from .determined import LEAST_RAYS, determined
from .free_net import FreeNet

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
LARGEST_SIGMA_M = 0.25
"""A tie point that is less certain says nothing about a building."""
UPPER = ([0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2])
"""Where the six numbers of a point's covariance stand."""


@dataclass(frozen=True)
class BlockPoints:
    """A block of photos: cameras, tie points, and which observations (K,) hold. Metres, frame of the project."""

    cameras: tuple[Camera, ...]
    points: Floats
    """(M, 3)"""
    covariance: Floats
    """(M, 3, 3)"""
    shared_sigma: Floats
    """(M,) see ``BundleResult.shared_sigma``."""
    camera: Ints
    point: Ints
    place_sigma: float = 0.0
    """Of the place of the whole block where nothing but the given poses says it: metres per axis."""

    @property
    def scale_sigma(self) -> float:
        """Of a block's scale where nothing but the given positions of its cameras says it, their errors being independent."""
        position = np.array([c.position for c in self.cameras])
        return self.place_sigma / float(np.linalg.norm(position - position.mean(axis=0))) if self.place_sigma else 0.0

    @property
    def sigma(self) -> Floats:
        """(M,) standard deviation per axis, sqrt(trace / 3)."""
        return np.asarray(np.sqrt(np.einsum("pii->p", self.covariance) / 3.0))


def read_block(path: str | Path) -> BlockPoints:
    """A project (JSON), a folder of COLMAP or a Bundler file.

    A project without covariances is adjusted first: with its control, or freely where it has none. Raises BimVerifyError.
    """
    source = Path(path)
    content = project_content(source)
    problem = problem_of(content, source)
    stated = numbers(content.get("point_covariance"), (len(problem.points), 6))
    if stated is None:
        return _adjusted(problem, _place_sigma(content, source))
    shared = numbers(content.get("point_shared_sigma"), (len(problem.points),))
    weights = numbers(content.get("weights"), (len(problem.observed),))
    factor = content.get("variance_factor")
    covariance = np.empty((len(stated), 3, 3))
    covariance[:, UPPER[0], UPPER[1]] = covariance[:, UPPER[1], UPPER[0]] = stated
    if (np.linalg.eigvalsh(covariance) < 0).any():
        raise BimVerifyError(f"{source}: a point's covariance is none (it has a negative variance); adjust the project again.")
    if not isinstance(factor, int | float) or not np.isfinite(factor):
        raise BimVerifyError(f"{source} has covariances of its points, but no variance_factor; adjust the project again.")
    return _block(
        problem, problem.cameras, problem.points, covariance, np.zeros(len(stated)) if shared is None else shared,
        np.ones(len(problem.observed)) if weights is None else weights,
        1.0 if "covariance_scale" in content else max(float(factor), 1.0),
    )


def _place_sigma(content: dict[str, Any], source: Path) -> float:
    """The largest that a project states of its given positions [m]."""
    if "import" in content:
        return positive(content, "position_sigma_m", source.name, POSITION_SIGMA_M)
    return max(known.position_sigma for known in read_camera_entries(content, source))


def _adjusted(problem: BundleProblem, place_sigma: float) -> BlockPoints:
    problem, _ = determined(problem)
    free = not len(problem.control.point)
    terms = (FreeNet(problem.cameras),) if free else ()
    found: BundleResult = adjust_bundle(problem, terms=terms, robust=True)
    block = _block(problem, found.cameras, found.points, found.point_covariance, found.shared_sigma, found.weight, 1.0)
    return replace(block, place_sigma=place_sigma) if free else block


def _block(
    problem: BundleProblem, cameras: tuple[Camera, ...], points: Floats, covariance: Floats, shared: Floats, weight: Floats,
    worse: float,
) -> BlockPoints:
    """The block with ``worse`` times the covariances; points that nothing fixes are left out."""
    variance = worse * np.einsum("pii->pi", covariance)
    good = (variance > 0).all(axis=1) & (variance.sum(axis=1) <= 3 * LARGEST_SIGMA_M**2)
    good &= np.bincount(problem.observed.point[weight > 0], minlength=len(points)) >= LEAST_RAYS
    if not good.any():
        raise BimVerifyError(f"No tie point is known to {LARGEST_SIGMA_M:g} m; check the block's adjustment.")
    kept = (weight > 0) & good[problem.observed.point]
    return BlockPoints(
        cameras, points[good], worse * covariance[good], np.sqrt(worse) * np.maximum(shared[good], 0.0),
        problem.observed.camera[kept], (np.cumsum(good) - 1)[problem.observed.point[kept]],
    )
