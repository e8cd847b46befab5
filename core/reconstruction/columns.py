"""Columns that stand free in a room: narrow things whose surfaces reach from the floor to the ceiling."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, label
from shapely import contains_xy

from ..planes.cloud import Cloud
from ..planes.surfels import Surfels
from .column_fit import WIDEST_M
from .plan import PlanRaster
from .rooms import Room

Rows = NDArray[np.int64]

CELL_M = 0.06
FROM_WALL_M = 0.12
ROW_M = 0.15
LEAST_HEIGHT_SHARE = 0.75
MOST_EXTENT = 1.6
"""A candidate with what touches it, in widths of the widest column."""
TOP_M = 0.15
"""A column's surface is seen up to this far below the ceiling; a cupboard ends lower."""
LEVEL_EDGE_M = 0.1
"""Returns this close to the floor or ceiling may be theirs, a skirting's or a capital's."""
SLOPE_M = 0.1
"""A ceiling over a column that is no farther from its room's level is that."""


@dataclass(frozen=True)
class Candidate:
    """What may be a column."""

    rows: Rows
    """Of the cloud: the returns about it."""
    top: float
    """The ceiling over it, which may be sloped [m]."""


def column_returns(room: Room, upright: Surfels, cloud: Cloud, plan: PlanRaster) -> list[Candidate]:
    """Each thing in a room that may be a column."""
    inner = room.outline.buffer(-FROM_WALL_M)
    if inner.is_empty:
        return []
    own = upright.where(contains_xy(inner, upright.position[:, 0], upright.position[:, 1]))
    ceiling = _ceiling_over(own.position[:, :2], room, plan)
    inside = (own.position[:, 2] > room.floor) & (own.position[:, 2] < ceiling)
    own, ceiling = own.where(inside), ceiling[inside]
    if not len(own):
        return []
    z, height = own.position[:, 2], ceiling - room.floor
    low = own.position[:, :2].min(axis=0)
    cell = ((own.position[:, :2] - low) / CELL_M).astype(np.int64)
    shape = tuple((cell.max(axis=0) + 1).tolist())
    levels = int(height.max() / ROW_M)
    row = np.clip(((z - room.floor) / height * levels).astype(np.int64), 0, levels - 1)
    stack = np.zeros((*shape, levels), dtype=np.bool_)
    stack[cell[:, 0], cell[:, 1], row] = True
    # a surface on the border of two cells shows in both
    near = binary_dilation(stack, np.ones((3, 3, 1), dtype=np.bool_))
    tall = (near.mean(axis=2) > LEAST_HEIGHT_SHARE) & stack.any(axis=2)
    pieces, count = label(binary_dilation(tall, np.ones((3, 3), dtype=np.bool_)))
    rows = _returns(cloud, room)
    place = np.floor((cloud.points[rows, :2] - low) / CELL_M).astype(np.int64)
    inside = ((place >= 0) & (place < shape)).all(axis=1)
    rows, place = rows[inside], place[inside]
    piece_of = pieces[place[:, 0], place[:, 1]]
    out = []
    for number in range(1, count + 1):
        member = (pieces[cell[:, 0], cell[:, 1]] == number) & tall[cell[:, 0], cell[:, 1]]
        piece = own.position[member]
        if not len(piece) or (ceiling - z)[member].min() > TOP_M:
            continue
        if np.ptp(piece[:, :2], axis=0).max() > MOST_EXTENT * WIDEST_M:
            continue
        about = rows[piece_of == number]
        below = cloud.points[about, 2] < _ceiling_over(cloud.points[about, :2], room, plan) - LEVEL_EDGE_M
        top = float(np.median(ceiling[member]))
        out.append(Candidate(about[below], top if abs(top - room.ceiling) > SLOPE_M else room.ceiling))
    return out


def _ceiling_over(places: NDArray[np.floating], room: Room, plan: PlanRaster) -> NDArray[np.float64]:
    """(N,) heights over (N, 2) places; the room's where none was seen near [m]."""
    cell = plan.cells(places.astype(np.float64))
    seen = plan.ceiling[cell[:, 0], cell[:, 1]]
    return np.where(np.isfinite(seen), seen, room.ceiling)


def _returns(cloud: Cloud, room: Room) -> Rows:
    x0, y0, x1, y1 = room.outline.bounds
    x, y, z = cloud.points.T
    chosen = (x > x0) & (x < x1) & (y > y0) & (y < y1)
    return np.flatnonzero(chosen & (z > room.floor + LEVEL_EDGE_M))
