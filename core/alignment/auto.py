"""Alignment of a campaign to the model without a pose."""

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
from . import transform as se3
from .agreement import ray_agreement
from .fine import make_record
from .planned_surface import PlannedSurface
from .refine import coarse_pose, refine
from .subset import ReturnSubset, choose_returns
from .voting import level, vote

VOTERS = 40_000
FIRST_RAYS, FIRST_TOLERANCE_M = 1_500, 0.3
"""Rays that rank the votes, and how far off they may end, metres: a raster cell, and a degree of heading at 10 m."""
FOLLOWED = 12
"""Votes that are fitted before the second ranking."""
FIT_RETURNS = 4_000
FIT_SCALES_M = (0.3, 0.3, 0.2, 0.2, 0.14, 0.1, 0.07, 0.05)
SECOND_RAYS, SECOND_TOLERANCE_M = 8_000, 0.1
SAME_M, SAME_RAD = 0.3, 0.05
"""Two fitted votes closer than this at the stations are one pose."""
LEAST_SCORE = 0.25
"""Least surplus of rays that end on the plan over rays that pass through it: scans of one building in the model of another
reached 0.17 at most in 30 pairs, in their own model 0.67 and more."""
AMBIGUOUS = 0.9
"""Share of the best score from which a second pose counts as possible too: elements that moved or are missing take 10 %
of the score from the true pose as easily as from a mirrored one."""
LAST_SCALES_M = (0.1, 0.05)


def align_auto(
    model: BuildingModel,
    samples: SurfaceSamples,
    source: ScanSource,
    *,
    sigma: float,
    loa: int,
    seed: int = 0,
    progress: Progress | None = None,
) -> AlignmentRecord:
    """Find the pose of a campaign, registered within itself and level to about 10 degrees, anywhere in the model.

    Orientation histograms give headings, floors and ceilings give heights, and wall rasters give places; every
    candidate is judged by rays that end on the planned surface less rays that pass through it, and the best one is
    refined as in :func:`~.fine.align_fine`. Raises BimVerifyError when no pose fits, when two fit about equally well
    (a symmetric or repeating building), when the scanner positions are not known, or for the reasons of ``align_fine``.
    """
    progress = progress or Progress()
    returns = choose_returns(source, seed=seed, progress=progress.part(0.0, 0.2))
    if not returns.known.all():
        raise BimVerifyError(
            f"{', '.join(source.paths)} names no scanner position, without which a pose cannot be searched. "
            "Give the position or a coarse pose."
        )
    flat = np.flatnonzero(returns.flat)
    if not len(flat):
        raise BimVerifyError("The scans show no plane to align by. Give denser scans or a coarse pose.")
    surface, scene = PlannedSurface(model, samples), RayScene(model)
    progress.update(0.3, "Looking for poses")
    poses = _candidates(surface, returns, flat)
    first = ray_agreement(scene, model, returns, flat[:FIRST_RAYS], poses, FIRST_TOLERANCE_M).score
    followed = np.argsort(-first, kind="stable")[:FOLLOWED]
    fitted = []
    for k, index in enumerate(followed):
        part = progress.part(0.4 + 0.3 * k / len(followed), 0.4 + 0.3 * (k + 1) / len(followed))
        fitted.append(coarse_pose(surface, returns, flat[:FIT_RETURNS], poses[index], FIT_SCALES_M, part))
    second = ray_agreement(scene, model, returns, flat[:SECOND_RAYS], np.array(fitted), SECOND_TOLERANCE_M).score
    best = _best_pose(fitted, second, returns)
    fit = refine(
        surface, returns, best, sigma=sigma, seed=seed, scales=LAST_SCALES_M, progress=progress.part(0.7, 0.95)
    )
    return make_record(
        "auto", model, surface, returns, fit, sigma=sigma, loa=loa, progress=progress.part(0.95, 1.0)
    )


def _candidates(surface: PlannedSurface, returns: ReturnSubset, flat: NDArray[np.int64]) -> NDArray[np.float64]:
    """(K, 4, 4) votes, scan frame to local frame."""
    middle = returns.station_position.mean(axis=0)
    reach = np.linalg.norm(surface.bounds[1] - surface.bounds[0])
    near = flat[np.linalg.norm(returns.position[flat] - middle, axis=1) < reach][:VOTERS]
    if len(near) < 100:
        near = flat[:VOTERS]
    upright = se3.from_parts(level(returns.normal[near]), np.zeros(3)) @ se3.translation(-middle)
    poses = vote(
        se3.apply(upright, returns.position[near]),
        se3.rotate(upright, returns.normal[near]),
        surface.position,
        surface.normal,
        surface.area,
    )
    if not len(poses):
        raise BimVerifyError("The scans show too few walls, floors or ceilings to find a pose by. Give a coarse pose.")
    return poses @ upright


def _best_pose(
    poses: list[NDArray[np.float64]], score: NDArray[np.float64], returns: ReturnSubset
) -> NDArray[np.float64]:
    order = np.argsort(-score, kind="stable")
    best = poses[order[0]]
    if score[order[0]] < LEAST_SCORE:
        raise BimVerifyError(
            "No pose was found in which the scans fit the model. Check that they are of the same building and in "
            "metres, or give a coarse pose."
        )
    for k in order[1:]:
        if score[k] < AMBIGUOUS * score[order[0]]:
            break
        motion = se3.log_about(poses[k] @ se3.inverse(best), se3.apply(best, returns.station_position).mean(axis=0))
        if np.linalg.norm(motion[3:]) > SAME_M or np.linalg.norm(motion[:3]) > SAME_RAD:
            raise BimVerifyError(
                f"Two poses fit about equally well ({score[order[0]]:.2f} and {score[k]:.2f} of the rays), "
                f"{np.linalg.norm(motion[3:]):.1f} m and {np.degrees(np.linalg.norm(motion[:3])):.0f} degrees apart. "
                "Give a coarse pose."
            )
    return best
