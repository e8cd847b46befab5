"""Evidence of dense photogrammetric points: no ray is known, so they say where something is, and never that nothing is.

Distances are taken along the planned surface's normal (eqs. 5.12 and 5.13 of Meyer 2023), points fuse without conflict
(eq. 5.19), and a point's standard deviation is that of the tie points around it, along the normal.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..errors import BimVerifyError
from ..model.on_element import ElementSurfaces
from ..sensing.presets import LOGISTIC, ZONE_SIGMAS, MassParameters, derive_kappa, derived_masses
from .gather import CLUSTER_FLOOR_M, CLUSTER_SIGMAS, CUT, LENGTH_SCALE, LOG_SCALE, NEAR_CUT, SMALLEST_UNKNOWN, SensorModel
from .masses import level_conversion, log_one_minus, ray_masses
from .sightings import FIRST_DENSE, NUMBERS_OF_BODY, RAYLESS, SEARCH_M, WIDER_SIGMAS, Sightings

Array = NDArray[np.float64]
AROUND = 8
"""Tie points whose covariances are averaged."""
NEIGHBOURS, PROBES = 12, 4000
SPACING_QUANTILE = 75.0
"""Of the local spacings: thinner parts of the cloud shall still be looked at without holes."""
FACING = 0.5
"""A point whose own normal is turned more than 60 degrees from the face's lies on another one."""
BYTES_PER_POINT = 120


@dataclass(frozen=True)
class TieAccuracy:
    """Tie points (M, 3) in the local frame and their covariances (M, 3, 3); metres."""

    tree: cKDTree
    covariance: Array

    @staticmethod
    def of(points: Array, covariance: Array) -> TieAccuracy:
        return TieAccuracy(cKDTree(points), covariance)

    def along(self, place: Array, normal: Array) -> Array:
        """(N,) standard deviation [m] along ``normal`` (N, 3) at ``place`` (N, 3), from the nearest tie points."""
        count = min(AROUND, len(self.covariance))
        away, row = self.tree.query(place, k=count)
        away, row = away.reshape(-1, count), row.reshape(-1, count)
        weight = 1.0 / np.maximum(away, 1e-3) ** 2
        weight /= weight.sum(axis=1, keepdims=True)
        variance = np.einsum("ni,nkij,nj->nk", normal, self.covariance[row], normal)
        return np.asarray(np.sqrt(np.maximum((weight * variance).sum(axis=1), 1e-10)))


class DensePoints:
    """Dense points of a block, in a grid, with the tie points' accuracy."""

    def __init__(
        self, points: Array, normal: NDArray[np.float32] | None, accuracy: TieAccuracy, body: int, sigma: float,
        fixed: MassParameters | None, memory_gb: float,
    ) -> None:
        """``points`` (N, 3) and unit ``normal`` (N, 3) in the local frame; ``sigma`` of a usual return of the campaign [m];
        ``body`` of the block; ``fixed`` a preset of masses. Raises BimVerifyError when they do not fit the memory."""
        if len(points) * BYTES_PER_POINT > 1e9 * memory_gb:
            raise BimVerifyError(
                f"{len(points):,} dense points need {len(points) * BYTES_PER_POINT / 1e9:.1f} GB; thin them, or give more "
                "by --memory-gb."
            )
        self.accuracy, self.body, self.sigma, self.fixed = accuracy, body, sigma, fixed
        self.spacing = _spacing(points)
        if self.spacing <= 0:
            raise BimVerifyError("The dense points lie on one place; give a cloud of the building.")
        self._radius = CUT * (self.spacing if fixed is None else math.sqrt(math.log(2.0) / fixed.kappa))
        self._low = points.min(axis=0) - self._radius
        self._size = max(2.0 * self._radius, float((points.max(axis=0) - self._low).max()) / 1e6)
        self._shape = np.floor((points.max(axis=0) - self._low) / self._size).astype(np.int64) + 1
        cell = np.floor((points - self._low) / self._size).astype(np.int64)
        key = (cell[:, 0] * self._shape[1] + cell[:, 1]) * self._shape[2] + cell[:, 2]
        order = np.lexsort((points[:, 2], points[:, 1], points[:, 0], key))
        self._key, self.points = key[order], np.ascontiguousarray(points[order])
        self._normal = np.zeros((0, 3), np.float32) if normal is None else np.ascontiguousarray(normal[order])

    def parameters(self, sigma: float, model_sigma: float) -> MassParameters:
        """What the masses of points of this ``sigma`` [m] are made with."""
        if self.fixed is not None:
            return self.fixed
        return derived_masses(sigma, model_sigma, self.spacing)

    def sight(
        self, sensor: SensorModel, sample: NDArray[np.int64], query: Array, normal: Array, element: NDArray[np.int32],
        triangle: NDArray[np.int32], shift: Array, surfaces: ElementSurfaces,
    ) -> Sightings:
        """Sightings of the dense points; arguments as in ``sightings.sight``."""
        sigma = self.accuracy.along(query, normal)
        total = np.hypot(sigma, sensor.model_sigma)
        fixed = self.fixed
        lam = LOGISTIC / total if fixed is None else np.full(len(query), fixed.lam)
        c = ZONE_SIGMAS * LOGISTIC if fixed is None else fixed.c
        kappa = derive_kappa(self.spacing) if fixed is None else fixed.kappa
        kept = np.ones(len(query)) if fixed is None else level_conversion(sigma, sensor.model_sigma)
        log_unk, nearest, deviation, spread, count = _look(
            np.ascontiguousarray(query), np.ascontiguousarray(normal), self.points, self._normal, self._key, self._low,
            self._size, self._shape, self._radius, NEAR_CUT * self.spacing, SEARCH_M, lam, c, kappa, kept, sigma,
        )
        row = np.flatnonzero(nearest >= 0)
        point, n, q = self.points[nearest[row]], normal[row], query[row]
        level = np.einsum("ij,ij->i", point - q, n)
        face = surfaces.face_at(point - level[:, None] * n - shift[row], n, element[row], triangle[row], 0.005)
        on_face = face >= 0
        n_face = surfaces.normal[face]
        residual = np.einsum("ij,ij->i", point - shift[row] - surfaces.corner[face, 0], n_face)
        own = np.hypot(sigma[row], spread[row] / np.sqrt(count[row]))
        zero = np.zeros(len(row))
        return Sightings(
            sample=sample[row].astype(np.int32), station=np.full(len(row), RAYLESS, np.int16), deviation=deviation[row],
            count=np.ones(len(row), np.int32), cosine=np.ones(len(row), np.float32), distance=np.ones(len(row), np.float32),
            point=point.astype(np.float32), log_masses=np.column_stack([zero, log_unk[row], log_unk[row]]), on_face=on_face,
            face_normal=np.where(on_face[:, None], n_face, n).astype(np.float32), residual=np.where(on_face, residual, level),
            explained=np.zeros(len(row), np.bool_), glass=np.ones(len(row), np.bool_),
            photo=np.column_stack([
                own, sigma[row], WIDER_SIGMAS * np.maximum(sigma[row] - self.sigma, 0.0),
                self.body * NUMBERS_OF_BODY + FIRST_DENSE + nearest[row],
            ]),
        )


def _spacing(points: Array) -> float:
    """Distance between neighbouring points on the surface, metres."""
    if len(points) <= NEIGHBOURS:
        raise BimVerifyError(f"There are only {len(points)} dense points; give the whole cloud.")
    order = np.lexsort((points[:, 2], points[:, 1], points[:, 0]))
    probe = points[order[:: max(len(points) // PROBES, 1)]]
    away = cKDTree(points).query(probe, k=NEIGHBOURS + 1)[0][:, -1]
    return float(np.percentile(away, SPACING_QUANTILE)) * math.sqrt(math.pi / NEIGHBOURS)


@njit(cache=True, nogil=True, parallel=True)
def _look(
    query: Array, normal: Array, points: Array, facing: NDArray[np.float32], key: NDArray[np.int64], low: Array, size: float,
    shape: NDArray[np.int64], radius: float, near: float, reach: float, lam: Array, c: float, kappa: float, kept: Array,
    sigma: Array,
) -> tuple[Array, NDArray[np.int64], Array, Array, NDArray[np.int64]]:
    """Per query: sum of log(1 - m_occ); the point, mean, and spread along the normal of the layer that lies nearest to the
    planned surface within ``near`` across and ``reach`` along; its number of points."""
    total = len(query)
    log_unk, nearest = np.zeros(total), np.full(total, -1, np.int64)
    deviation, spread, count = np.full(total, np.nan), np.zeros(total), np.zeros(total, np.int64)
    wide = max(radius, near)
    for i in prange(total):
        q, n = query[i], normal[i]
        bottom, top = np.empty(3, np.int64), np.empty(3, np.int64)
        outside = False
        for a in range(3):
            half = reach * abs(n[a]) + wide * math.sqrt(max(1.0 - n[a] * n[a], 0.0))
            bottom[a] = max(int(np.floor((q[a] - half - low[a]) / size)), 0)
            top[a] = min(int(np.floor((q[a] + half - low[a]) / size)), shape[a] - 1)
            outside |= bottom[a] > top[a]
        if outside:
            continue
        level, best2, best, sums = np.inf, np.inf, -1, 0
        for turn in range(2):
            gate = max(CLUSTER_SIGMAS * sigma[i], CLUSTER_FLOOR_M)
            number, mean, square = 0, 0, 0.0
            for x in range(bottom[0], top[0] + 1):
                for y in range(bottom[1], top[1] + 1):
                    line = (x * shape[1] + y) * shape[2]
                    for j in range(np.searchsorted(key, line + bottom[2]), len(key)):
                        if key[j] > line + top[2]:
                            break
                        dx, dy, dz = points[j, 0] - q[0], points[j, 1] - q[1], points[j, 2] - q[2]
                        t = dx * n[0] + dy * n[1] + dz * n[2]
                        across2 = max(dx * dx + dy * dy + dz * dz - t * t, 0.0)
                        if abs(t) > reach or across2 > wide * wide:
                            continue
                        if len(facing) and facing[j, 0] * n[0] + facing[j, 1] * n[1] + facing[j, 2] * n[2] < FACING:
                            continue
                        if turn == 0:
                            if across2 <= near * near and abs(t) < abs(level):
                                level = t
                            if across2 <= radius * radius:
                                occ = kept[i] * ray_masses(t, across2, c, lam[i], kappa)[0]
                                sums += int(log_one_minus(min(occ, 1.0 - SMALLEST_UNKNOWN)) * LOG_SCALE)
                        elif across2 <= near * near and abs(t - level) <= gate:
                            number += 1
                            mean += int(t * LENGTH_SCALE)
                            square += (t - level) * (t - level)
                            if across2 < best2:
                                best2, best = across2, j
            if turn == 0:
                if not np.isfinite(level):
                    break
            else:
                middle = mean / LENGTH_SCALE / number
                nearest[i], deviation[i], count[i] = best, middle, number
                spread[i] = math.sqrt(max(square / number - (middle - level) ** 2, 0.0))
        log_unk[i] = sums / LOG_SCALE
    return log_unk, nearest, deviation, spread, count
