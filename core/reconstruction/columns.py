"""Columns that stand free in a room: narrow things whose surfaces reach from the floor to the ceiling."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, label
from shapely import contains_xy

from ..planes.cloud import Cloud
from ..planes.surfels import Surfels
from .column_fit import WIDEST_M
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


def column_returns(room: Room, upright: Surfels, cloud: Cloud) -> list[Rows]:
    """Rows of the cloud about each thing in a room that may be a column."""
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
    levels = int(height / ROW_M)
    row = np.clip(((own.position[:, 2] - room.floor) / height * levels).astype(np.int64), 0, levels - 1)
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
        if not len(piece) or room.ceiling - piece[:, 2].max() > TOP_M:
            continue
        if np.ptp(piece[:, :2], axis=0).max() > MOST_EXTENT * WIDEST_M:
            continue
        out.append(rows[piece_of == number])
    return out


def _returns(cloud: Cloud, room: Room) -> Rows:
    x0, y0, x1, y1 = room.outline.bounds
    x, y, z = cloud.points.T
    chosen = (x > x0) & (x < x1) & (y > y0) & (y < y1)
    return np.flatnonzero(chosen & (z > room.floor + LEVEL_EDGE_M) & (z < room.ceiling - LEVEL_EDGE_M))
