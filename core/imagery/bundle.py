"""Bundle adjustment in the Gauss-Markov model, with the covariance of every point and variance components per group.

The points are eliminated (Schur complement), so the dense system has the size of the cameras only. Groups of observations
(tie points, control, and what ``terms`` add) each get a variance component: s^2 = v^T W v / r, r the group's redundancy. Tie
points and control that are worse than stated (chi-square test of their component) are adjusted again with larger sigmas.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from ..errors import BimVerifyError
from ..progress import Progress
from .bundle_kernels import (
    INSIDE,
    OWN,
    POSE,
    back_substitute,
    point_covariances,
    reduced_normals,
    residuals,
)
from .bundle_problem import INSIDE_NAMES, BundleProblem
from .camera import Camera, Interior
from .datum import check_datum, extent
from .determined import determined
from .normal_equations import invert, solve

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
TIE_POINTS, CONTROL = "tie points", "control"
WORSE = 0.001
"""A group whose squares chance exceeds with this probability only is worse than stated."""
MOST_WEIGHINGS = 4
MOST_CHUNKS = 8
BYTES_OF_OBSERVATION, BYTES_OF_POINT = 200, 450
"""Of a block and its adjustment in memory, beside the normal equations."""
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
    """Weighted by the stated sigmas."""
    stretch: float = 1.0
    """What the stated sigmas were multiplied by, because the observations are worse than that."""

    @property
    def factor(self) -> float:
        """Estimated variance over the stated one."""
        return self.squares / self.redundancy if self.redundancy > 1e-6 else float("nan")

    @property
    def stretched(self) -> float:
        """``stretch``, and what is wanting of it where the observations are still worse than chance makes them."""
        left = self.squares / self.stretch**2
        worse = self.redundancy > 1e-6 and left > chdtri(self.redundancy, WORSE)
        return math.sqrt(self.factor) if worse else self.stretch


@dataclass(frozen=True)
class BundleResult:
    """The adjusted problem.

    Covariances and sigmas count what the residuals show: groups that are worse than stated with their ``stretch``, and all by
    ``covariance_scale``, the variance factor that is left then, where it exceeds one.
    """

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
    """Of the stated sigmas."""
    covariance_scale: float
    redundancy: int
    groups: tuple[Group, ...]
    residual: Floats
    """(N, 2) computed minus observed, pixels, in the order of the problem's observations."""
    weight: Floats
    """(N,) of each observation after robust re-weighting; 1: kept in full."""
    rounds: int


def adjust_bundle(
    problem: BundleProblem, *, terms: Sequence[Term] = (), robust: bool = False, memory_gb: float = 3.0,
    progress: Progress | None = None,
) -> BundleResult:
    """Estimate cameras, free interior parameters and points by weighted least squares.

    ``robust`` re-weights observations by Huber's function of their normalised residual. Raises BimVerifyError when the
    datum is not fixed by control or terms, when it takes more than ``memory_gb``, or when it does not settle.
    """
    problem.check()
    progress = progress or Progress()
    start, stretch = problem, (1.0, 1.0)
    for _ in range(MOST_WEIGHINGS):
        work = _Workspace(start, terms, memory_gb, stretch)
        work.check_start()
        work, rounds = _settled(work, robust, progress)
        found = work.result(rounds, progress)
        needed = {group.name: group.stretched for group in found.groups}
        last, stretch = stretch, (needed[TIE_POINTS], needed.get(CONTROL, 1.0))
        if stretch == last:
            break
        start = replace(problem, cameras=found.cameras, interiors=found.interiors, points=found.points)
    return found


def _settled(work: _Workspace, robust: bool, progress: Progress) -> tuple[_Workspace, int]:
    """The minimum from the start in ``work``, and how many rounds it took."""
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
        exact = cost < NOTHING_LEFT * len(work.base) and predicted < 1e-6
        if (settled or exact) and not (robust and number < 8):
            break
    else:
        raise BimVerifyError("The bundle adjustment does not settle; check the start values and look for gross errors.")
    return work, number


class _Workspace:
    """The state of an adjustment: arrays for the kernels, observations sorted by point."""

    def __init__(
        self, problem: BundleProblem, terms: Sequence[Term], memory_gb: float, stretch: tuple[float, float]
    ) -> None:
        """``stretch`` the stated sigmas of tie points and of control are multiplied by."""
        self.problem, self.terms, self.stretch = problem, terms, stretch
        observed = problem.observed
        self.order = np.argsort(observed.point, kind="stable")
        self.camera = np.ascontiguousarray(observed.camera[self.order])
        self.point = np.ascontiguousarray(observed.point[self.order])
        self.pixel = np.ascontiguousarray(observed.pixel[self.order], dtype=np.float64)
        self.base = 1.0 / (stretch[0] * observed.sigma[self.order]) ** 2
        self.robust = np.ones(len(self.base))
        self.first = np.searchsorted(self.point, np.arange(len(problem.points) + 1)).astype(np.int64)
        self.most = int(np.diff(self.first).max())
        self.centre = problem.points.mean(axis=0)
        self.cameras = list(problem.cameras)
        self.interiors = list(problem.interiors)
        self.points = np.ascontiguousarray(problem.points - self.centre)
        named = np.flatnonzero([name in problem.free for name in INSIDE_NAMES])
        self.poses = POSE * len(self.cameras)
        self.total = self.poses + len(named) * len(self.interiors)
        inside = np.full((len(self.interiors), INSIDE), -1)
        inside[:, named] = self.poses + np.arange(self.total - self.poses).reshape(len(self.interiors), -1)
        self.inside = inside
        self.slot = np.column_stack([np.arange(self.poses).reshape(-1, POSE), inside[problem.inside_of]]).astype(np.int64)
        self.chunks = self._affordable(memory_gb)
        self._control()
        self._arrays()

    def _control(self) -> None:
        control, count = self.problem.control, len(self.points)
        self.known = np.zeros((count, 3, 3))
        self.target = np.zeros((count, 3))
        for row, point in enumerate(control.point):
            self.known[point] = np.diag((self.stretch[1] * control.sigma[row]) ** -2.0)
            self.target[point] = control.coordinates[row] - self.centre

    def _affordable(self, memory_gb: float) -> int:
        """Number of chunks that go into the memory. Raises BimVerifyError where not even one does."""
        square, track = 8.0 * self.total**2, 8.0 * (self.most * OWN) ** 2
        rest = float(BYTES_OF_OBSERVATION * len(self.camera) + BYTES_OF_POINT * len(self.points))
        rest += 8.0 * (len(self.terms) + 2) * self.poses**2
        for chunks in (MOST_CHUNKS, 4, 2, 1):
            need = ((chunks + 2) * square + chunks * track + rest) / 2**30
            if need <= memory_gb:
                return chunks
        raise BimVerifyError(
            f"The adjustment of {len(self.cameras)} images with {self.total} unknowns of poses and lenses takes {need:.2g} GB; "
            f"give more --memory-gb than {memory_gb:g}, let images share a lens, fix lens parameters, or split the block."
        )

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
        """Raise BimVerifyError where the datum is open, or where a start value cannot be seen: no step would be found from
        there."""
        information = np.zeros((self.poses, self.poses))
        for term in self.terms:
            information += term.normals(self.cameras)[0]
        check_datum(self.problem, information)
        open_points = determined(self.problem)[1]
        if len(open_points):
            raise BimVerifyError(f"Fewer than two images show point {open_points[0]}; leave it out.")
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
            self.slot, self.total, self.most, self.chunks,
        )
        total, side = normal.sum(axis=0), right.sum(axis=0)
        for term in self.terms:
            information, push, _, _ = term.normals(self.cameras)
            total[: self.poses, : self.poses] += information
            side[: self.poses] += push
        return total, side, inverse, shift

    def stepped(self, damping: float) -> tuple[_Workspace, float]:
        total, side, inverse, shift = self._normals(damping)
        total[np.diag_indices(self.total)] *= 1.0 + damping
        step = solve(total, side)
        moved = back_substitute(
            *self._seen, self.first, self.camera, self.pixel, self.base * self.robust, inverse, shift, step, self.slot,
            self.most, self.chunks,
        )
        out = object.__new__(_Workspace)
        out.__dict__.update(self.__dict__)
        poses = step[: self.poses].reshape(-1, POSE)
        out.cameras = [c.moved(s[:3], s[3:]) for c, s in zip(self.cameras, poses, strict=True)]
        out.interiors = [_moved_interior(i, s) for i, s in zip(self.interiors, self._of_lenses(step), strict=True)]
        out.points = self.points + moved
        out._arrays()
        return out, float(np.abs(side @ step))

    def _of_lenses(self, values: Floats) -> Floats:
        """(I, 8) of values (T,) of the free parameters; zero where fixed."""
        return np.where(self.inside >= 0, values[self.inside], 0.0)

    def _check_poses(self, variance: Floats) -> None:
        """Raise BimVerifyError where a camera's ``variance`` (C, 6) says that its place is not determined."""
        position = np.sqrt(variance[:, 3:].max(axis=1))
        worst = int(np.argmax(position))
        if not position[worst] <= extent(self.problem)[1]:
            raise BimVerifyError(
                f"{self.cameras[worst].name} hangs on too few points: its position is uncertain by {position[worst]:.3g} m; "
                "leave it out, or give more observations."
            )

    def result(self, rounds: int, progress: Progress) -> BundleResult:
        progress.update(0.9, "Covariances")
        total, _, inverse, _ = self._normals(0.0)
        covariance = invert(total)
        self._check_poses(np.diag(covariance)[: self.poses].reshape(-1, POSE))
        weight = self.base * self.robust
        point_cov, taken = point_covariances(
            *self._seen, self.first, self.camera, self.pixel, weight, inverse, covariance, self.slot, self.most, self.chunks
        )
        shared = np.einsum("pii->p", point_cov - inverse) / 3.0
        left = self.left()
        groups = self._groups(left, taken, point_cov, covariance)
        redundancy = sum(g.observations for g in groups) - self.total - 3 * len(self.points)
        factor = sum(g.squares for g in groups) / redundancy if redundancy > 0 else float("nan")
        left_over = sum(g.squares / g.stretch**2 for g in groups)
        scale = max(left_over / redundancy, 1.0) if redundancy > 0 else 1.0
        blocks = covariance[: self.poses, : self.poses].reshape(len(self.cameras), POSE, len(self.cameras), POSE)
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
            interiors=tuple(self.interiors), points=self.points + self.centre, point_covariance=scale * point_cov,
            shared_sigma=np.sqrt(scale * np.maximum(shared, 0.0)),
            pose_covariance=scale * blocks[index, :, index, :],
            interior_sigma=np.sqrt(scale * self._of_lenses(np.diag(covariance))),
            variance_factor=factor, covariance_scale=scale, redundancy=redundancy, groups=groups, residual=unsorted,
            weight=kept, rounds=rounds,
        )

    def _groups(self, left: Floats, taken: Floats, point_cov: Floats, covariance: Floats) -> tuple[Group, ...]:
        used = self.robust > 0
        count = 2 * int(used.sum())
        squares = float((left[used] ** 2).sum(axis=1) @ (self.base * self.robust)[used])
        ties, controls = self.stretch
        groups = [Group(TIE_POINTS, count, count - float(taken.sum()), squares * ties**2, ties)]
        controlled = np.unique(self.problem.control.point)
        if len(controlled):
            count = 3 * len(self.problem.control.point)
            used_up = float(np.einsum("pij,pji->", self.known[controlled], point_cov[controlled]))
            groups.append(Group(CONTROL, count, count - used_up, self._control_squares() * controls**2, controls))
        at_poses = covariance[: self.poses, : self.poses]
        for term in self.terms:
            information, _, squares, count = term.normals(self.cameras)
            groups.append(Group(term.name, count, count - float(np.sum(information * at_poses)), squares))
        return tuple(groups)


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
