"""Openings of a wall from the occupancy of its faces: where rays went through, or nothing ever came back."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np
from scipy.ndimage import uniform_filter

from .crossings import BEFORE, Crossings
from .hole_rectangles import (
    HIDDEN,
    OPEN,
    SOLID,
    UNKNOWN,
    VOID,
    Cells,
    FaceRaster,
    Rectangle,
    clear_of_edges,
    continued,
    corner_seen,
    framed,
    seen_holes,
    without_islands,
)
from .opening_edges import (
    JUMP_M,
    LEAST_PIER_M,
    SEEN_CELLS,
    SIDES,
    EdgePlace,
    bracket,
    gathered,
    hidden_edge,
    reveal_between,
    reveal_edge,
    seen_edge,
    wall_lines,
)
from .opening_fill import is_filled, solid_back

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
LEAF_M = (0.5, 2.2)
"""Widths of doors, of one leaf or two."""
LEAST_LINTEL_M = 0.1
SAME_HOLE = 0.3
"""Of two openings that share this much of both sides of the smaller one, the larger one stays."""
AROUND_M = 0.4
"""So far around a hole the wall tells how many rays were shot."""
LOST_SHARE = 0.2
"""In a room behind a hole all rays come back but a few; through a window into the open many do not."""
SHALLOWEST_M = 0.05
"""What lies less deep in a wall that was seen from one side is no recess: a part without the lining beside it."""
FLOOR_SIGMA_M = 0.005
"""Of the height at which an opening without a sill ends: that of the floor beside it."""


Kind = Literal["door", "window", "opening", "recess"]


@dataclass(frozen=True)
class Opening:
    """A hole in a wall: places along the wall's line and heights, metres."""

    u0: float
    u1: float
    z0: float
    z1: float
    kind: Kind
    filled: bool
    """A leaf, pane or frame was seen in it, or the back of a recess."""
    quality: float
    """Share of the known cells in the rectangle that are open, 0..1."""
    edge_sigma: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    """Standard deviations of u0, u1, z0, z1 [m]."""
    hidden: tuple[str, ...] = ()
    """Edges that were not seen (names of ``opening_edges.SIDES``): they lie between what was."""
    lost: float = 0.0
    """Share of the rays into it that sent nothing back, 0..1: as many as on the wall around it are taken to have been shot."""
    foot_hidden: bool = False
    """Whether it reaches the floor was not seen, so that it may be a door or a window; its kind is then opening."""
    recess: float = 0.0
    """How deep its solid back lies, of a recess [m]."""
    down: bool = False
    """It was seen to reach the floor."""

    @property
    def width(self) -> float:
        """Metres."""
        return self.u1 - self.u0

    @property
    def height(self) -> float:
        """Metres."""
        return self.z1 - self.z0


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
    for name, chosen in (("on", c.on_face(band)), ("behind", c.depth > band), ("front", c.depth < -BEFORE * band)):
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
    raster = without_islands(raster)
    state = raster.state
    out: list[Opening] = []
    for rectangle in seen_holes(raster, lost):
        i0, i1, k0, k1 = rectangle
        inner = state[i0:i1, k0:k1]
        counts = {s: int((inner == s).sum()) for s in (SOLID, OPEN, VOID, HIDDEN)}
        open_cells = counts[OPEN] + (counts[VOID] if lost else 0)
        known = open_cells + counts[SOLID]
        enough = known >= LEAST_KNOWN * inner.size or corner_seen(state, rectangle)
        if not enough or open_cells < LEAST_FILLED * known:
            continue
        if counts[OPEN] < 0.1 * inner.size and framed(state, rectangle) < LEAST_FRAMED:
            continue
        whole = continued(state, rectangle)
        opening = _refined(raster, sides, whole, floor, thickness, band, open_cells / known)
        if opening is None:
            continue
        opening = replace(opening, lost=_lost_share(raster, sides, opening))
        back = solid_back(sides, (opening.u0, opening.u1, opening.z0, opening.z1), band)
        if back is None or (back < SHALLOWEST_M and _closed(opening, raster)):
            out.append(replace(opening, kind=_kind(opening, lost)))
        elif back >= SHALLOWEST_M:
            out.append(replace(opening, kind="recess", recess=back, foot_hidden=False))
    return _apart(out)


def _closed(opening: Opening, raster: FaceRaster) -> bool:
    """Whether what lies a little deeper, from the floor up, has the size of a leaf and ends below the wall's top: it closes a
    doorway."""
    top = raster.z0 + raster.state.shape[1] * raster.cell
    tall = opening.down and opening.height > DOOR_HEIGHT_M and opening.z1 < top - LEAST_LINTEL_M
    return tall and LEAF_M[0] < opening.width < LEAF_M[1]


def _kind(opening: Opening, lost: bool) -> Kind:
    """By what fills it; rays that do not come back have met panes, or passed them into the open (``lost``)."""
    if opening.foot_hidden:
        return "opening"
    if opening.down and opening.height > DOOR_HEIGHT_M:
        return "door" if opening.filled else "opening"
    return "window" if opening.filled or (lost and opening.lost > LOST_SHARE) else "opening"


def _lost_share(raster: FaceRaster, sides: list[Crossings], opening: Opening) -> float:
    shape, cell = raster.state.shape, raster.cell
    reach = [[raster.u0, raster.u0 + shape[0] * cell], [raster.z0, raster.z0 + shape[1] * cell]]
    rays = np.sum([np.histogram2d(s.u, s.z, shape, reach)[0] for s in sides], axis=0)
    u, z = (low + cell * (np.arange(n) + 0.5) for (low, _), n in zip(reach, shape, strict=True))
    beyond = np.maximum(
        np.maximum(opening.u0 - u, u - opening.u1)[:, None], np.maximum(opening.z0 - z, z - opening.z1)[None]
    )
    inside, around = beyond < -cell, (beyond > cell) & (beyond < AROUND_M) & (raster.state == SOLID)
    if not inside.any() or not np.any(rays[around]):
        return 0.0
    return float(np.clip(1.0 - rays[inside].mean() / rays[around].mean(), 0.0, 1.0))


def _apart(openings: list[Opening]) -> list[Opening]:
    """Pieces of one hole, between things that stand before it, were followed to the same edges: one of them stays."""
    kept: list[Opening] = []
    for o in sorted(openings, key=lambda o: (-o.width * o.height, o.u0)):
        if not any(
            min(o.u1, k.u1) - max(o.u0, k.u0) > SAME_HOLE * o.width and min(o.z1, k.z1) - max(o.z0, k.z0) > SAME_HOLE * o.height
            for k in kept
        ):
            kept.append(o)
    return sorted(kept, key=lambda o: o.u0)


def _refined(
    raster: FaceRaster, sides: list[Crossings], rectangle: Rectangle, floor: float, thickness: float,
    band: float, quality: float,
) -> Opening | None:
    cell = raster.cell
    brackets = _brackets(raster, rectangle)
    u0, u1, z0, z1 = (b[0] for b in brackets)
    down = z0 - floor < DOOR_SILL_M
    foot, sill = (max(round((z - raster.z0) / cell), 0) for z in (floor + DOOR_SILL_M, z0))
    below = raster.state[clear_of_edges(*rectangle[:2]), foot:sill] == SOLID
    wall_below = bool(wall_lines(below.T).any())
    rays = gathered(sides, band)
    near_z = (rays.z > z0 + 0.1 * (z1 - z0)) & (rays.z < z1 - 0.1 * (z1 - z0))
    near_u = (rays.u > u0 + 0.1 * (u1 - u0)) & (rays.u < u1 - 0.1 * (u1 - u0))
    # where little was seen across, the little counts
    near_z = near_z if (near_z & rays.behind).any() else (rays.z > z0) & (rays.z < z1)
    whole_z, whole_u = (rays.z > z0) & (rays.z < z1), (rays.u > u0) & (rays.u < u1)
    found = []
    for k, (inner, outer, far) in enumerate(brackets):
        upright = k < 2
        at, across, near, whole = (
            (rays.u, rays.z, near_z, whole_z) if upright else (rays.z, rays.u, near_u, whole_u)
        )
        end, along_edge = (rays.end_u, rays.end_z) if upright else (rays.end_z, rays.end_u)
        limits = (min(inner, outer) - 2 * cell, max(inner, outer) + 2 * cell)
        lower, upper = (z0, z1) if upright else (u0, u1)
        inside = rays.behind & (along_edge > lower) & (along_edge < upper)
        into = (rays.depth > 0.5 * band) & (rays.depth < thickness) & (along_edge > lower) & (along_edge < upper)
        place = None
        if abs(outer - inner) < (SEEN_CELLS + 0.5) * cell:
            for chosen in (near, whole):
                place = place or seen_edge(
                    at, across, rays.depth, chosen, inner, outer, cell, (1.0, -1.0)[k % 2], band,
                    partial(reveal_between, end, along_edge, rays.depth, into),
                )
        place = place or reveal_edge(end, along_edge, rays.depth, inside, limits, thickness)
        found.append(place or hidden_edge(inner, outer, far, cell))
    down = down or (found[2].seen and found[2].at - floor < DOOR_SILL_M)
    if down:
        found[2] = EdgePlace(floor, FLOOR_SIGMA_M, True)
    u0, u1, z0, z1 = (e.at for e in found)
    if u1 - u0 < LEAST_SIDE_M or z1 - z0 < LEAST_SIDE_M:
        return None
    filled = is_filled(sides, (u0, u1, z0, z1), thickness, band)
    foot_hidden = not found[2].seen and not wall_below and z1 - floor > DOOR_HEIGHT_M
    hidden = tuple(name for name, e in zip(SIDES, found, strict=True) if not e.seen)
    sigmas = found[0].sigma, found[1].sigma, found[2].sigma, found[3].sigma
    return Opening(u0, u1, z0, z1, "opening", filled, quality, sigmas, hidden, foot_hidden=foot_hidden, down=down)


def _brackets(raster: FaceRaster, rectangle: Rectangle) -> list[tuple[float, float, float]]:
    """For each edge the place up to which it is open, that at which it ends, and that from which it is solid [m]."""
    i0, i1, k0, k1 = rectangle
    hole, solid = raster.state == OPEN, raster.state == SOLID
    jump, pier = max(int(JUMP_M / raster.cell), 1), int(np.ceil(LEAST_PIER_M / raster.cell)) + 1
    for _ in range(2):
        u_hole, u_solid = hole[:, k0:k1], solid[:, clear_of_edges(k0, k1)]
        left, right = bracket(u_hole, u_solid, i0, -1, jump, pier), bracket(u_hole, u_solid, i1 - 1, 1, jump, pier)
        i0, i1 = left[0], right[0] + 1
        z_hole, z_solid = hole[i0:i1].T, solid[clear_of_edges(i0, i1)].T
        down, up = bracket(z_hole, z_solid, k0, -1, jump, pier), bracket(z_hole, z_solid, k1 - 1, 1, jump, pier)
        k0, k1 = down[0], up[0] + 1
    c = raster.cell

    def metres(origin: float, lines: tuple[int, int, int], sign: int) -> tuple[float, float, float]:
        inner, outer, far = lines
        low = int(sign < 0)
        return origin + (inner + 1 - low) * c, origin + (outer + low) * c, origin + (far + low) * c

    return [
        metres(raster.u0, left, -1), metres(raster.u0, right, 1), metres(raster.z0, down, -1), metres(raster.z0, up, 1),
    ]
