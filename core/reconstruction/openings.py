"""Openings of a wall from the occupancy of its faces: where rays went through, or nothing ever came back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_opening, find_objects, label, uniform_filter

from .crossings import Crossings

Array = NDArray[np.float64]
Cells = NDArray[np.int8]

UNKNOWN, SOLID, OPEN, VOID, HIDDEN = 0, 1, 2, 3, 4
LEAST_CELL_M = 0.02
LARGEST_CELL_M = 0.08
RETURNS_A_CELL = 2.5
LEAST_SIDE_M = 0.3
LEAST_FILLED = 0.72
LEAST_KNOWN = 0.25
LEAST_FRAMED = 0.5
"""Share of the wall around a hole that must be seen, where nothing came back from the hole itself."""
DOOR_SILL_M = 0.15
DOOR_HEIGHT_M = 1.6
HIDDEN_SILL_M = 0.9
"""What hides the foot of a door may be this high."""
RIM_M = (0.02, 0.055)
"""A frame lies this far inside the edge of its opening; the reveal itself does not."""
FILLED_SHARE = 0.4
RIM_BIN_M = 0.04


@dataclass(frozen=True)
class Opening:
    """A hole in a wall: places along the wall's line and heights, metres."""

    u0: float
    u1: float
    z0: float
    z1: float
    kind: Literal["door", "window", "opening"]
    filled: bool
    """A leaf, pane or frame was seen in it."""
    quality: float
    """Share of the known cells in the rectangle that are open, 0..1."""

    @property
    def width(self) -> float:
        """Metres."""
        return self.u1 - self.u0

    @property
    def height(self) -> float:
        """Metres."""
        return self.z1 - self.z0


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


def face_raster(sides: list[Crossings], u: tuple[float, float], z: tuple[float, float], band: float) -> FaceRaster:
    """What both sides together say of the wall: open only where neither side saw a surface."""
    area = (u[1] - u[0]) * (z[1] - z[0])
    most = max((len(s) for s in sides), default=0)
    cell = float(np.clip(np.sqrt(RETURNS_A_CELL * area / max(most, 1)), LEAST_CELL_M, LARGEST_CELL_M))
    shape = (max(int(np.ceil((u[1] - u[0]) / cell)), 1), max(int(np.ceil((z[1] - z[0]) / cell)), 1))
    states = [_side_state(s, u[0], z[0], cell, shape, band) for s in sides]
    state = np.full(shape, UNKNOWN, dtype=np.int8)
    for wanted in (HIDDEN, VOID, OPEN, SOLID):
        for own in states:
            state[own == wanted] = wanted
    return FaceRaster(state, cell, u[0], z[0])


def _side_state(c: Crossings, u0: float, z0: float, cell: float, shape: tuple[int, int], band: float) -> Cells:
    iu = np.clip(((c.u - u0) / cell).astype(np.int64), 0, shape[0] - 1)
    iz = np.clip(((c.z - z0) / cell).astype(np.int64), 0, shape[1] - 1)
    flat = iu * shape[1] + iz
    size = shape[0] * shape[1]
    counts = {}
    for name, chosen in (("on", c.on_face(band)), ("behind", c.depth > band), ("front", c.depth < -band)):
        counts[name] = np.bincount(flat[chosen], minlength=size).reshape(shape).astype(np.float64)
    near = {k: uniform_filter(v, 3, mode="constant") * 9 for k, v in counts.items()}
    state = np.full(shape, VOID, dtype=np.int8)
    state[(near["front"] > 0.5)] = HIDDEN
    for source in (near, counts):
        known = source["on"] + source["behind"] > 0.5
        state[known & (source["behind"] > source["on"])] = OPEN
        state[known & (source["behind"] <= source["on"])] = SOLID
    return state


def find_openings(
    raster: FaceRaster, sides: list[Crossings], floor: float, thickness: float, band: float, lost: bool
) -> list[Opening]:
    """Rectangular holes of a wall. ``lost``: rays into the open leave no return (an outer wall), so a hole may be void."""
    state = raster.state
    hole = (state == OPEN) | ((state == VOID) if lost else False)
    hole = binary_opening(hole, np.ones((3, 3), dtype=np.bool_))
    pieces, _ = label(hole)
    out: list[Opening] = []
    for number, place in enumerate(find_objects(pieces), start=1):
        mask = pieces[place] == number
        if min(mask.shape) * raster.cell < 0.6 * LEAST_SIDE_M or mask.sum() * raster.cell**2 < 0.06:
            continue
        rectangle = _rectangle(state, place, mask, raster.cell)
        if rectangle is None:
            continue
        i0, i1, k0, k1 = rectangle
        inner = state[i0:i1, k0:k1]
        counts = {s: int((inner == s).sum()) for s in (SOLID, OPEN, VOID, HIDDEN)}
        open_cells = counts[OPEN] + (counts[VOID] if lost else 0)
        known = open_cells + counts[SOLID]
        if known < LEAST_KNOWN * inner.size or open_cells < LEAST_FILLED * known:
            continue
        if counts[OPEN] < 0.1 * inner.size and _framed(state, rectangle) < LEAST_FRAMED:
            continue
        opening = _refined(raster, sides, rectangle, floor, thickness, band, open_cells / known)
        if opening is not None:
            out.append(opening)
    return out


def _rectangle(
    state: Cells, place: tuple[slice, slice], mask: NDArray[np.bool_], cell: float
) -> tuple[int, int, int, int] | None:
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
    if min(i1 - i0, k1 - k0) * cell < LEAST_SIDE_M:
        return None
    return i0, i1, k0, k1


def _framed(state: Cells, rectangle: tuple[int, int, int, int]) -> float:
    """The least share of wall that is seen beside the hole, of its sides and top."""
    i0, i1, k0, k1 = rectangle
    strips = [state[max(i0 - 4, 0) : i0, k0:k1], state[i1 : i1 + 4, k0:k1], state[i0:i1, k1 : k1 + 4]]
    shares = [float((s == SOLID).any(axis=0 if n < 2 else 1).mean()) if s.size else 0.0 for n, s in enumerate(strips)]
    return min(shares)


def _refined(
    raster: FaceRaster, sides: list[Crossings], rectangle: tuple[int, int, int, int], floor: float, thickness: float,
    band: float, quality: float,
) -> Opening | None:
    i0, i1, k0, k1 = rectangle
    cell = raster.cell
    u0, u1 = raster.u0 + i0 * cell, raster.u0 + i1 * cell
    z0, z1 = raster.z0 + k0 * cell, raster.z0 + k1 * cell
    below = raster.state[i0:i1, :k0]
    down = z0 - floor < DOOR_SILL_M or (
        z0 - floor < HIDDEN_SILL_M and z1 - floor > DOOR_HEIGHT_M and (below == SOLID).mean() < 0.1
    )
    u = np.concatenate([s.u for s in sides])
    z = np.concatenate([s.z for s in sides])
    on = np.concatenate([s.on_face(band) for s in sides])
    behind = np.concatenate([s.depth > band for s in sides])
    near_z = (z > z0 + 0.1 * (z1 - z0)) & (z < z1 - 0.1 * (z1 - z0))
    near_u = (u > u0 + 0.1 * (u1 - u0)) & (u < u1 - 0.1 * (u1 - u0))
    u0 = _edge(u, z, on & near_z, behind & near_z, u0, cell, 1.0)
    u1 = _edge(u, z, on & near_z, behind & near_z, u1, cell, -1.0)
    z1 = _edge(z, u, on & near_u, behind & near_u, z1, cell, -1.0)
    z0 = floor if down else _edge(z, u, on & near_u, behind & near_u, z0, cell, 1.0)
    if u1 - u0 < LEAST_SIDE_M or z1 - z0 < LEAST_SIDE_M:
        return None
    filled = _is_filled(sides, (u0, u1, z0, z1), thickness, band)
    kind: Literal["door", "window", "opening"] = "window"
    if down and z1 - z0 > DOOR_HEIGHT_M:
        kind = "door" if filled else "opening"
    return Opening(u0, u1, z0, z1, kind, filled, quality)


def _edge(
    at: Array, across: Array, on: NDArray[np.bool_], behind: NDArray[np.bool_], edge: float, cell: float, side: float
) -> float:
    """The edge of a hole: between the last return on the face and the first one behind it, median over strips.

    ``side`` 1 where the hole begins, -1 where it ends.
    """
    reach = 3.0 * cell
    close = np.abs(at - edge) < reach
    strip = np.floor(across / max(2.0 * cell, 0.04)).astype(np.int64)
    a, s = (at * side), strip
    solid = on & close
    if solid.sum() < 3:
        return edge
    first = int(s[close].min())
    count = int(s[close].max()) - first + 1
    last_solid = np.full(count, -np.inf)
    np.maximum.at(last_solid, s[solid] - first, a[solid])
    first_open = np.full(count, np.inf)
    through = behind & close
    np.minimum.at(first_open, s[through] - first, a[through])
    both = np.isfinite(last_solid) & np.isfinite(first_open)
    last_solid[~both & ~np.isfinite(last_solid)] = -1e9
    both &= (first_open - last_solid < 2 * cell)
    both &= first_open > last_solid - 0.5 * cell
    if both.sum() >= 3:
        return side * float(np.median(0.5 * (last_solid[both] + first_open[both])))
    seen = last_solid[last_solid > -1e8]
    return side * float(np.quantile(seen, 0.75)) if len(seen) >= 3 else edge


def _is_filled(sides: list[Crossings], box: tuple[float, float, float, float], thickness: float, band: float) -> bool:
    """Whether something stands in the hole: along its rim (a frame), or over most of it (a leaf or pane)."""
    u0, u1, z0, z1 = box
    height, width = max(int((z1 - z0) / RIM_BIN_M), 1), max(int((u1 - u0) / RIM_BIN_M), 1)
    rim = np.zeros(2 * height + width, dtype=np.int64)
    inner = inner_in = 0
    for c in sides:
        inside = (c.u > u0) & (c.u < u1) & (c.z > z0) & (c.z < z1) & (c.depth > band)
        within = inside & (c.depth < thickness + 0.02)
        gaps = np.stack([c.end_u - u0, u1 - c.end_u, z1 - c.end_z])
        within &= gaps.min(axis=0) > RIM_M[0]
        at_rim = within & (gaps.min(axis=0) < RIM_M[1])
        side = gaps[:, at_rim].argmin(axis=0)
        up = np.clip(((c.end_z[at_rim] - z0) / RIM_BIN_M).astype(np.int64), 0, height - 1)
        over = np.clip(((c.end_u[at_rim] - u0) / RIM_BIN_M).astype(np.int64), 0, width - 1)
        rim += np.bincount(np.choose(side, [up, height + up, 2 * height + over]), minlength=len(rim))
        inner += int(inside.sum())
        inner_in += int(within.sum())
    return bool((rim >= 2).mean() > FILLED_SHARE) or (inner > 20 and inner_in > 0.5 * inner)


def reveal_depth(c: Crossings, opening: Opening, band: float) -> tuple[float | None, float | None]:
    """(depth to which the reveal of an opening goes on, depth of a leaf or pane that closes it), metres; None unknown."""
    u0, u1, z0, z1 = opening.u0, opening.u1, opening.z0, opening.z1
    deep = (c.depth > band) & (c.depth < 0.9) & (c.u > u0) & (c.u < u1) & (c.z > z0) & (c.z < z1)
    beside = (np.abs(c.end_u - u0) < 0.01) | (np.abs(c.end_u - u1) < 0.01)
    beside &= (c.end_z > z0) & (c.end_z < z1)
    over = (np.abs(c.end_z - z1) < 0.01) & (c.end_u > u0) & (c.end_u < u1)
    depth = c.depth[deep & (beside | over)]
    inner = deep & (c.end_u > u0 + 0.1) & (c.end_u < u1 - 0.1) & (c.end_z > z0 + 0.1) & (c.end_z < z1 - 0.1)
    leaf: float | None = None
    width, height = max(u1 - u0 - 0.2, 0.05), max(z1 - z0 - 0.2, 0.05)
    if inner.sum() > 20:
        bins = np.bincount((c.depth[inner] / 0.01).astype(np.int64))
        best = int(np.argmax(bins))
        cells = np.unique(np.floor(c.end_u[inner] / 0.05) * 10007 + np.floor(c.end_z[inner] / 0.05))
        if bins[max(best - 1, 0) : best + 2].sum() > 0.5 * inner.sum() and len(cells) * 0.0025 > 0.4 * width * height:
            leaf = float(np.median(c.depth[inner & (np.abs(c.depth - (best + 0.5) * 0.01) < 0.02)]))
    if len(depth) < 30:
        return None, leaf
    bins = np.bincount((depth / 0.01).astype(np.int64))
    enough = np.flatnonzero(bins >= max(3.0, 0.05 * np.median(bins[bins > 0])))
    last = int(enough[-1]) if len(enough) else 0
    tail = depth[(depth > (last - 1) * 0.01) & (depth < (last + 1) * 0.01)]
    return (float(np.quantile(tail, 0.98)) if len(tail) else None), leaf
