"""A pose from lines whose edges share the errors of their elements.

A wall that stands 3 mm off takes all of its edges with it, so twenty edges of one element are no twenty independent
observations. All edges that an element bears share its displacement, and each has a part of its own on top; the contradictions
of the Gauss-Helmert model then have a full covariance matrix, and the pose follows by generalised least squares.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from .camera import Camera, rotation_vector
from .edge_bearers import EdgeBearers, element_design
from .line_pose import PoseEstimate, PosePrior
from .mistaken_lines import spread_without_each
from .uncertain_lines import LineMatches, homogeneous

Vector = NDArray[np.float64]
OWN = 0.2
"""Variance of an edge for itself, on top of its elements', as a share of theirs: mostly an element stands off, less so are its
edges bent. How the two divide is not known beforehand; all of the level's variance is taken as shared, the part that does not
average out."""
MOST_ROUNDS = 20
LEAST_DEPTH_M = 1e-3


def estimate_with_elements(
    matches: LineMatches, bearers: EdgeBearers, start: Camera, model_sigma: float, *, prior: PosePrior, at: Camera,
    focal: bool = False, mistaken_px: float = 0.0,
) -> PoseEstimate:
    """The pose near ``start``; ``bearers`` say which matches share an error, ``at`` is the coarse pose.

    The edges' covariances in ``matches`` are not used: ``model_sigma`` [m] per axis stands for them. ``mistaken_px`` is the
    root mean square of what wrong matches that no test shows put a line off as a whole; with it the covariance also counts
    how far the pose hangs on single matches. Raises BimVerifyError when it does not
    settle.
    """
    camera = start
    information = np.diag([prior.rotation_sigma**-2] * 3 + [prior.position_sigma**-2] * 3 + [0.0] * int(focal))
    for _ in range(MOST_ROUNDS):
        value, design, cov = _contradictions(matches, camera, bearers, model_sigma, focal, mistaken_px)
        weighted = np.linalg.solve(cov, np.column_stack([design, value]))
        away = np.concatenate([
            rotation_vector(at.rotation @ camera.rotation.T), at.position - camera.position, np.zeros(int(focal)),
        ])
        covariance = np.linalg.inv(design.T @ weighted[:, :-1] + information)
        step = covariance @ (information @ away - design.T @ weighted[:, -1])
        camera = _moved(camera, step)
        if np.all(np.abs(step) <= 1e-3 * np.sqrt(np.diag(covariance))):
            break
    else:
        raise BimVerifyError(f"{start.name}: the pose does not settle; check the coarse pose and the matched lines.")
    value, design, cov = _contradictions(matches, camera, bearers, model_sigma, focal, mistaken_px)
    redundancy = len(value) - design.shape[1]
    factor = float(value @ np.linalg.solve(cov, value)) / max(redundancy, 1)
    own = cov - design @ covariance @ design.T
    rows = np.arange(len(matches))
    blocks = own.reshape(len(matches), 2, len(matches), 2)[rows, :, rows, :]
    pairs = value.reshape(-1, 2)
    if_right = covariance[:6, :6]
    if mistaken_px > 0.0:
        covariance = covariance + spread_without_each(covariance, design, np.linalg.inv(cov), value)
    test = np.einsum("nk,nkl,nl->n", pairs, np.linalg.pinv(blocks, hermitian=True), pairs)
    spread = float(np.sqrt(covariance[6, 6])) * camera.interior.fx if focal else None
    return PoseEstimate(camera, covariance[:6, :6], factor, redundancy, test, spread, if_right)


def _moved(camera: Camera, step: Vector) -> Camera:
    moved = camera.moved(step[:3], step[3:6])
    if len(step) == 6:
        return moved
    return replace(moved, interior=moved.interior.scaled(1.0 + float(step[6])))


def _contradictions(
    matches: LineMatches, camera: Camera, bearers: EdgeBearers, model_sigma: float, focal: bool,
    mistaken_px: float,
) -> tuple[Vector, Vector, Vector]:
    """Distances (2N,) [px] of the projected ends from their lines, derivatives (2N, 6 or 7), covariance (2N, 2N)."""
    value, design, to_point, own = line_distances(matches, camera, model_sigma, focal)
    return value, design, joint_covariance(to_point, own + mistaken_px**2, bearers, model_sigma)


def joint_covariance(to_point: Vector, own: Vector, bearers: EdgeBearers, model_sigma: float) -> Vector:
    """(2N, 2N) of distances: what each match has of its ``own`` (N, 2, 2), and what the displacements of its bearers add.

    ``to_point`` (2N, 3) are the distances' derivatives with respect to the edge's ends.
    """
    count = len(own)
    by_element = element_design(bearers, to_point)
    cov = model_sigma**2 * by_element @ by_element.T
    blocks = cov.reshape(count, 2, count, 2)
    rows = np.arange(count)
    blocks[rows, :, rows, :] += own
    return np.asarray(blocks.reshape(2 * count, 2 * count))


def line_distances(
    matches: LineMatches, camera: Camera, model_sigma: float, focal: bool
) -> tuple[Vector, Vector, Vector, Vector]:
    """Distances (2N,) [px] of the projected ends from their lines, their derivatives with respect to the pose (2N, 6; with
    the relative focal length 7) and to the ends (2N, 3), and each match's own covariance (N, 2, 2)."""
    count, lens = len(matches), camera.interior
    normal = np.repeat(matches.line[:, :2], 2, axis=0)
    ends = np.stack([matches.start, matches.end], axis=1).reshape(-1, 3)
    q = camera.in_camera(ends)
    q[:, 2] = np.maximum(q[:, 2], LEAST_DEPTH_M)
    pixel = np.column_stack([lens.fx * q[:, 0] / q[:, 2] + lens.cx, lens.fy * q[:, 1] / q[:, 2] + lens.cy])
    scale = np.hypot(*matches.line[:, :2].T).repeat(2)
    value = (np.einsum("ni,ni->n", normal, pixel) + matches.line[:, 2].repeat(2)) / scale
    normal = normal / scale[:, None]
    flat = normal * [lens.fx, lens.fy] / q[:, 2:]
    to_q = np.column_stack([flat, -np.einsum("ni,ni->n", flat, q[:, :2]) / q[:, 2]])
    to_point = to_q @ camera.rotation
    columns = [np.cross(q, to_q), -to_point]
    if focal:
        columns.append(np.einsum("ni,ni->n", normal, pixel - [lens.cx, lens.cy])[:, None])
    design = np.column_stack(columns)
    at = homogeneous(pixel).reshape(count, 2, 3) / scale.reshape(count, 2, 1)
    image = at @ matches.line_cov @ at.transpose(0, 2, 1)
    own = OWN * model_sigma**2 * np.einsum("ni,ni->n", to_point, to_point).reshape(count, 2)
    image[:, [0, 1], [0, 1]] += own + 1e-6
    return value, design, to_point, image
