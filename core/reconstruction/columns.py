"""Columns that stand free in a room: narrow things whose surfaces reach from the floor to the ceiling."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, label
from shapely import Point, Polygon, contains_xy

from ..planes.surfels import Surfels
from .rooms import Room

Array = NDArray[np.float64]

CELL_M = 0.06
FROM_WALL_M = 0.12
ROW_M = 0.15
LEAST_HEIGHT_SHARE = 0.75
TOP_M = 0.15
"""A column's surface is seen up to this far below the ceiling; a cupboard ends lower."""
WIDEST_M = 1.3
NARROWEST_M = 0.08
ROUND_SHARE = 0.55
"""Below this share of surface in four directions at right angles, the column is round."""


@dataclass(frozen=True)
class ColumnShape:
    """A column in plan."""

    footprint: Polygon
    radius: float
    """Above 0: a circle about the footprint's middle, metres."""
    residual: float
    """Root mean square distance of its surfels [m]."""
    seen: float
    """Share of its outline that was seen, 0..1."""


def find_columns(room: Room, upright: Surfels) -> list[ColumnShape]:
    """Columns in one room."""
    inner = room.outline.buffer(-FROM_WALL_M)
    if inner.is_empty:
        return []
    z = upright.position[:, 2]
    height = room.ceiling - room.floor
    chosen = (z > room.floor) & (z < room.ceiling)
    chosen &= contains_xy(inner, upright.position[:, 0], upright.position[:, 1])
    own = upright.where(chosen)
    if not len(own):
        return []
    low = own.position[:, :2].min(axis=0)
    cell = ((own.position[:, :2] - low) / CELL_M).astype(np.int64)
    shape = tuple((cell.max(axis=0) + 1).tolist())
    rows = int(height / ROW_M)
    row = np.clip(((own.position[:, 2] - room.floor) / height * rows).astype(np.int64), 0, rows - 1)
    stack = np.zeros((*shape, rows), dtype=np.bool_)
    stack[cell[:, 0], cell[:, 1], row] = True
    # a surface on the border of two cells shows in both
    near = binary_dilation(stack, np.ones((3, 3, 1), dtype=np.bool_))
    tall = (near.mean(axis=2) > LEAST_HEIGHT_SHARE) & stack.any(axis=2)
    pieces, count = label(binary_dilation(tall, np.ones((3, 3), dtype=np.bool_)))
    out = []
    for number in range(1, count + 1):
        member = (pieces[cell[:, 0], cell[:, 1]] == number) & tall[cell[:, 0], cell[:, 1]]
        piece = own.where(member)
        column = _shape(piece) if len(piece) and room.ceiling - piece.position[:, 2].max() < TOP_M else None
        if column is not None:
            out.append(column)
    return out


def _shape(own: Surfels) -> ColumnShape | None:
    if len(own) < 20:
        return None
    xy = own.position[:, :2]
    if np.ptp(xy, axis=0).max() > 1.6 * WIDEST_M:
        return None
    normal = own.normal[:, :2] / np.linalg.norm(own.normal[:, :2], axis=1, keepdims=True)
    good = own.planarity < 0.2
    if good.sum() < 12:
        return None
    angle = np.arctan2(normal[good, 1], normal[good, 0])
    spectrum = (np.exp(4j * angle) * own.area[good]).sum()
    turn = float(np.angle(spectrum) / 4)
    off = np.abs((angle - turn + np.pi / 4) % (np.pi / 2) - np.pi / 4)
    if (own.area[good] * (off < np.radians(12))).sum() < ROUND_SHARE * own.area[good].sum():
        return _circle(xy)
    axes = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    at, facing = xy @ axes.T, normal @ axes.T
    limits = np.zeros((2, 2))
    residuals, seen = [], 0
    for k in range(2):
        other = at[:, k]
        for end, sign in ((0, -1.0), (1, 1.0)):
            face = good & (sign * facing[:, k] > np.cos(np.radians(15)))
            if face.sum() >= 6:
                limits[end, k] = np.median(other[face])
                residuals.append(other[face] - limits[end, k])
                seen += 1
            else:
                limits[end, k] = np.quantile(other, 0.02 if end == 0 else 0.98)
    size = limits[1] - limits[0]
    if size.max() > WIDEST_M or size.min() < NARROWEST_M or seen < 2:
        return None
    corners = np.array([[limits[i, 0], limits[j, 1]] for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))]) @ axes
    residual = float(np.sqrt((np.concatenate(residuals) ** 2).mean()))
    return ColumnShape(Polygon(corners), 0.0, residual, seen / 4)


def _circle(xy: Array) -> ColumnShape | None:
    middle = xy.mean(axis=0)
    q = xy - middle
    solution = np.linalg.lstsq(np.column_stack([2 * q, np.ones(len(q))]), (q**2).sum(axis=1), rcond=None)[0]
    radius = float(np.sqrt(max(solution[2] + solution[:2] @ solution[:2], 0.0)))
    distance = np.linalg.norm(q - solution[:2], axis=1) - radius
    if not NARROWEST_M / 2 < radius < WIDEST_M / 2 or np.abs(distance).mean() > 0.1 * radius:
        return None
    angle = np.arctan2(q[:, 1] - solution[1], q[:, 0] - solution[0])
    seen = len(np.unique(np.floor(angle / np.radians(15)))) / 24
    return ColumnShape(Point(middle + solution[:2]).buffer(radius, 32), radius, float(np.sqrt((distance**2).mean())), seen)
