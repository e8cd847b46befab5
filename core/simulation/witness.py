"""What the returns of a simulated campaign can prove about each element's planned surface."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.elements import BuildingModel
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
"""A return no more than this before the planned point is at the point or beyond it."""
MOST_SURFACES = 16


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
class Witness:
    """Per element."""

    visible: NDArray[np.float64]
    """(E,) share of the planned surface that faces a station and is in its line of sight, in the scene as it was built."""
    witnessed: NDArray[np.float64]
    """(E,) share of it in whose direction a beam of a station that sees it really brought a return from there or beyond."""
    area: NDArray[np.float64]
    """(E,) m2 of planned surface."""


def witness(
    model: BuildingModel, scene: Scene, edits: Mapping[int, Edit], views: Sequence[StationView], scanner: Scanner
) -> Witness:
    """Judge area-weighted points on every planned surface against the scene as built and the returns.

    What the element itself was built as never hides its own planned surface: a wall built towards the scanner proves that it
    was moved. A removed element has no body that could hide anything.
    """
    position, normal, element, area = _planned_points(model)
    planned = build_scene(model, {}, ())
    visible = np.zeros(len(position), dtype=np.bool_)
    proven = np.zeros(len(position), dtype=np.bool_)
    stands = np.ones(len(model.elements), dtype=np.bool_)
    stands[[row for row, edit in edits.items() if edit.kind == "remove"]] = False
    sheet = ~model.closed  # both sides of an open sheet are one surface: seen from either, it is seen
    for view in views:
        ray = position - view.position
        distance = np.linalg.norm(ray, axis=1)
        ray /= np.maximum(distance, 1e-9)[:, None]
        facing = -np.einsum("ij,ij->i", ray, normal)
        facing = np.where(sheet[element], np.abs(facing), facing)
        at = np.flatnonzero(facing > FACING_COS)
        at = at[~_hidden(scene, view.position, ray[at], distance[at], element[at], by_others=True)]
        own_front = stands[element[at]]
        own_front[own_front] = _hidden(
            planned, view.position, *(v[at[own_front]] for v in (ray, distance, element)), by_others=False
        )
        at = at[~own_front]
        visible[at] = True
        at = at[facing[at] > STEEPEST_COS]
        row, column = scanner.cell(ray[at] @ view.rotation)
        measured, owner = view.distance[row, column], view.owner[row, column]
        back = (row >= 0) & (owner >= 0)
        beyond = measured > distance[at] - RETURN_TOLERANCE_M
        own = owner == element[at]
        proven[at] |= back & (beyond | own)
    count = np.bincount(element, minlength=len(model.elements))
    return Witness(
        np.bincount(element, weights=visible, minlength=len(count)) / np.maximum(count, 1),
        np.bincount(element, weights=proven, minlength=len(count)) / np.maximum(count, 1),
        area,
    )


def _hidden(
    scene: Scene,
    origin: NDArray[np.float64],
    ray: NDArray[np.float64],
    distance: NDArray[np.float64],
    element: NDArray[np.int32],
    *,
    by_others: bool,
) -> NDArray[np.bool_]:
    """(N,) is something in front of the point: of other owners (``by_others``), or of the element itself. Glass hides nothing."""
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
        gone[at] += step + 1e-4
        at = at[~counts]
    return hidden


def _planned_points(
    model: BuildingModel,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int32], NDArray[np.float64]]:
    """POINTS_PER_ELEMENT area-weighted points on each element: position, normal, element, and (E,) element areas."""
    random = np.random.default_rng(0)
    corner = model.vertices[model.triangles]
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    length = np.linalg.norm(cross, axis=1)
    count = len(model.elements)
    _, first, times = np.unique(np.sort(model.triangles, axis=1), axis=0, return_inverse=True, return_counts=True)
    once = length / 2 / times[first.ravel()]  # an open sheet is kept twice, once for each side
    area_once = np.bincount(model.triangle_element, weights=once, minlength=count)
    area = np.bincount(model.triangle_element, weights=length / 2, minlength=count)
    before = np.concatenate([[0.0], np.cumsum(length / 2)])
    start = model.triangle_start
    element = np.repeat(np.arange(count, dtype=np.int32), POINTS_PER_ELEMENT)
    target = before[start[element]] + random.random(len(element)) * area[element]
    triangle = np.clip(np.searchsorted(before, target, side="right") - 1, start[element], start[element + 1] - 1)
    u, v = random.random((2, len(element)))
    fold = u + v > 1
    u, v = np.where(fold, 1 - u, u)[:, None], np.where(fold, 1 - v, v)[:, None]
    p = corner[triangle]
    return (
        p[:, 0] + u * (p[:, 1] - p[:, 0]) + v * (p[:, 2] - p[:, 0]),
        cross[triangle] / length[triangle, None],
        element,
        area_once,
    )
