"""Where surfaces of different elements meet in a picture: lines that are an edge of neither.

A wall that runs through a ceiling has no edge at the ceiling, yet the line is there to see. Rays on a coarse grid find pairs of
planes that are neighbours in the picture; the line itself is their intersection, exact and not from the grid.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..model.elements import BuildingModel
from ..model.raycast import RayScene
from .camera import Camera
from .edge_bearers import LEAST_TURN, EdgeBearers, meeting_of

Vector = NDArray[np.float64]
Ints = NDArray[np.int64]
STEP_PX = 8.0
SAME_NORMAL, SAME_OFFSET_M = 1e-3, 2e-3
FEWEST = 5
"""Places on the grid that a line must be seen at."""
GAP_PX = 3.5 * STEP_PX
SAME_LINE_M, SAME_DIRECTION = 3e-3, 0.9999
NEAREST_M = 0.15


class MeetingEdges:
    """Planes of a model, to be looked at from any pose."""

    def __init__(self, model: BuildingModel, scene: RayScene) -> None:
        self._scene = scene
        corner = model.vertices[model.triangles[:, 0]]
        offset = np.einsum("ni,ni->n", scene.normal, corner)
        key = np.column_stack([np.round(scene.normal / SAME_NORMAL), np.round(offset / SAME_OFFSET_M)]).astype(np.int64)
        _, first, plane = np.unique(key, axis=0, return_index=True, return_inverse=True)
        self._plane: Ints = plane.ravel()
        self._normal, self._offset = scene.normal[first], offset[first]

    def look(self, camera: Camera, known: tuple[Vector, Vector], margin: float) -> tuple[Vector, Vector, EdgeBearers]:
        """Both ends (N, 3) of lines that are not among the ``known`` edges' ends, and the elements that meet there."""
        plane, ray, reach, triangle, shape = self._grid(camera, margin)
        at = np.arange(len(plane)).reshape(shape)
        pairs = np.concatenate([
            np.column_stack([at[:, :-1].ravel(), at[:, 1:].ravel()]), np.column_stack([at[:-1].ravel(), at[1:].ravel()]),
        ])
        first, second = pairs.T
        use = (plane[first] >= 0) & (plane[second] >= 0) & (plane[first] != plane[second])
        first, second = first[use], second[use]
        n1, n2 = self._normal[plane[first]], self._normal[plane[second]]
        use = np.abs(np.einsum("ni,ni->n", n1, n2)) < math.cos(LEAST_TURN)
        first, second, n1, n2 = first[use], second[use], n1[use], n2[use]
        if not len(first):
            return np.zeros((0, 3)), np.zeros((0, 3)), meeting_of(np.zeros((0, 2), np.int64), np.zeros((0, 2, 3)))
        across = np.cross(ray[first], ray[second])
        # the place common to both planes and to the plane of both rays
        system = np.stack([n1, n2, across], axis=1)
        right = np.column_stack([
            self._offset[plane[first]], self._offset[plane[second]], np.einsum("ni,i->n", across, camera.position),
        ])
        solvable = np.abs(np.linalg.det(system)) > 1e-9 * np.linalg.norm(across, axis=1)
        first, second, across = first[solvable], second[solvable], across[solvable]
        place = np.linalg.solve(system[solvable], right[solvable][:, :, None])[:, :, 0]
        to = place - camera.position
        between = (
            (np.einsum("ni,ni->n", np.cross(ray[first], to), across) >= 0)
            & (np.einsum("ni,ni->n", np.cross(to, ray[second]), across) >= 0)
            & (np.einsum("ni,ni->n", ray[first], to) > NEAREST_M)
        )
        distance = np.linalg.norm(to, axis=1)
        low, high = np.minimum(reach[first], reach[second]), np.maximum(reach[first], reach[second])
        between &= (distance > 0.9 * low) & (distance < 1.1 * high)
        return self._lines(camera, plane, first[between], second[between], place[between], triangle, known)

    def _grid(self, camera: Camera, margin: float) -> tuple[Ints, Vector, Vector, Ints, tuple[int, int]]:
        lens = camera.interior
        low, high = lens.ideal_frame + np.array([[-margin], [margin]])
        x, y = np.arange(low[0], high[0] + 1.0, STEP_PX), np.arange(low[1], high[1] + 1.0, STEP_PX)
        u, v = np.meshgrid(x, y)
        ray = np.column_stack([(u.ravel() - lens.cx) / lens.fx, (v.ravel() - lens.cy) / lens.fy, np.ones(u.size)])
        ray = ray @ camera.rotation
        ray /= np.linalg.norm(ray, axis=1, keepdims=True)
        reach, triangle = self._scene.first_hit(np.repeat(camera.position[None], len(ray), 0), ray)
        plane = np.where(triangle >= 0, self._plane[triangle], -1)
        return plane, ray, reach.astype(np.float64), triangle.astype(np.int64), (len(y), len(x))

    def _lines(
        self, camera: Camera, plane: Ints, first: Ints, second: Ints, place: Vector, triangle: Ints,
        known: tuple[Vector, Vector],
    ) -> tuple[Vector, Vector, EdgeBearers]:
        low, high = np.minimum(plane[first], plane[second]), np.maximum(plane[first], plane[second])
        pair, group = np.unique(np.column_stack([low, high]), axis=0, return_inverse=True)
        group = group.ravel()
        starts, ends, sides = [], [], []
        for k in np.flatnonzero(np.bincount(group, minlength=len(pair)) >= FEWEST):
            rows = np.flatnonzero(group == k)
            along = np.cross(self._normal[pair[k, 0]], self._normal[pair[k, 1]])
            rows = rows[np.argsort(place[rows] @ along, kind="stable")]
            pixel = camera.project(place[rows])
            breaks = np.flatnonzero(~(np.linalg.norm(np.diff(pixel, axis=0), axis=1) < GAP_PX))
            for i, j in zip(np.concatenate([[0], breaks + 1]), np.concatenate([breaks, [len(rows) - 1]]), strict=True):
                if j - i + 1 < FEWEST:
                    continue
                a, b = place[rows[i]], place[rows[j]]
                if not _among(a, b, known):
                    starts.append(a)
                    ends.append(b)
                    sides.append((triangle[first[rows[i]]], triangle[second[rows[i]]]))
        side = np.array(sides, dtype=np.int64).reshape(-1, 2)
        bearers = meeting_of(self._scene.element[side].astype(np.int64), self._scene.normal[side])
        return np.array(starts).reshape(-1, 3), np.array(ends).reshape(-1, 3), bearers


def _among(a: Vector, b: Vector, known: tuple[Vector, Vector]) -> bool:
    """Whether the middle of a line lies on a known edge of the same direction."""
    if not len(known[0]):
        return False
    along = known[1] - known[0]
    length = np.linalg.norm(along, axis=1)
    along = along / length[:, None]
    away = 0.5 * (a + b) - known[0]
    at = np.einsum("ni,ni->n", away, along)
    off = np.linalg.norm(away - at[:, None] * along, axis=1)
    parallel = np.abs(along @ (b - a)) > SAME_DIRECTION * np.linalg.norm(b - a)
    return bool((parallel & (off < SAME_LINE_M) & (at > -0.05) & (at < length + 0.05)).any())
