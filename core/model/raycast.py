"""Ray casting against the planned surface (Embree)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .elements import BuildingModel
from .embree import triangle_scene

RESTART_M = 2e-5
"""How far behind a hit the search for the next one starts, metres: surfaces closer together than this hide each other."""
RESTART_AGAIN_M = 2e-4
"""The same, where single precision met the same triangle again."""


@dataclass(frozen=True)
class Hits:
    """Hits along rays in order of distance, as columns: ``distance[k, i]`` is the k-th hit of ray i."""

    distance: NDArray[np.float32]
    """(K, N) metres; infinite where there is no such hit."""
    triangle: NDArray[np.int32]
    """(K, N) rows of ``model.triangles``; -1 where there is no such hit."""
    entering: NDArray[np.bool_]
    """(K, N) the ray meets the outer side (goes into the solid)."""


class RayScene:
    """All triangles of a model, ready for ray casting in its local frame."""

    def __init__(self, model: BuildingModel, shift: NDArray[np.float64] | None = None) -> None:
        """``shift`` (E, 3) [m] moves elements; a row of NaN leaves the element out."""
        corners = model.vertices[model.triangles]
        if shift is not None:
            moved = corners + shift[model.triangle_element][:, None, :]
            corners = np.where(np.isfinite(moved), moved, 1e6)
        self._corners = np.ascontiguousarray(corners, dtype=np.float32)
        self._scene, self._mesh = triangle_scene(self._corners)
        self._start = model.triangle_start
        self._alone: dict[int, Any] = {}
        a, b, c = (model.vertices[model.triangles[:, i]] for i in range(3))
        normal = np.cross(b - a, c - a)
        self.normal: NDArray[np.float64] = normal / np.linalg.norm(normal, axis=1, keepdims=True)
        self.element = model.triangle_element

    def first_hit(
        self, origin: NDArray[np.floating], direction: NDArray[np.floating], reach: NDArray[np.floating] | float = 1e6
    ) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        """Distance (N,) [m] and triangle (N,) of the first hit within ``reach``; inf and -1 where there is none.

        origin (N, 3) metres, direction (N, 3) unit vectors.
        """
        count = len(origin)
        if count == 0:
            return np.zeros(0, np.float32), np.zeros(0, np.int32)
        limit = np.broadcast_to(np.asarray(reach, dtype=np.float32), count).copy()
        out = self._scene.run(
            np.ascontiguousarray(origin, dtype=np.float32), np.ascontiguousarray(direction, dtype=np.float32),
            dists=limit, query="INTERSECT", output=True,
        )
        triangle = out["primID"].astype(np.int32)
        return np.where(triangle >= 0, out["tfar"], np.float32(np.inf)), triangle

    def leaves(
        self, element: NDArray[np.integer], origin: NDArray[np.floating], direction: NDArray[np.floating]
    ) -> NDArray[np.bool_]:
        """(N,) whether a ray's first meeting with ``element`` (N,), looked at alone, is from its inside.

        In the whole scene a ray meets only one of two faces that lie in each other, and may so miss where it entered.
        """
        out = np.zeros(len(element), dtype=np.bool_)
        order = np.argsort(element, kind="stable")
        for rows in np.split(order, np.flatnonzero(np.diff(element[order])) + 1):
            if not len(rows):
                continue
            one = int(element[rows[0]])
            first = self._scene_of(one).run(
                np.ascontiguousarray(origin[rows], dtype=np.float32),
                np.ascontiguousarray(direction[rows], dtype=np.float32), query="INTERSECT",
            )
            normal = self.normal[self._start[one] + np.maximum(first, 0)]
            out[rows] = (first >= 0) & (np.einsum("ij,ij->i", direction[rows], normal) > 0)
        return out

    def _scene_of(self, element: int) -> Any:
        """Embree's scene of one element alone, and its mesh, which must live as long."""
        if element not in self._alone:
            own = slice(self._start[element], self._start[element + 1])
            self._alone.setdefault(element, triangle_scene(self._corners[own]))  # the first thread's stays
        return self._alone[element][0]

    def all_hits(
        self,
        origin: NDArray[np.floating],
        direction: NDArray[np.floating],
        reach: NDArray[np.floating] | float,
        most: int = 8,
    ) -> Hits:
        """Up to ``most`` hits along each ray within ``reach`` metres."""
        count = len(origin)
        start = np.asarray(origin, dtype=np.float64)
        direction = np.asarray(direction, dtype=np.float64)
        limit = np.broadcast_to(np.asarray(reach, dtype=np.float64), count)
        distance = np.full((most, count), np.inf, dtype=np.float32)
        triangle = np.full((most, count), -1, dtype=np.int32)
        entering = np.zeros((most, count), dtype=np.bool_)
        alive = np.arange(count)
        gone = np.zeros(count)
        last = np.full(count, -1, dtype=np.int32)
        found = np.zeros(count, dtype=np.int64)
        for _ in range(2 * most):
            t, tri = self.first_hit(
                start[alive] + direction[alive] * gone[alive, None], direction[alive], limit[alive] - gone[alive]
            )
            hit = tri >= 0
            alive, t, tri = alive[hit], t[hit], tri[hit]
            if not len(alive):
                break
            again = tri == last[alive]
            fresh = alive[~again]
            rank = found[fresh]
            distance[rank, fresh] = gone[fresh] + t[~again]
            triangle[rank, fresh] = tri[~again]
            entering[rank, fresh] = np.einsum("ij,ij->i", direction[fresh], self.normal[tri[~again]]) < 0
            found[fresh] += 1
            last[alive] = tri
            gone[alive] += t + np.where(again, RESTART_AGAIN_M, RESTART_M)
            alive = alive[(gone[alive] < limit[alive]) & (found[alive] < most)]
            if not len(alive):
                break
        used = int(found.max(initial=0))
        return Hits(distance[:used], triangle[:used], entering[:used])
