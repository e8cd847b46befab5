"""Rectangles of a wall in which it is open, from what little of them may be seen behind furniture."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, binary_opening, find_objects, label

from .opening_edges import LEAST_CELLS, SIDE_SEEN, wall_lines

Cells = NDArray[np.int8]
Rectangle = tuple[int, int, int, int]
"""Columns from, to, lines from, to; the ends are not in it."""

UNKNOWN, SOLID, OPEN, VOID, HIDDEN = 0, 1, 2, 3, 4
EDGE_CELLS = 2
LEAST_SEEN_M = 0.14
"""So much of a hole must be seen, or all of its sides but one."""
LEAST_SEEN_M2 = 0.06
NEAR_M = 0.3
FLOOR_M = 0.1
"""So far up the floor's own returns may lie in the plane of a wall."""
LEAST_OPEN_AROUND = 0.9
"""Of the cells beside and above what stands free in a hole."""


@dataclass(frozen=True)
class FaceRaster:
    """States of the cells of a wall; [iu, iz]."""

    state: Cells
    cell: float
    u0: float
    z0: float

    @property
    def solid_share(self) -> float:
        """Of the cells about which something is known."""
        known = np.isin(self.state, (SOLID, OPEN, VOID))
        return float((self.state == SOLID).sum() / max(known.sum(), 1))


def without_islands(raster: FaceRaster) -> FaceRaster:
    """What is solid with open cells around it stands on the floor in a hole, and hides it: parts of a wall hang together."""
    around = np.ones((3, 3), dtype=np.bool_)
    state = raster.state.copy()
    above = state[:, int(np.ceil(FLOOR_M / raster.cell)) :]
    pieces, _ = label(above == SOLID, around)
    size = np.bincount(pieces.ravel())
    for number, place in enumerate(find_objects(pieces), start=1):
        at_end = place[0].start == 0 or place[0].stop == len(above) or place[1].stop == above.shape[1]
        if at_end or size[number] * raster.cell**2 < LEAST_SEEN_M2:
            continue
        window = tuple(slice(max(s.start - 1, 0), s.stop + 1) for s in place)
        piece = pieces[window] == number
        beside = binary_dilation(piece, around) & ~piece
        if (above[window][beside] == OPEN).mean() > LEAST_OPEN_AROUND:
            above[window][piece] = HIDDEN
    return replace(raster, state=state)


def seen_holes(raster: FaceRaster, lost: bool) -> list[Rectangle]:
    """Where a wall may have holes. ``lost``: rays into the open leave no return (an outer wall), so a hole may be void."""
    hole = (raster.state == OPEN) | ((raster.state == VOID) if lost else False)
    hole = binary_opening(hole, np.ones((3, 3), dtype=np.bool_))
    return _over_each_other(raster.state, _rectangles(raster, hole))


def _rectangles(raster: FaceRaster, hole: NDArray[np.bool_]) -> list[Rectangle]:
    pieces, _ = label(hole)
    out: list[Rectangle] = []
    ends: list[Rectangle] = []
    for number, place in enumerate(find_objects(pieces), start=1):
        mask = pieces[place] == number
        if mask.sum() * raster.cell**2 < LEAST_SEEN_M2:
            continue
        rectangle = _rectangle(raster.state, place, mask)
        piece = place[0].start, place[0].stop, place[1].start, place[1].stop
        if rectangle is not None and _large(raster, rectangle):
            out.append(rectangle)
        elif rectangle is not None and _one_side_hidden(raster.state, piece):
            ends.append(rectangle)
    near = int(np.ceil(NEAR_M / raster.cell))
    for end in ends:
        beside = [n for n, other in enumerate(out) if _beside(end, other, near)]
        if not beside:
            out.append(end)
        for n in beside[:1]:
            o = out[n]
            if min(abs(end[k] - o[k]) for k in range(4)) <= EDGE_CELLS:
                out[n] = min(end[0], o[0]), max(end[1], o[1]), min(end[2], o[2]), max(end[3], o[3])
    return out


def _beside(a: Rectangle, b: Rectangle, near: int) -> bool:
    """So close to each other that they are parts of one hole, if one of their sides is in line."""
    return max(a[0] - b[1], b[0] - a[1]) < near and max(a[2] - b[3], b[2] - a[3]) < near


def _large(raster: FaceRaster, rectangle: Rectangle) -> bool:
    i0, i1, k0, k1 = rectangle
    return min(i1 - i0, k1 - k0) * raster.cell >= LEAST_SEEN_M


def _one_side_hidden(state: Cells, rectangle: Rectangle) -> bool:
    """Wall follows on all other sides: what is seen is the end of a hole that goes on behind what stands before it."""
    sides = sorted(_sides_seen(state, rectangle))
    return sides[0] < SIDE_SEEN <= sides[1]


def corner_seen(state: Cells, rectangle: Rectangle) -> bool:
    """An upright and a level side were seen, and so the place of a hole most of which is hidden."""
    sides = _sides_seen(state, rectangle)
    return max(sides[:2]) >= SIDE_SEEN and max(sides[2:]) >= SIDE_SEEN


def _sides_seen(state: Cells, rectangle: Rectangle) -> list[float]:
    """For start, end, sill and head the share of the side along which it is open within and wall is seen beyond."""
    i0, i1, k0, k1 = rectangle
    out = []
    for lines, first, last in ((state[:, k0:k1], i0, i1), (state[i0:i1].T, k0, k1)):
        for inner, beyond in (
            (lines[first : first + EDGE_CELLS], lines[max(first - EDGE_CELLS, 0) : first]),
            (lines[last - EDGE_CELLS : last], lines[last : last + EDGE_CELLS]),
        ):
            out.append(float(((inner == OPEN).any(axis=0) & (beyond == SOLID).any(axis=0)).mean()))
    return out


def _over_each_other(state: Cells, rectangles: list[Rectangle]) -> list[Rectangle]:
    """Above and below a thing that stands before it, one hole has the same sides; no wall is seen between its parts."""
    out: list[Rectangle] = []
    for a in sorted(rectangles, key=lambda r: r[2]):
        for n, b in enumerate(out):
            i0, i1 = min(a[0], b[0]), max(a[1], b[1])
            same = max(abs(a[0] - b[0]), abs(a[1] - b[1])) <= EDGE_CELLS and b[3] <= a[2]
            if same and not wall_lines(state[i0:i1, b[3] : a[2]].T == SOLID).any():
                out[n] = i0, i1, b[2], a[3]
                break
        else:
            out.append(a)
    return out


def continued(state: Cells, rectangle: Rectangle) -> Rectangle:
    """A hole goes on behind what stands before it, to where one of its upright sides is seen again in the same line."""
    i0, i1, k0, k1 = rectangle
    wall = wall_lines(state[clear_of_edges(i0, i1)].T == SOLID)
    again = np.zeros(len(wall), dtype=np.bool_)
    for within, beyond in (
        (state[i0 : i0 + EDGE_CELLS], state[max(i0 - EDGE_CELLS, 0) : i0]),
        (state[i1 - EDGE_CELLS : i1], state[i1 : i1 + EDGE_CELLS]),
    ):
        again |= (within == OPEN).all(axis=0) & (beyond == SOLID).any(axis=0)
    again = binary_opening(again, np.ones(LEAST_CELLS + 1, dtype=np.bool_))
    walls = np.flatnonzero(wall)
    lowest, highest = max(walls[walls < k0], default=-1), min(walls[walls >= k1], default=len(wall))
    lines = np.flatnonzero(again)
    lines = lines[(lines > lowest) & (lines < highest)]
    return i0, i1, min(k0, min(lines, default=k0)), max(k1, max(lines, default=k1 - 1) + 1)


def _rectangle(state: Cells, place: tuple[slice, slice], mask: NDArray[np.bool_]) -> Rectangle | None:
    """Rows and columns in which most of what is known is open, however much is hidden."""
    solid = state[place] == SOLID

    def run(axis: int) -> tuple[int, int]:
        holes, walls = mask.sum(axis=axis), solid.sum(axis=axis)
        keep = (holes >= 3) & (holes > 0.6 * (holes + walls))
        if not keep.any():
            return 0, 0
        parts, _ = label(keep)
        weight = np.bincount(parts, holes)
        weight[0] = 0
        own = np.flatnonzero(parts == int(np.argmax(weight)))
        return int(own[0]), int(own[-1]) + 1

    (a0, a1), (b0, b1) = run(1), run(0)
    i0, i1 = place[0].start + a0, place[0].start + a1
    k0, k1 = place[1].start + b0, place[1].start + b1
    return (i0, i1, k0, k1) if i1 > i0 and k1 > k0 else None


def framed(state: Cells, rectangle: Rectangle) -> float:
    """The least share of wall that is seen beside the hole, of its sides and top."""
    i0, i1, k0, k1 = rectangle
    strips = [state[max(i0 - 4, 0) : i0, k0:k1], state[i1 : i1 + 4, k0:k1], state[i0:i1, k1 : k1 + 4]]
    shares = [float((s == SOLID).any(axis=0 if n < 2 else 1).mean()) if s.size else 0.0 for n, s in enumerate(strips)]
    return min(shares)


def clear_of_edges(first: int, last: int) -> slice:
    """The lines of a hole without those that show the wall beside it."""
    return slice(first + EDGE_CELLS, last - EDGE_CELLS) if last - first > 4 * EDGE_CELLS else slice(first, last)
