"""Points that nothing fixes are left out of a block before it is adjusted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .bundle_problem import BundleProblem, Control, ImageObservations

LEAST_RAYS = 2


def determined(problem: BundleProblem) -> tuple[BundleProblem, NDArray[np.int64]]:
    """The problem with the points that two images show, or one if it is a control point; and the rows (K,) of the others."""
    observed, control = problem.observed, problem.control
    shown = np.unique(np.stack([observed.point, observed.camera], axis=1), axis=0)[:, 0]
    rays = np.bincount(shown, minlength=len(problem.points))
    good = rays >= LEAST_RAYS
    good[control.point[rays[control.point] > 0]] = True
    if good.all():
        return problem, np.zeros(0, np.int64)
    row, known = np.cumsum(good) - 1, good[control.point]
    kept = good[observed.point]
    return replace(
        problem, points=problem.points[good],
        observed=ImageObservations(
            observed.camera[kept], row[observed.point[kept]], observed.pixel[kept], observed.sigma[kept]
        ),
        control=Control(row[control.point[known]], control.coordinates[known], control.sigma[known]),
    ), np.flatnonzero(~good)
