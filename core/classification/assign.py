"""Which planned surface did a return meet? Nearest along the normal, met from outside, across air."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..evidence.sightings import GRAZE
from ..model.elements import BuildingModel
from ..model.raycast import RayScene
from ..parallel import in_chunks
from .edges import EdgeSearch

AIR_M = 0.001
"""A surface closer than this behind the end of another solid touches it: there is no air through which it could be seen."""
MOST_HITS = 16
"""Surfaces looked at along the window of one ray."""
UNASSIGNED = -1


@dataclass(frozen=True)
class Assigned:
    """For each return its element and how far it lies from that element's surface."""

    element: NDArray[np.int32]
    """(N,) rows of ``model.elements``; UNASSIGNED where no surface is compatible."""
    deviation: NDArray[np.float32]
    """(N,) metres along the surface's outward normal; NaN where there is none."""


@dataclass(frozen=True)
class Window:
    """How far a return may lie from the surface that it belongs to. Metres."""

    reach: float
    """Along the normal: three standard deviations of plan, scanner and registration together."""
    buried: float
    """So much nearer must a surface be that is covered by another planned solid: only if that one is not there was it seen."""

    @staticmethod
    def of(level_sigma: float, sigma: float, registration_sigma: float) -> Window:
        """From the standard deviations of the planned surface (its level of accuracy), of a return, and of a station [m]."""
        measured = float(np.hypot(sigma, registration_sigma))
        return Window(3.0 * float(np.hypot(level_sigma, measured)), 3.0 * measured)


class Assigner:
    """The surfaces of a model, asked which of them returns lie on."""

    def __init__(self, model: BuildingModel, window: Window, shift: NDArray[np.float64] | None = None) -> None:
        """``shift`` (E, 3) [m] puts elements where they were found; a row of NaN leaves an element out."""
        self._scene = RayScene(model, shift)
        self._window = window
        self._closed = model.closed
        self._edges = EdgeSearch(model, window.reach, shift)

    def assign(self, station: NDArray[np.float64], offsets: NDArray[np.float64]) -> Assigned:
        """The elements of returns ``offsets`` (N, 3) of a station at ``station`` (3,). Metres, local frame."""
        element = np.full(len(offsets), UNASSIGNED, np.int32)
        deviation = np.full(len(offsets), np.nan, np.float32)

        def work(part: slice) -> None:
            ray = np.array(offsets[part], dtype=np.float64)
            point = station + ray
            ray /= np.maximum(np.linalg.norm(ray, axis=1, keepdims=True), 1e-9)
            self._along_rays(point, ray, element[part], deviation[part])
            rest = np.flatnonzero(element[part] == UNASSIGNED)
            found, away = self._edges.nearest(point[rest], ray[rest])
            element[part][rest], deviation[part][rest] = found, away

        in_chunks(len(offsets), work)
        return Assigned(element, deviation)

    def _along_rays(
        self, point: NDArray[np.float64], ray: NDArray[np.float64], element: NDArray[np.int32],
        deviation: NDArray[np.float32],
    ) -> None:
        back = self._window.reach / GRAZE
        hits = self._scene.all_hits(point - back * ray, ray, 2 * back, most=MOST_HITS)
        if len(hits.distance):
            _choose(
                ray, hits.distance, hits.triangle, hits.entering, self._scene.normal, self._scene.element, self._closed,
                back, self._window.reach, self._window.buried, element, deviation,
            )


@njit(cache=True, nogil=True)
def _choose(
    ray: NDArray[np.float64], distance: NDArray[np.float32], triangle: NDArray[np.int32], entering: NDArray[np.bool_],
    normal: NDArray[np.float64], owner: NDArray[np.int32], closed: NDArray[np.bool_], back: float, reach: float,
    buried: float, element: NDArray[np.int32], deviation: NDArray[np.float32],
) -> None:
    """Of the surfaces along each ray take the nearest; a buried one only if it is nearer by ``buried``."""
    for i in range(ray.shape[0]):
        best = reach
        inside = 0
        left = np.float64(-np.inf)
        for k in range(distance.shape[0]):
            t = triangle[k, i]
            if t < 0:
                break
            e = owner[t]
            along = np.float64(distance[k, i])
            slope = ray[i, 0] * normal[t, 0] + ray[i, 1] * normal[t, 1] + ray[i, 2] * normal[t, 2]
            if closed[e] and not entering[k, i]:
                inside = max(inside - 1, 0)
                left = along
                continue
            away = (back - along) * slope
            if not closed[e] and slope > 0:
                away = -away
            covered = inside > 0 or (along - left) * abs(slope) < AIR_M
            cost = abs(away) + (buried if covered else 0.0)
            if abs(away) <= reach and cost < best:
                best = cost
                element[i] = e
                deviation[i] = away
            if closed[e]:
                inside += 1
