"""What the datum of a block is: how all cameras and points may move together, and whether something holds them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from .bundle_kernels import POSE
from .bundle_problem import BundleProblem
from .camera import Camera

Floats = NDArray[np.float64]
MOST_OPEN = 0.3
"""Standard deviation of the datum's least certain motion, as a share of the block's size: more than this is not held."""
MUCH = 100.0
"""Times the block's size: so much is any amount."""
FEWEST_POINTS = 3


def common_moves(cameras: Sequence[Camera], centre: Floats, size: float) -> Floats:
    """(C, 6, 7) what the cameras' rotations and positions do in a common shift, turn and scale about ``centre``; turn and scale
    by what moves a point at the distance ``size`` [m] by one metre."""
    lever = np.array([c.position for c in cameras]) - centre
    moves = np.zeros((len(cameras), POSE, 7))
    moves[:, 3:] = _point_moves(lever, size)
    for axis, unit in enumerate(np.eye(3)):
        moves[:, :3, 3 + axis] = [-c.rotation @ unit / size for c in cameras]
    return moves


def check_datum(problem: BundleProblem, information: Floats) -> None:
    """Raise BimVerifyError where control and ``information`` (6C, 6C) on the poses leave a common motion open, or where a
    camera with no such information sees too few points."""
    seen = np.unique(np.stack([problem.observed.camera, problem.observed.point], axis=1), axis=0)[:, 0]
    count = np.bincount(seen, minlength=len(problem.cameras))
    known = np.diag(information).reshape(-1, POSE).any(axis=1)
    few = np.flatnonzero((count < FEWEST_POINTS) & ~known)
    if len(few):
        raise BimVerifyError(
            f"{problem.cameras[few[0]].name} shows {count[few[0]]} of the points; {FEWEST_POINTS} or more fix a camera, leave "
            "it out."
        )
    centre, size = extent(problem)
    moves = common_moves(problem.cameras, centre, size).reshape(-1, 7)
    held = moves.T @ information @ moves
    lever = _point_moves(problem.points[problem.control.point] - centre, size)
    held += np.einsum("kij,ki,kil->jl", lever, problem.control.sigma**-2.0, lever)
    least = float(np.linalg.eigvalsh(held)[0])
    if least * (MOST_OPEN * size) ** 2 < 1.0:
        open_by = f"{1.0 / math.sqrt(least):.2g} m" if least * (MUCH * size) ** 2 > 1.0 else "any amount"
        raise BimVerifyError(
            f"The datum of the bundle is not fixed: {len(problem.control.point)} control points leave a shift, turn or scale "
            f"of the whole block open by {open_by}; give three or more that do not lie on one line."
        )


def extent(problem: BundleProblem) -> tuple[Floats, float]:
    """Centre (3,) and size (median distance from it, metres) of a block's cameras and points."""
    places = np.concatenate([[c.position for c in problem.cameras], problem.points])
    centre = np.median(places, axis=0)
    return centre, max(float(np.median(np.linalg.norm(places - centre, axis=1))), 1e-6)


def _point_moves(lever: Floats, size: float) -> Floats:
    """(N, 3, 7) what points at ``lever`` (N, 3) from the centre do."""
    moves = np.zeros((len(lever), 3, 7))
    moves[:, :, :3] = np.eye(3)
    for axis, unit in enumerate(np.eye(3)):
        moves[:, :, 3 + axis] = np.cross(unit, lever) / size
    moves[:, :, 6] = lever / size
    return moves
