"""Lines that are taken for the wrong edge and pass every test, because they lie within the tolerance of the search."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
SEARCH_WIDTH = 0.002
"""Tolerance of a hypothesis built on few matches, share of the image's width."""
MISTAKEN = 0.1
"""Share of the matches that are wrong and pass their tests: lines of something else within the tolerance, as found in photos of
two buildings whose truth is known."""


def mistaken_px(width: int) -> float:
    """Root mean square of what such matches put a line off as a whole [px], over all lines of an image ``width`` [px] wide."""
    return math.sqrt(MISTAKEN / 3.0) * SEARCH_WIDTH * width


def spread_without_each(covariance: Vector, design: Vector, weight: Vector, value: Vector) -> Vector:
    """What is added to a pose's ``covariance`` (P, P) because each match may be wrong, and the pose then is the one without it.

    With the probability ``MISTAKEN`` for each: the square of how far the pose goes when the match is left out, and what its
    covariance grows by then. ``design`` (2N, P), ``weight`` (2N, 2N) and ``value`` (2N,) are those of the adjusted distances. A
    match is left out by a shift of its own on its two distances, which needs no second adjustment.
    """
    count, size = len(value) // 2, len(covariance)
    pull = (weight @ design @ covariance).reshape(count, 2, size)
    weighted = (weight @ value).reshape(count, 2)
    rows = np.arange(count)
    projector = weight - weight @ design @ covariance @ design.T @ weight
    shift = np.linalg.pinv(projector.reshape(count, 2, count, 2)[rows, :, rows, :], hermitian=True)
    away = np.einsum("nip,nij,nj->np", pull, shift, weighted)
    grown = np.einsum("nip,nij,njq->pq", pull, shift, pull)
    return np.asarray(MISTAKEN * (away.T @ away + grown))
