"""Means of returns over small pieces of an element's faces: the observations that shifts and errors are estimated from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .sightings import Sightings

Array = NDArray[np.float64]

BLOCK_M = 0.25
"""Edge of a block: small beside the unevenness of walls and slabs, large beside the spacing of usual scans."""
MOST_BLOCKS = 800
"""Larger elements get larger blocks, so that pairs of blocks stay countable."""
PRIOR_RETURNS = 4.0
"""Returns' worth of the sensor's stated sigma that the scatter of the returns is averaged with."""


@dataclass(frozen=True)
class Blocks:
    """Means of the returns that fall into one block of one face, seen from one station."""

    residual: Array
    """(B,) metres."""
    normal: Array
    """(B, 3)"""
    point: Array
    """(B, 3) metres, local frame."""
    station: NDArray[np.int64]
    variance: Array
    """(B,) of the mean, from the returns' own scatter, m2."""
    count: Array
    """(B,) returns."""
    face: NDArray[np.int64]
    """(B,) number of the face direction."""
    cell: NDArray[np.int64]
    """(B,) number of the piece of surface: the same for blocks of several stations that cover it."""

    def __len__(self) -> int:
        return len(self.residual)


def block_means(sightings: Sightings, sigma: float, body: NDArray[np.int64]) -> Blocks:
    """Blocks per face direction and station of one element; a return seen from several queries counts once.

    ``sigma`` [m] is what the sensor should do; the scatter of the returns about their blocks' means outweighs it. ``body``
    (S + 1,) see ``ErrorModel``: a block's cameras count as one station.
    """
    point = sightings.point.astype(np.float64)
    normal = sightings.face_normal.astype(np.float64)
    station = body[sightings.station]
    once = np.unique(sightings.ray_key(slice(None)), return_index=True)[1]
    point, normal, station, residual = point[once], normal[once], station[once], sightings.residual[once]
    direction = np.round(normal * 3).astype(np.int64)
    size = BLOCK_M
    while True:
        cell = np.floor(point / size).astype(np.int64)
        first, block, count = np.unique(
            row_numbers(np.column_stack([direction, cell, station])),
            return_index=True, return_inverse=True, return_counts=True,
        )[1:]
        if len(count) <= MOST_BLOCKS:
            break
        size *= 1.5
    mean = np.bincount(block, residual) / count
    facing = np.column_stack([np.bincount(block, normal[:, k]).astype(np.float64) for k in range(3)])
    facing /= np.linalg.norm(facing, axis=1, keepdims=True)
    apart = residual - mean[block]
    freedom = max(len(residual) - len(count), 0)
    pooled2 = (sigma**2 * PRIOR_RETURNS + float((apart**2).sum())) / (PRIOR_RETURNS + freedom)
    place = np.column_stack([np.bincount(block, point[:, k]) / count for k in range(3)])
    return Blocks(
        mean, facing, place, station[first], pooled2 / count, count.astype(np.float64),
        np.unique(row_numbers(direction[first]), return_inverse=True)[1],
        np.unique(row_numbers(np.column_stack([direction, cell])[first]), return_inverse=True)[1],
    )


def row_numbers(rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """(N,) a number for each of ``rows`` (N, K): equal for equal rows, in their order. Sorts far faster than the rows."""
    low = rows.min(axis=0)
    number = np.zeros(len(rows), np.int64)
    span = 1
    for column, least, extent in zip(rows.T, low, (rows.max(axis=0) - low + 1).tolist(), strict=True):
        span *= extent
        if span > np.iinfo(np.int64).max:
            return np.unique(rows, axis=0, return_inverse=True)[1].ravel()
        number = number * extent + (column - least)
    return number
