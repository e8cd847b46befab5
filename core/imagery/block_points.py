"""Tie points with what is known of their accuracy, from an adjusted project or from one that is adjusted here."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..json_in import read_json_object
from .bundle import BundleResult, adjust_bundle
from .bundle_problem import BundleProblem, Control, ImageObservations
from .bundle_project import SIGMA_PX, problem_of
from .bundler import read_bundler
from .camera import Camera
from .cameras_file import LARGEST_FILE, numbers
from .colmap import read_colmap
from .free_net import FreeNet

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
LEAST_RAYS = 2
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

    @property
    def sigma(self) -> Floats:
        """(M,) standard deviation per axis, sqrt(trace / 3)."""
        return np.asarray(np.sqrt(np.einsum("pii->p", self.covariance) / 3.0))


def read_block(path: str | Path) -> BlockPoints:
    """A project (JSON), a folder of COLMAP or a Bundler file.

    A project without covariances is adjusted first: with its control, or freely where it has none. Raises BimVerifyError.
    """
    source = Path(path)
    if source.is_dir():
        return _adjusted(read_colmap(source, SIGMA_PX))
    if source.suffix.lower() == ".out":
        return _adjusted(read_bundler(source, SIGMA_PX))
    content = read_json_object(source, "a bundle project", LARGEST_FILE)
    problem = problem_of(content, source)
    stated = numbers(content.get("point_covariance"), (len(problem.points), 6))
    if stated is None:
        return _adjusted(problem)
    shared = numbers(content.get("point_shared_sigma"), (len(problem.points),))
    weights = numbers(content.get("weights"), (len(problem.observed),))
    factor = content.get("variance_factor")
    covariance = np.empty((len(stated), 3, 3))
    covariance[:, UPPER[0], UPPER[1]] = covariance[:, UPPER[1], UPPER[0]] = stated
    if (np.linalg.eigvalsh(covariance) < 0).any():
        raise BimVerifyError(f"{source}: a point's covariance is none (it has a negative variance); adjust the project again.")
    return _block(
        problem, problem.cameras, problem.points, covariance, np.zeros(len(stated)) if shared is None else shared,
        np.ones(len(problem.observed)) if weights is None else weights,
        float(factor) if isinstance(factor, int | float) and np.isfinite(factor) else 1.0,
    )


def _adjusted(problem: BundleProblem) -> BlockPoints:
    problem = _determined(problem)
    terms = () if len(problem.control.point) else (FreeNet(problem.cameras),)
    found: BundleResult = adjust_bundle(problem, terms=terms, robust=True)
    return _block(
        problem, found.cameras, found.points, found.point_covariance, found.shared_sigma, found.weight, found.variance_factor
    )


def _block(
    problem: BundleProblem, cameras: tuple[Camera, ...], points: Floats, covariance: Floats, shared: Floats, weight: Floats,
    factor: float,
) -> BlockPoints:
    """Observations worse than stated make worse points; better ones may be luck. Points that nothing fixes are left out."""
    worse = max(factor, 1.0) if np.isfinite(factor) else 1.0
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


def _determined(problem: BundleProblem) -> BundleProblem:
    """The problem without points that fewer than two images show."""
    observed, control = problem.observed, problem.control
    good = np.bincount(observed.point, minlength=len(problem.points)) >= LEAST_RAYS
    if good.all():
        return problem
    row, known = np.cumsum(good) - 1, good[control.point]
    kept = good[observed.point]
    return replace(
        problem, points=problem.points[good],
        observed=ImageObservations(
            observed.camera[kept], row[observed.point[kept]], observed.pixel[kept], observed.sigma[kept]
        ),
        control=Control(row[control.point[known]], control.coordinates[known], control.sigma[known]),
    )
