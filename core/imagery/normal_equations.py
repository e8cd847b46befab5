"""Solving the normal equations of a bundle in their own memory."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from ..errors import BimVerifyError

Floats = NDArray[np.float64]


def solve(matrix: Floats, right: Floats) -> Floats:
    """The step (T,) of a positive definite ``matrix`` (T, T), which is used up. Raises BimVerifyError where it is none."""
    factor, scale = _factorised(matrix)
    found, _ = lapack.dpotrs(factor, right * scale, lower=1)
    return np.asarray(found * scale)


def invert(matrix: Floats) -> Floats:
    """The inverse (T, T) of a positive definite ``matrix``, in its place. Raises BimVerifyError where it is none."""
    factor, scale = _factorised(matrix)
    inverse, _ = lapack.dpotri(factor, lower=1, overwrite_c=1)
    for row in range(len(inverse)):
        inverse[row, row + 1 :] = inverse[row + 1 :, row]
    inverse *= scale[:, None]
    inverse *= scale
    return np.asarray(inverse)


def _factorised(matrix: Floats) -> tuple[Floats, Floats]:
    """The lower Cholesky factor (T, T) of the scaled ``matrix``, in its place, and the scale (T,)."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    matrix *= scale[:, None]
    matrix *= scale
    factor, failed = lapack.dpotrf(matrix.T, lower=1, overwrite_a=1)
    if failed:
        raise BimVerifyError(
            "A camera of the bundle, or a free parameter of its lens, hangs on too few points; leave it out, fix the "
            "parameter, or give more observations."
        )
    return factor, scale
