"""What the returns of a simulated campaign can prove about each element's planned surface."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.elements import BuildingModel
from ..model.on_element import ElementSurfaces, plane_crossing
from ..scans.campaign import Grid
from .scanner import Scanner, SimulatedReturns
from .scene import Edit, Scene, build_scene

POINTS_PER_ELEMENT = 4000
FACING_COS = 0.02
STEEPEST_COS = 0.17
"""A beam that meets the planned surface at more than 80 degrees from its normal proves nothing about it."""
SIGHT_TOLERANCE_M = 0.003
"""A planned point counts as in sight when the beam ends no more than this before it."""
RETURN_TOLERANCE_M = 0.01
"""A return this close to the planned point is at it; from there on it is before it or beyond it."""
ON_FACE_M = 0.005
MOST_SURFACES = 16
RESTART_M = 1e-4


@dataclass(frozen=True)
class StationView:
    """What came back in every direction that a station shot."""

    position: NDArray[np.float64]
    rotation: NDArray[np.float64]
    distance: NDArray[np.float32]
    """(rows, columns) metres; 0 where nothing came back."""
    owner: NDArray[np.int32]
    """(rows, columns) rows of ``scene.names``; -1 where nothing came back."""

    @classmethod
    def empty(cls, position: NDArray[np.float64], rotation: NDArray[np.float64], grid: Grid) -> StationView:
        """A view in which nothing came back yet."""
        shape = (grid.rows, grid.columns)
        return cls(position, rotation, np.zeros(shape, np.float32), np.full(shape, -1, np.int32))

    def record(self, returns: SimulatedReturns) -> None:
        """Enter returns."""
        self.distance[returns.row, returns.column] = np.linalg.norm(returns.offset, axis=1)
        self.owner[returns.row, returns.column] = returns.owner


@dataclass(frozen=True)
class _Points:
    """Area-weighted points on the planned surfaces."""

    position: NDArray[np.float64]
    normal: NDArray[np.float64]
    element: NDArray[np.int32]
    triangle: NDArray[np.int64]


class Witness:
    """Judges points on every planned surface, station by station, against the scene as it was built and the returns.

    What an element was built as never hides its own planned surface: a wall built closer to the scanner shows that it
    was moved. A removed element has no body that could hide anything. A return from behind a pane says nothing about
    the pane, a beam that passes beside a slender element nothing about the element, and a return from another thing at the
    very place of an element nothing about whether that element is gone.
    """

    def __init__(self, model: BuildingModel, scene: Scene, edits: Mapping[int, Edit], scanner: Scanner) -> None:
        self._scene, self._scanner = scene, scanner
        self._surfaces = ElementSurfaces(model)
        self._planned = build_scene(model, {}, ())
        self._points = _planned_points(model)
        self._stands = np.ones(len(model.elements), dtype=np.bool_)
        self._stands[[row for row, edit in edits.items() if edit.kind == "remove"]] = False
        self._edited = np.zeros(len(model.elements), dtype=np.bool_)
        self._edited[list(edits)] = True
        self._sheet = ~model.closed  # both sides of an open sheet are one surface: seen from either, it is seen
        pane = scene.pane_of_model if scene.pane_of_model is not None else np.zeros(len(model.triangles), np.bool_)
        self._pane = pane[self._points.triangle] & self._stands[self._points.element]
        self._seen = np.zeros(len(self._points.element), dtype=np.bool_)
        self._proven = np.zeros(len(self._points.element), dtype=np.bool_)

    def add(self, view: StationView) -> None:
        """Count what one station saw."""
        points = self._points
        ray = points.position - view.position
        distance = np.linalg.norm(ray, axis=1)
        ray /= np.maximum(distance, 1e-9)[:, None]
        facing = -np.einsum("ij,ij->i", ray, points.normal)
        facing = np.where(self._sheet[points.element], np.abs(facing), facing)
        at = np.flatnonzero(facing > FACING_COS)
        at = at[~_hidden(self._scene, view.position, ray[at], distance[at], points.element[at], by_others=True)]
        own_front = self._stands[points.element[at]]
        own_front[own_front] = _hidden(
            self._planned, view.position, *(v[at[own_front]] for v in (ray, distance, points.element)), by_others=False
        )
        at = at[~own_front]
        self._seen[at] = True
        at = at[facing[at] > STEEPEST_COS]
        row, column = self._scanner.cell(ray[at] @ view.rotation)
        measured, owner = view.distance[row, column], view.owner[row, column]
        tolerance = np.where(self._edited[points.element[at]], RETURN_TOLERANCE_M, -RETURN_TOLERANCE_M)
        beyond = (measured > distance[at] + tolerance) & ~self._pane[at]
        beyond[beyond] = self._crosses(view, row[beyond], column[beyond], at[beyond])
        self._proven[at] |= (row >= 0) & (owner >= 0) & (beyond | (owner == points.element[at]))

    def _crosses(
        self, view: StationView, row: NDArray[np.int64], column: NDArray[np.int64], at: NDArray[np.int64]
    ) -> NDArray[np.bool_]:
        """(N,) whether the beam shot at ``row``, ``column`` crosses the planned face of the element of point ``at``."""
        points = self._points
        beam = self._scanner.beam(row, column) @ view.rotation.T
        normal = points.normal[at]
        crossing = plane_crossing(view.position, beam, points.position[at], normal)
        triangle = points.triangle[at].astype(np.int32)
        return self._surfaces.face_at(crossing, normal, points.element[at], triangle, ON_FACE_M) >= 0

    @property
    def visible(self) -> NDArray[np.float64]:
        """(E,) share of the planned surface that faces a station and is in its line of sight, in the scene as built."""
        return self._share(self._seen)

    @property
    def witnessed(self) -> NDArray[np.float64]:
        """(E,) share towards which a station that sees it has a return from there or beyond, or from the element."""
        return self._share(self._proven)

    def of_cut(self, row: int, edit: Edit) -> tuple[float, float]:
        """The same share of one cut element: of the part that was taken away, and of the part that stands."""
        mine = slice(row * POINTS_PER_ELEMENT, (row + 1) * POINTS_PER_ELEMENT)
        along = self._points.position[mine] @ np.array(edit.direction)
        gone, proven = (along > edit.removed[0]) & (along < edit.removed[1]), self._proven[mine]
        return float(proven[gone].mean()), float(proven[~gone].mean())

    def _share(self, what: NDArray[np.bool_]) -> NDArray[np.float64]:
        return what.reshape(-1, POINTS_PER_ELEMENT).mean(axis=1)


def planned_area(model: BuildingModel) -> NDArray[np.float64]:
    """(E,) m2 of planned surface; an open sheet, which the model keeps twice for its two sides, counts once."""
    _, same, times = np.unique(np.sort(model.triangles, axis=1), axis=0, return_inverse=True, return_counts=True)
    area = 0.5 * np.linalg.norm(_cross(model), axis=1) / times[same.ravel()]
    return np.bincount(model.triangle_element, weights=area, minlength=len(model.elements)).astype(np.float64)


def _hidden(
    scene: Scene,
    origin: NDArray[np.float64],
    ray: NDArray[np.float64],
    distance: NDArray[np.float64],
    element: NDArray[np.int32],
    *,
    by_others: bool,
) -> NDArray[np.bool_]:
    """(N,) is the point hidden by other owners (``by_others``), or by the element itself. Glass hides nothing."""
    hidden = np.zeros(len(ray), dtype=np.bool_)
    gone = np.zeros(len(ray))
    at = np.arange(len(ray))
    for _ in range(MOST_SURFACES):
        if not len(at):
            break
        seen = scene.cast(origin + gone[at, None] * ray[at], ray[at])
        before = gone[at] + seen.distance < distance[at] - SIGHT_TOLERANCE_M
        at, met, step = at[before], seen.triangle[before], seen.distance[before]
        counts = ((scene.owner[met] != element[at]) == by_others) & ~scene.glass[met]
        hidden[at[counts]] = True
        gone[at] += step + RESTART_M
        at = at[~counts]
    return hidden


def _cross(model: BuildingModel) -> NDArray[np.float64]:
    corner = model.vertices[model.triangles]
    return np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])


def _planned_points(model: BuildingModel) -> _Points:
    """POINTS_PER_ELEMENT area-weighted points on each element."""
    random = np.random.default_rng(0)
    cross = _cross(model)
    length = np.linalg.norm(cross, axis=1)
    before = np.concatenate([[0.0], np.cumsum(length)])
    start = model.triangle_start
    element = np.repeat(np.arange(len(model.elements), dtype=np.int32), POINTS_PER_ELEMENT)
    first, last = start[element], start[element + 1]
    target = before[first] + random.random(len(element)) * (before[last] - before[first])
    triangle = np.clip(np.searchsorted(before, target, side="right") - 1, first, last - 1)
    u, v = random.random((2, len(element)))
    fold = u + v > 1
    u, v = np.where(fold, 1 - u, u)[:, None], np.where(fold, 1 - v, v)[:, None]
    p = model.vertices[model.triangles[triangle]]
    return _Points(
        position=p[:, 0] + u * (p[:, 1] - p[:, 0]) + v * (p[:, 2] - p[:, 0]),
        normal=cross[triangle] / length[triangle, None],
        element=element,
        triangle=triangle,
    )
