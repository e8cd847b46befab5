"""Alignment of a campaign to the model from a coarse pose."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..model.elements import BuildingModel
from ..model.raycast import RayScene
from ..model.samples import SurfaceSamples
from ..progress import Progress
from ..results import AlignmentRecord
from ..scans.campaign import ScanSource
from ..sensing.loa import UPPER_BOUND_M
from . import transform as se3
from .agreement import ray_agreement
from .planned_surface import PlannedSurface
from .refine import ADVICE, FEWEST_MATCHES, Fit, refine
from .subset import ReturnSubset, choose_returns
from .uncertainty import assess

LEAST_AGREEMENT = 0.2
"""Least share of the returns near the model that must lie on it. A wrong place in the right building gives 0.1-0.3 and
is found out by its rays; scans full of furniture and surroundings that no model holds give 0.4 and more."""
NEAR_M = 0.5
"""How far outside the model's bounds a return still counts as near it, metres."""
CHECKED_RAYS = 20_000
RAY_TOLERANCE_M = 0.05
"""Along the ray: the gate of the fine stage."""


def align_fine(
    model: BuildingModel,
    samples: SurfaceSamples,
    source: ScanSource,
    *,
    start: NDArray[np.float64] | None = None,
    sigma: float,
    loa: int,
    seed: int = 0,
    progress: Progress | None = None,
) -> AlignmentRecord:
    """Bring a campaign, registered within itself, from a coarse pose to where most faces of the model fit it.

    ``start`` (4, 4) is the coarse pose, scan frame to model frame [m], up to about 0.5 m and 3 degrees off; None is the
    identity. ``sigma`` [m] is the standard deviation of one return along its ray. Elements that moved, are missing or
    hidden do not pull as long as most faces along each direction are unmoved. ``loa`` does not change the pose: the
    record's ``inlier_ratio`` is the share of the returns within that level's bound of the planned surface (5 cm at
    most).

    Raises BimVerifyError when too few returns agree, or when the surfaces seen do not fix all six degrees of freedom.
    """
    progress = progress or Progress()
    begin = se3.translation(-model.origin) @ (np.eye(4) if start is None else se3.rigid(start))
    returns = choose_returns(source, seed=seed, progress=progress.part(0.0, 0.4))
    surface = PlannedSurface(model, samples)
    _check_near(surface, returns, begin)
    fit = refine(surface, returns, begin, sigma=sigma, seed=seed, progress=progress.part(0.4, 0.9))
    return make_record("fine", model, surface, returns, fit, sigma=sigma, loa=loa, progress=progress.part(0.9, 1.0))


def make_record(
    mode: str,
    model: BuildingModel,
    surface: PlannedSurface,
    returns: ReturnSubset,
    fit: Fit,
    *,
    sigma: float,
    loa: int,
    progress: Progress,
) -> AlignmentRecord:
    """Check a fit and write it down; the errors are those of :func:`align_fine`."""
    _check_agreement(model, surface, returns, fit)
    progress.update(0.5, "Uncertainty of the alignment")
    found = assess(fit, surface.patch_element, len(model.elements))
    carrying = fit.weights.match > 0
    bound = np.hypot(UPPER_BOUND_M[loa], 2.0 * sigma)
    progress.update(1.0, "Aligned")
    return AlignmentRecord(
        mode=mode,
        transform=se3.translation(model.origin) @ fit.pose,
        covariance=found.covariance,
        center=fit.center + model.origin,
        weakest_direction=found.weakest,
        rms=float(np.sqrt(np.mean(np.square(fit.matches.residual[carrying])))),
        inlier_ratio=float((np.abs(fit.matches.residual) < bound).sum() / fit.asked),
    )


def _check_near(surface: PlannedSurface, returns: ReturnSubset, start: NDArray[np.float64]) -> None:
    share = surface.near(se3.apply(start, returns.position), NEAR_M).mean()
    if share * len(returns) < FEWEST_MATCHES:
        raise BimVerifyError(f"The scans do not lie on the model: {share:.1%} of the returns are near it. {ADVICE}")


def _check_agreement(model: BuildingModel, surface: PlannedSurface, returns: ReturnSubset, fit: Fit) -> None:
    flat = np.flatnonzero(returns.flat)
    at = se3.apply(fit.pose, returns.position[flat[: fit.asked]])
    inside = surface.near(at, NEAR_M)
    share = len(fit.matches.row) / max(int(inside.sum()), 1)
    if share < LEAST_AGREEMENT:
        raise BimVerifyError(f"Too few returns agree with the model: {share:.0%} of those near it. {ADVICE}")
    seen = flat[returns.known[returns.station[flat]]][:CHECKED_RAYS]
    if not len(seen):
        return
    rays = ray_agreement(RayScene(model), model, returns, seen, fit.pose[None], RAY_TOLERANCE_M)
    if rays.through[0] > rays.agree[0]:
        raise BimVerifyError(
            f"The scans contradict the model: {rays.through[0]:.0%} of the rays pass through planned surfaces and only "
            f"{rays.agree[0]:.0%} end on them. {ADVICE}"
        )
