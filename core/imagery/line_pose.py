"""A camera's pose from lines matched with edges of the model, with its covariance.

Two parametrisations: the twelve elements of the projection matrix (Meyer et al. 2021; the interior orientation is estimated
with the pose), and the calibrated pose with six parameters, optionally with the focal length.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from .camera import Camera, rotation_vector
from .gauss_helmert import Adjustment, Observations, Parametrisation, adjust
from .uncertain_lines import LineMatches, conditioning, homogeneous, normalise, pad

Vector = NDArray[np.float64]
FEWEST_LINES = 3
FEWEST_LINES_PROJECTIVE = 6


@dataclass(frozen=True)
class PoseEstimate:
    """A camera as the lines have it.

    ``covariance`` (6, 6) of the rotation in the camera frame [rad] and the position in the world [m], scaled by no variance
    factor. ``test`` (N,) chi-square with two degrees for each match; ``focal_sigma`` [px] when the focal length was free.
    ``if_right`` (6, 6) is the covariance if no match is wrong, where that is another one.
    """

    camera: Camera
    covariance: Vector
    variance_factor: float
    redundancy: int
    test: Vector
    focal_sigma: float | None = None
    if_right: Vector | None = None

    @property
    def scaled_covariance(self) -> Vector:
        """(6, 6) ``covariance``, scaled up where the fit is worse than stated."""
        return np.asarray(self.covariance * max(self.variance_factor, 1.0))


@dataclass(frozen=True)
class PosePrior:
    """What is known of the pose beforehand: standard deviations of the rotation [rad] and the position [m]."""

    rotation_sigma: float
    position_sigma: float


@dataclass(frozen=True)
class _Conditioned:
    observations: Observations
    image: Vector
    """T2D (3, 3) of image points; lines are conditioned by its inverse transposed."""
    model: Vector
    """T3D (4, 4)."""


def estimate_calibrated(
    matches: LineMatches, start: Camera, *, focal: bool = False, prior: PosePrior | None = None,
    at: Camera | None = None, weight: Vector | None = None,
) -> PoseEstimate:
    """The pose of a camera whose interior orientation is known, from at least three lines.

    ``start`` is a coarse pose; lines are in ideal pixels (distortion taken out). ``prior`` adds the pose ``at`` (``start`` if
    not given) as an observation. Raises BimVerifyError when there are too few lines or they do not fix the pose.
    """
    if len(matches) < FEWEST_LINES and prior is None:
        raise BimVerifyError(f"{start.name}: {len(matches)} matched lines do not fix a pose; {FEWEST_LINES} are needed.")
    given = _condition(matches)
    back = np.linalg.inv(given.model)
    expected = at or start

    def matrix(state: object) -> Vector:
        return np.asarray(given.image @ _camera(state).matrix @ back)

    def jacobian(state: object) -> Vector:
        return _calibrated_jacobian(_camera(state), given.image, back, focal)

    def step(state: object, change: Vector) -> Camera:
        camera = _camera(state).moved(change[:3], change[3:6])
        if not focal:
            return camera
        return replace(camera, interior=camera.interior.scaled(1.0 + float(change[6])))

    def known(state: object) -> tuple[Vector, Vector]:
        assert prior is not None
        camera = _camera(state)
        away = np.concatenate(
            [rotation_vector(expected.rotation @ camera.rotation.T), expected.position - camera.position, np.zeros(int(focal))]
        )
        information = np.zeros(6 + int(focal))
        information[:3], information[3:6] = prior.rotation_sigma**-2, prior.position_sigma**-2
        return np.diag(information), information * away

    found = adjust(
        given.observations, start, Parametrisation(matrix, jacobian, step, prior=known if prior else None), weight
    )
    camera = _camera(found.state)
    covariance = found.covariance
    spread = None
    if focal:
        spread = float(np.sqrt(covariance[6, 6])) * camera.interior.fx
    return _estimate(camera, covariance[:6, :6], found, spread)


def estimate_projective(matches: LineMatches, start: Camera, *, weight: Vector | None = None) -> PoseEstimate:
    """The twelve-element projection matrix from at least six lines, and the pose that it means.

    The interior orientation of the result is what the matrix says: principal distance, principal point and (not kept)
    shear. Raises BimVerifyError when there are too few lines or they do not fix the matrix.
    """
    if len(matches) < FEWEST_LINES_PROJECTIVE:
        raise BimVerifyError(
            f"{start.name}: {len(matches)} matched lines do not fix a projection matrix; at least "
            f"{FEWEST_LINES_PROJECTIVE} are needed."
        )
    given = _condition(matches)
    initial = (given.image @ start.matrix @ np.linalg.inv(given.model)).reshape(12)

    def step(state: object, change: Vector) -> Vector:
        moved = np.asarray(state) + change
        return np.asarray(moved / np.linalg.norm(moved))

    def unit_length(state: object) -> tuple[Vector, Vector]:
        p = np.asarray(state)
        return 2.0 * p[:, None], np.array([float(p @ p) - 1.0])

    parameters = Parametrisation(
        matrix=lambda state: np.asarray(state).reshape(3, 4),
        jacobian=lambda state: np.eye(12),
        step=step,
        constraint=unit_length,
    )
    found = adjust(given.observations, initial / np.linalg.norm(initial), parameters, weight)
    conditioned = np.asarray(found.state).reshape(3, 4)
    back = np.linalg.inv(given.image)
    camera = decompose(back @ conditioned @ given.model, start)
    return _estimate(camera, _pose_covariance(found, back, given.model, start, camera), found, None)


def decompose(matrix: Vector, like: Camera) -> Camera:
    """The camera of a projection matrix (3, 4): P = [A | a], X0 = -A^-1 a, A = K R with a positive principal distance."""
    from scipy.linalg import rq

    left = matrix[:, :3]
    position = -np.linalg.solve(left, matrix[:, 3])
    left = left * np.sign(np.linalg.det(left))
    upper, turn = rq(left)
    signs = np.diag(np.sign(np.diag(upper)))
    upper, turn = upper @ signs, signs @ turn
    upper = upper / upper[2, 2]
    inside = replace(
        like.interior, fx=float(upper[0, 0]), fy=float(upper[1, 1]), cx=float(upper[0, 2]), cy=float(upper[1, 2])
    )
    return replace(like, interior=inside, rotation=np.asarray(turn), position=np.asarray(position))


def pose_difference(camera: Camera, reference: Camera) -> Vector:
    """(6,) how far ``camera`` is turned [rad, camera frame] and shifted [m, world] against ``reference``."""
    turn = rotation_vector(camera.rotation @ reference.rotation.T)
    return np.concatenate([turn, camera.position - reference.position])


def _camera(state: object) -> Camera:
    assert isinstance(state, Camera)
    return state


def _estimate(camera: Camera, covariance: Vector, found: Adjustment, focal_sigma: float | None) -> PoseEstimate:
    return PoseEstimate(camera, covariance, found.variance_factor, found.redundancy, found.test, focal_sigma)


def _condition(matches: LineMatches) -> _Conditioned:
    """Entities near the origin and of size one: the image by where its lines lie, the model by its edges' ends."""
    a, b, c = matches.line.T
    feet = np.column_stack([-a * c, -b * c]) / (a * a + b * b)[:, None]
    image = conditioning(feet)
    model = conditioning(np.concatenate([matches.start, matches.end]))
    to_lines = np.linalg.inv(image).T
    line, line_cov = normalise(matches.line @ to_lines.T, to_lines @ matches.line_cov @ to_lines.T)
    ends = [
        normalise(homogeneous(points) @ model.T, model @ pad(cov) @ model.T)
        for points, cov in ((matches.start, matches.start_cov), (matches.end, matches.end_cov))
    ]
    return _Conditioned(Observations(line, ends[0][0], ends[1][0], line_cov, ends[0][1], ends[1][1]), image, model)


def _calibrated_jacobian(camera: Camera, image: Vector, back: Vector, focal: bool) -> Vector:
    """d vec(T2D P T3D^-1) / d (rotation, position[, relative focal length]), (12, 6 or 7)."""
    inside, turn = camera.interior.matrix, camera.rotation
    pose = np.column_stack([turn, -turn @ camera.position])
    columns = []
    for axis in range(3):
        generator = np.cross(np.eye(3)[axis], np.eye(3)).T
        columns.append(image @ inside @ generator @ pose @ back)
    for axis in range(3):
        shift = np.zeros((3, 4))
        shift[:, 3] = -turn[:, axis]
        columns.append(image @ inside @ shift @ back)
    if focal:
        stretch = np.diag([camera.interior.fx, camera.interior.fy, 0.0])
        columns.append(image @ stretch @ pose @ back)
    return np.column_stack([column.reshape(12) for column in columns])


def _pose_covariance(found: Adjustment, back: Vector, model: Vector, like: Camera, camera: Camera) -> Vector:
    """Covariance (6, 6) of the pose by central differences of the decomposition, along the principal axes of that of P."""
    values, axes = np.linalg.eigh(found.covariance)
    state = np.asarray(found.state)
    out = np.zeros((6, 6))
    for value, axis in zip(values, axes.T, strict=True):
        if value <= 1e-24:
            continue
        size = 1e-3 * np.sqrt(value)
        ends = [decompose(back @ (state + s * size * axis).reshape(3, 4) @ model, like) for s in (1.0, -1.0)]
        slope = (pose_difference(ends[0], camera) - pose_difference(ends[1], camera)) / 2e-3
        out += np.outer(slope, slope)
    return out
