"""Rigid transforms as 4x4 matrices, and a scan source seen through one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..scans.campaign import DropCount, ReturnBlock, ScanSource, Station

Matrix = NDArray[np.float64]
RIGID_TOLERANCE = 1e-6
"""Largest deviation of R^T R from the identity in a matrix that still counts as rigid (typed with 6 to 7 digits)."""


def rigid(matrix: object) -> Matrix:
    """The matrix as a (4, 4) array, after a check that it is a rotation and a translation.

    Raises BimVerifyError for another shape, a scale, a shear or a mirror.
    """
    transform = np.array(matrix, dtype=np.float64)
    if transform.shape != (4, 4) or not np.isfinite(transform).all():
        raise BimVerifyError("The transform is not a 4x4 matrix of finite numbers. Give one row by row.")
    turn = transform[:3, :3]
    skew = np.abs(turn.T @ turn - np.eye(3)).max()
    if skew > RIGID_TOLERANCE or np.linalg.det(turn) < 0 or np.abs(transform[3] - (0, 0, 0, 1)).max() > RIGID_TOLERANCE:
        raise BimVerifyError(
            "The transform is not rigid (it scales, shears or mirrors). Give a rotation and a translation in metres."
        )
    return transform


def from_parts(rotation: Matrix, translation: Matrix) -> Matrix:
    """(4, 4) from a (3, 3) rotation and a (3,) translation [m]."""
    transform = np.eye(4)
    transform[:3, :3] = rotation
    transform[:3, 3] = translation
    return transform


def translation(offset: Matrix) -> Matrix:
    """(4, 4) of a pure translation (3,) [m]."""
    return from_parts(np.eye(3), np.asarray(offset, dtype=np.float64))


def exp_about(twist: Matrix, center: Matrix) -> Matrix:
    """The motion (rx, ry, rz [rad], tx, ty, tz [m]) about ``center`` as a (4, 4) matrix.

    x -> R(rx, ry, rz) (x - center) + center + t, with R the exponential of the rotation vector. This is the motion that
    the covariance of an AlignmentRecord is about.
    """
    from scipy.spatial.transform import Rotation

    rotation = Rotation.from_rotvec(twist[:3]).as_matrix()
    return from_parts(rotation, center + twist[3:] - rotation @ center)


def log_about(transform: Matrix, center: Matrix) -> Matrix:
    """(6,) inverse of :func:`exp_about`."""
    from scipy.spatial.transform import Rotation

    turn = transform[:3, :3]
    shift = turn @ center + transform[:3, 3] - center
    return np.concatenate([Rotation.from_matrix(turn).as_rotvec(), shift])


def apply(transform: Matrix, points: Matrix) -> Matrix:
    """(N, 3) points through the transform."""
    return points @ transform[:3, :3].T + transform[:3, 3]


def rotate(transform: Matrix, vectors: Matrix) -> Matrix:
    """(N, 3) directions through the rotation of the transform."""
    return vectors @ transform[:3, :3].T


def inverse(transform: Matrix) -> Matrix:
    """(4, 4) inverse of a rigid transform."""
    turn = transform[:3, :3].T
    return from_parts(turn, -turn @ transform[:3, 3])


@dataclass(frozen=True)
class TransformedSource:
    """A scan source whose stations and returns come out in the target frame of ``transform``.

    Station positions and rotations, and the offsets of the returns, are transformed; everything else is the source's
    own.
    """

    source: ScanSource
    transform: Matrix
    """(4, 4) rigid, frame of ``source`` to the target frame, metres."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "transform", rigid(self.transform))

    @property
    def paths(self) -> tuple[str, ...]:
        return self.source.paths

    @property
    def stations(self) -> tuple[Station, ...]:
        turn = self.transform[:3, :3]
        return tuple(
            replace(s, position=turn @ s.position + self.transform[:3, 3], rotation=turn @ s.rotation)
            for s in self.source.stations
        )

    @property
    def point_count(self) -> int:
        return self.source.point_count

    @property
    def dropped(self) -> DropCount:
        return self.source.dropped

    def blocks(self, block_size: int = 262_144, *, attributes: bool = False) -> Iterator[ReturnBlock]:
        """Stream all returns of the source, offsets along the axes of the target frame."""
        turn = self.transform[:3, :3]
        for block in self.source.blocks(block_size, attributes=attributes):
            normal = None if block.normal is None else block.normal @ turn.T.astype(np.float32)
            yield replace(block, offsets=block.offsets @ turn.T, normal=normal)


def whole_transform(source: ScanSource) -> Matrix:
    """(4, 4) from the frame of what lies under all transforms to the frame that ``source`` comes out in."""
    total = np.eye(4)
    while isinstance(source, TransformedSource):
        total, source = total @ source.transform, source.source
    return total
