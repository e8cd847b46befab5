"""Bundle adjustment in the Gauss-Markov model, with the covariance of every point and variance components per group.

The points are eliminated (Schur complement), so the dense system has the size of the cameras only. Groups of observations
(tie points, control, and what ``terms`` add) each get a variance component: s^2 = v^T W v / r, r the group's redundancy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from ..errors import BimVerifyError
from ..progress import Progress
from .bundle_kernels import (
    INSIDE,
    POSE,
    back_substitute,
    point_covariances,
    reduced_normals,
    residuals,
)
from .bundle_problem import INSIDE_NAMES, BundleProblem
from .camera import Camera, Interior

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
MOST_ROUNDS = 50
ENOUGH = 1e-10
"""Relative decrease of the weighted squares that ends the iteration."""
NOTHING_LEFT = 1e-9
"""Weighted squares per observation that are rounding: the observations have no noise."""
FEWEST_RAYS, NEARLY_NOTHING = 2, 1e-6
"""A point with fewer rays that are no outliers keeps all of them with this weight: it says nothing of the cameras, its own
sigma says how little is known of it, and the others are adjusted."""
LEAST_SPREAD = 0.1
"""Of the stated sigma: a smaller spread of the residuals makes no observation an outlier."""


class Term(Protocol):
    """Observations of cameras without points (lines, relative poses, priors); one group each."""

    name: str

    def normals(self, cameras: Sequence[Camera]) -> tuple[Floats, Floats, float, int]:
        """Information (6C, 6C), right side (6C,), weighted squares, and number of observations, at these cameras."""
        ...


@dataclass(frozen=True)
class Group:
    """A kind of observations after the adjustment; ``factor`` is its variance component (1: as accurate as stated)."""

    name: str
    observations: int
    redundancy: float
    squares: float

    @property
    def factor(self) -> float:
        """Estimated variance over the stated one."""
        return self.squares / self.redundancy if self.redundancy > 1e-6 else float("nan")


@dataclass(frozen=True)
class BundleResult:
    """The adjusted problem. Covariances are those of the stated sigmas times ``variance_factor`` where asked for."""

    cameras: tuple[Camera, ...]
    interiors: tuple[Interior, ...]
    points: Floats
    point_covariance: Floats
    """(M, 3, 3) square metres."""
    shared_sigma: Floats
    """(M,) part of a point's standard deviation that comes from the cameras: its neighbours have the same error. Metres, per
    axis."""
    pose_covariance: Floats
    """(C, 6, 6) rotation in the camera frame [rad] and position [m]."""
    interior_sigma: Floats
    """(I, 8) of relative focal length, cx, cy [px], k1, k2, p1, p2, k3; zero where fixed."""
    variance_factor: float
    redundancy: int
    groups: tuple[Group, ...]
    residual: Floats
    """(N, 2) computed minus observed, pixels, in the order of the problem's observations."""
    weight: Floats
    """(N,) of each observation after robust re-weighting; 1: kept in full."""
    rounds: int


def adjust_bundle(
    problem: BundleProblem, *, terms: Sequence[Term] = (), robust: bool = False, progress: Progress | None = None
) -> BundleResult:
    """Estimate cameras, free interior parameters and points by weighted least squares.

    ``robust`` re-weights observations by Huber's function of their normalised residual. Raises BimVerifyError when the
    datum is not fixed (no control, no terms), when points cannot be determined, or when it does not settle.
    """
    problem.check()
    progress = progress or Progress()
    work = _Workspace(problem, terms)
    work.check_start()
    damping, cost = 1e-4, work.cost()
    for number in range(1, MOST_ROUNDS + 1):
        progress.update(number / (MOST_ROUNDS + 5), f"Bundle adjustment, round {number}")
        if robust and number > 3:
            work.reweight()
            cost = work.cost()
        better = False
        for _ in range(12):
            trial, predicted = work.stepped(damping)
            new = trial.cost()
            if np.isfinite(new) and new <= cost * (1.0 + 1e-12):
                better = True
                break
            damping *= 10.0
        if not better:
            break
        decrease = (cost - new) / max(cost, 1e-300)
        work, cost, damping = trial, new, max(damping / 10.0, 1e-15)
        settled = decrease < ENOUGH and predicted < 1e-6 and damping <= 1e-9
        exact = cost < NOTHING_LEFT * len(problem.observed) and predicted < 1e-6
        if (settled or exact) and not (robust and number < 8):
            break
    else:
        raise BimVerifyError("The bundle adjustment does not settle; check the start values and look for gross errors.")
    return work.result(number, progress)


class _Workspace:
    """The state of an adjustment: arrays for the kernels, observations sorted by point."""

    def __init__(self, problem: BundleProblem, terms: Sequence[Term]) -> None:
        self.problem, self.terms = problem, terms
        observed = problem.observed
        self.order = np.argsort(observed.point, kind="stable")
        self.camera = np.ascontiguousarray(observed.camera[self.order])
        self.point = np.ascontiguousarray(observed.point[self.order])
        self.pixel = np.ascontiguousarray(observed.pixel[self.order], dtype=np.float64)
        self.base = 1.0 / observed.sigma[self.order] ** 2
        self.robust = np.ones(len(self.base))
        self.first = np.searchsorted(self.point, np.arange(len(problem.points) + 1)).astype(np.int64)
        self.most = int(np.diff(self.first).max())
        self.centre = problem.points.mean(axis=0)
        self.cameras = list(problem.cameras)
        self.interiors = list(problem.interiors)
        self.points = np.ascontiguousarray(problem.points - self.centre)
        self.total = POSE * len(self.cameras) + INSIDE * len(self.interiors)
        named = np.array([name in problem.free for name in INSIDE_NAMES])
        self.free = np.concatenate([np.ones(POSE * len(self.cameras), bool), np.tile(named, len(self.interiors))])
        self._control()
        self._arrays()

    def _control(self) -> None:
        control, count = self.problem.control, len(self.points)
        self.known = np.zeros((count, 3, 3))
        self.target = np.zeros((count, 3))
        for row, point in enumerate(control.point):
            self.known[point] += np.diag(control.sigma[row] ** -2.0)
            self.target[point] = control.coordinates[row] - self.centre

    def _arrays(self) -> None:
        self.rotations = np.array([c.rotation for c in self.cameras])
        self.positions = np.array([c.position for c in self.cameras]) - self.centre
        self.insides = np.array([_inside_row(i) for i in self.interiors])

    @property
    def _seen(self) -> tuple[Floats, Floats, Floats, Ints, Floats]:
        return (
            self.rotations, self.positions, self.insides, np.asarray(self.problem.inside_of, dtype=np.int64), self.points,
        )

    def left(self) -> Floats:
        return residuals(*self._seen, self.camera, self.point, self.pixel)

    def check_start(self) -> None:
        """Raise BimVerifyError where a start value cannot be seen: no step would be found from there."""
        blind = np.flatnonzero(~np.isfinite(self.left()).all(axis=1))
        if len(blind):
            first = f"point {self.point[blind[0]]}, {self.cameras[self.camera[blind[0]]].name}"
            raise BimVerifyError(
                f"{len(np.unique(self.point[blind]))} points start behind a camera that observes them ({first}). Correct their "
                "coordinates or leave these observations out."
            )

    def _control_squares(self) -> float:
        away = self.target - self.points
        return float(np.einsum("pi,pij,pj->", away, self.known, away))

    def cost(self) -> float:
        squares = float((self.left() ** 2).sum(axis=1) @ (self.base * self.robust))
        return squares + self._control_squares() + sum(term.normals(self.cameras)[2] for term in self.terms)

    def reweight(self) -> None:
        """Huber: full weight within 2.5 sigma of the group's own spread."""
        size = np.sqrt((self.left() ** 2).sum(axis=1) * self.base)
        spread = max(float(np.median(size)) / 1.1774, LEAST_SPREAD)
        self.robust = np.minimum(1.0, 2.5 * spread / np.maximum(size, 1e-12))
        self.robust[size > 10.0 * spread] = 0.0
        kept = np.bincount(self.point[self.robust > 0.0], minlength=len(self.points))
        lost = (kept < FEWEST_RAYS) & ~self.known.any(axis=(1, 2))
        self.robust[lost[self.point]] = NEARLY_NOTHING

    def _normals(self, damping: float) -> tuple[Floats, Floats, Floats, Floats]:
        pull = np.einsum("pij,pj->pi", self.known, self.target - self.points)
        normal, right, inverse, shift = reduced_normals(
            *self._seen, self.first, self.camera, self.pixel, self.base * self.robust, self.known, pull, damping,
            self.total, self.most,
        )
        total, side = normal.sum(axis=0), right.sum(axis=0)
        poses = POSE * len(self.cameras)
        for term in self.terms:
            information, push, _, _ = term.normals(self.cameras)
            total[:poses, :poses] += information
            side[:poses] += push
        return total, side, inverse, shift

    def stepped(self, damping: float) -> tuple[_Workspace, float]:
        total, side, inverse, shift = self._normals(damping)
        keep = np.flatnonzero(self.free)
        step = np.zeros(self.total)
        matrix = total[np.ix_(keep, keep)]
        matrix[np.diag_indices(len(keep))] *= 1.0 + damping
        step[keep] = _cholesky_solve(matrix, side[keep])
        moved = back_substitute(
            *self._seen, self.first, self.camera, self.pixel, self.base * self.robust, inverse, shift, step, self.most
        )
        out = object.__new__(_Workspace)
        out.__dict__.update(self.__dict__)
        poses = step[: POSE * len(self.cameras)].reshape(-1, POSE)
        out.cameras = [c.moved(s[:3], s[3:]) for c, s in zip(self.cameras, poses, strict=True)]
        inside = step[POSE * len(self.cameras) :].reshape(-1, INSIDE)
        out.interiors = [_moved_interior(i, s) for i, s in zip(self.interiors, inside, strict=True)]
        out.points = self.points + moved
        out._arrays()
        return out, float(np.abs(side @ step))

    def result(self, rounds: int, progress: Progress) -> BundleResult:
        progress.update(0.9, "Covariances")
        total, _, inverse, _ = self._normals(0.0)
        keep = np.flatnonzero(self.free)
        covariance = np.zeros((self.total, self.total))
        covariance[np.ix_(keep, keep)] = _cholesky_solve(total[np.ix_(keep, keep)], np.eye(len(keep)))
        weight = self.base * self.robust
        point_cov, taken = point_covariances(
            *self._seen, self.first, self.camera, self.pixel, weight, inverse, covariance, self.most
        )
        shared = np.einsum("pii->p", point_cov - inverse) / 3.0
        left = self.left()
        groups = self._groups(left, taken, point_cov, covariance)
        observations, squares = sum(g.observations for g in groups), sum(g.squares for g in groups)
        redundancy = observations - len(keep) - 3 * len(self.points)
        factor = squares / redundancy if redundancy > 0 else float("nan")
        poses = POSE * len(self.cameras)
        blocks = covariance[:poses, :poses].reshape(len(self.cameras), POSE, len(self.cameras), POSE)
        index = np.arange(len(self.cameras))
        unsorted = np.empty_like(left)
        unsorted[self.order] = left
        kept = np.empty(len(left))
        kept[self.order] = self.robust
        progress.update(1.0, "Bundle adjustment done")
        return BundleResult(
            cameras=tuple(
                replace(c, interior=self.interiors[i]) for c, i in zip(self.cameras, self.problem.inside_of, strict=True)
            ),
            interiors=tuple(self.interiors), points=self.points + self.centre, point_covariance=point_cov,
            shared_sigma=np.sqrt(np.maximum(shared, 0.0)),
            pose_covariance=blocks[index, :, index, :],
            interior_sigma=np.sqrt(np.diag(covariance)[poses:]).reshape(-1, INSIDE),
            variance_factor=factor, redundancy=redundancy, groups=groups, residual=unsorted, weight=kept, rounds=rounds,
        )

    def _groups(self, left: Floats, taken: Floats, point_cov: Floats, covariance: Floats) -> tuple[Group, ...]:
        used = self.robust > 0
        count = 2 * int(used.sum())
        squares = float((left[used] ** 2).sum(axis=1) @ (self.base * self.robust)[used])
        groups = [Group("tie points", count, count - float(taken.sum()), squares)]
        controlled = np.unique(self.problem.control.point)
        if len(controlled):
            count = 3 * len(self.problem.control.point)
            used_up = float(np.einsum("pij,pji->", self.known[controlled], point_cov[controlled]))
            groups.append(Group("control", count, count - used_up, self._control_squares()))
        poses = POSE * len(self.cameras)
        for term in self.terms:
            information, _, squares, count = term.normals(self.cameras)
            groups.append(Group(term.name, count, count - float(np.sum(information * covariance[:poses, :poses])), squares))
        return tuple(groups)


def _cholesky_solve(matrix: Floats, right: Floats) -> Floats:
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix * scale[:, None] * scale[None, :]
    try:
        factor = cho_factor(scaled, lower=True, check_finite=False)
    except np.linalg.LinAlgError as error:
        raise BimVerifyError(
            "The datum of the bundle is not fixed, or a camera hangs on too few points; give control points, coarse "
            "poses with their sigma, or more observations."
        ) from error
    sides = right * scale if right.ndim == 1 else right * scale[:, None]
    found = cho_solve(factor, sides, check_finite=False)
    return np.asarray(found * scale if right.ndim == 1 else found * scale[:, None])


def _inside_row(interior: Interior) -> Floats:
    return np.array([interior.fx, interior.fy, interior.cx, interior.cy, *interior.distortion])


def _moved_interior(interior: Interior, step: Floats) -> Interior:
    if not step.any():
        return interior
    scale = 1.0 + float(step[0])
    k1, k2, p1, p2, k3 = np.array(interior.distortion) + step[3:]
    return replace(
        interior, fx=interior.fx * scale, fy=interior.fy * scale, cx=interior.cx + float(step[1]),
        cy=interior.cy + float(step[2]), distortion=(float(k1), float(k2), float(p1), float(p2), float(k3)),
    )
