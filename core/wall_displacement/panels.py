"""Where the columns of panels stand along a wall: between its vertical joints, or strips where there are none."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, map_coordinates

from .columns import vertical_joints
from .wall import CELL_M, Wall, WallPoints, resurfaced, smooth

Array = NDArray[np.float64]
NARROWEST_COLUMN_M = 0.3
STRIP_M = 1.5
"""Width of the strips that a wall without visible vertical joints is cut into."""


def column_bounds(wall: Wall, epochs: Sequence[WallPoints], spacing: float) -> tuple[list[tuple[float, float]], list[str]]:
    """(low, high) of each column along the wall [m]; and what the user should know of them.

    A vertical joint may lie between two scan lines of one epoch and be met by one of the other, so both are looked at.
    """
    joints = np.zeros(0)
    for epoch in epochs:
        surface = _surface_at(resurfaced(wall, epoch.points), epoch.points)
        found = vertical_joints(epoch.points, surface - epoch.points[:, 1], spacing)
        new = [x for x in found if not len(joints) or np.abs(joints - x).min() > NARROWEST_COLUMN_M]
        joints = np.sort(np.concatenate([joints, new]))
    x = epochs[0].points[:, 0]
    ends = (float(np.quantile(x, 0.001)), float(np.quantile(x, 0.999)))
    joints = joints[(joints > ends[0]) & (joints < ends[1])]
    warnings = []
    if not len(joints):
        warnings.append("No vertical joints were found: the wall was cut into strips, which may span two columns of panels.")
        count = max(round((ends[1] - ends[0]) / STRIP_M), 1)
        edges = np.linspace(*ends, count + 1)
    else:
        edges = np.array([ends[0], *_with_pitch(joints), ends[1]])
    bounds = [(a, b) for a, b in itertools.pairwise(edges) if b - a > NARROWEST_COLUMN_M]
    return [(float(a), float(b)) for a, b in bounds], warnings


def split(points: WallPoints, bounds: list[tuple[float, float]]) -> list[WallPoints]:
    """The points of each column, without those near its vertical joints."""
    x = points.points[:, 0]
    edges = inner_edges(bounds)
    cell = np.searchsorted(edges, x).astype(np.int32)
    inside = np.flatnonzero(cell % 2 == 1)
    order = inside[np.argsort((cell[inside] // 2).astype(np.int16 if len(bounds) < 30_000 else np.int32), kind="stable")]
    ends = np.cumsum(np.bincount(cell[inside] // 2, minlength=len(bounds)))
    return [points.take(rows) for rows in np.split(order, ends[:-1])]


def inner_edges(bounds: list[tuple[float, float]]) -> Array:
    """(2C,) ends of the columns, clear of their vertical joints, ascending [m along the wall]."""
    edges = []
    for low, high in bounds:
        margin = min(0.06, 0.15 * (high - low))
        edges += [low + margin, high - margin]
    return np.array(edges)


def _surface_at(wall: Wall, points: Array) -> Array:
    """(N,) depth of the smooth surface between its cells' middles [m], so that a slope or a curve makes no steps."""
    surface = smooth(wall.surface)
    nearest = distance_transform_edt(np.isnan(surface), return_distances=False, return_indices=True)
    at = (points[:, [0, 2]] - wall.low) / CELL_M - 0.5
    return np.asarray(map_coordinates(surface[tuple(nearest)], at.T, order=1, mode="nearest"))


def _with_pitch(joints: Array) -> Array:
    """Joints that were missed between two found ones are put where the panels' usual width says."""
    steps = np.diff(joints)
    if len(steps) < 2:
        return joints
    pitch = float(np.median(steps))
    out = [joints[0]]
    for step, joint in zip(steps, joints[1:], strict=True):
        pieces = round(step / pitch)
        if pieces > 1 and abs(step - pieces * pitch) < 0.1 * pitch:
            out += [joint - step * (1 - k / pieces) for k in range(1, pieces)]
        out.append(joint)
    return np.array(out)
