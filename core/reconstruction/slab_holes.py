"""Holes of a slab between two storeys, as for a stair: rays pass its level there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label
from shapely import Polygon, box, contains_xy, union_all
from shapely.affinity import affine_transform

from ..planes.cloud import Cloud
from ..planes.surfels import Surfels
from .through import CELL_M, IN_FLOOR_M, floor_cells, passing, seen_through, turned

Array = NDArray[np.float64]

LEAST_M2 = 0.25
INSIDE_M = 0.1
MOST_FLOOR = 0.03
"""Of the rectangle about a hole, floor may be seen in this share: else it is no rectangle."""
LEAST_SHARE = 0.5
"""Of the rectangle in which rays pass: the rest may be hidden by a stair."""
NEAR_M = 0.3
LEVEL_M = 0.02
LEAST_ON_EDGE = 30
STRAY = 5
MOST_SPREAD_M = 0.01
FACE_SIGMA_M = 0.002
CORNER_M = 0.1


@dataclass(frozen=True)
class SlabHole:
    """An opening through a slab, local frame, metres."""

    outline: Polygon
    along: Array
    """(2,) unit vector of its length."""
    size: tuple[float, float] | None
    """Length and width of a rectangle; None of what is none."""
    size_sigma: tuple[float, float]
    edge_sigma: float
    """Standard deviation of the edge that is known worst."""
    seen: float
    """Share of it through which rays pass, 0..1."""


def find_holes(
    cloud: Cloud, surfels: Surfels, footprint: Polygon, floor: float, thickness: float, along: Array, pose_sigma: float
) -> list[SlabHole]:
    """Largest first. ``along``: direction of the storey's walls, in which rectangles lie; ``pose_sigma`` of a station [m]."""
    corners = turned(np.array(footprint.exterior.coords), along)
    low = corners.min(axis=0)
    shape = tuple(int(n) for n in (np.ptp(corners, axis=0) / CELL_M + 1))
    cells = np.column_stack([i.ravel() for i in np.indices(shape)])
    middles = turned(low + (cells + 0.5) * CELL_M, _back(along))
    within = contains_xy(footprint.buffer(-INSIDE_M), *middles.T).reshape(shape)
    through = seen_through(cloud, surfels, floor, low, shape, along, within)
    pieces, count = label(through)
    numbers = [n for n in range(1, count + 1) if (pieces == n).sum() * CELL_M**2 > LEAST_M2]
    if not numbers:
        return []
    there = floor_cells(surfels, floor, low, shape, along)
    places = _Places(cloud, floor, thickness, along, pose_sigma)
    holes = [_hole(pieces == n, there, low, along, places) for n in numbers]
    return sorted(holes, key=lambda hole: -hole.outline.area)


def _back(along: Array) -> Array:
    return np.array([along[0], -along[1]])


class _Places:
    """Where rays pass a slab, and returns on its edges and beside them; (N, 2) in the direction of the storey's walls."""

    def __init__(self, cloud: Cloud, floor: float, thickness: float, along: Array, pose_sigma: float) -> None:
        self.sigma = float(np.hypot(FACE_SIGMA_M, pose_sigma))
        rays = passing(cloud, floor)
        end, start = cloud.points[rays].astype(np.float64), cloud.stations[cloud.station[rays]]
        places = []
        for depth in (0.0, *IN_FLOOR_M, thickness):
            t = (floor - depth - start[:, 2]) / (end[:, 2] - start[:, 2])
            on = (t > 0.0) & (t < 1.0)
            places.append(start[on, :2] + t[on, None] * (end - start)[on, :2])
        self.through = turned(np.concatenate(places), along)
        z = cloud.points[:, 2]
        beside = (np.abs(z - floor) < LEVEL_M) | (np.abs(z - floor + thickness) < LEVEL_M)
        self.beside = turned(cloud.points[beside, :2].astype(np.float64), along)
        edge = (z > floor - thickness + LEVEL_M) & (z < floor - LEVEL_M)
        self.edge = turned(cloud.points[edge, :2].astype(np.float64), along)

    def border(self, axis: int, side: float, ends: tuple[float, float], low: float, high: float) -> tuple[float, float]:
        """Place of an edge and its sigma [m]; ``side`` 1: the slab lies on the far side of it. The hole is between ``ends``.

        Between ``low`` and ``high`` across the axis. Returns on the face of the slab's edge tell it; else it lies between the
        last ray that passes and the first return on the floor or the ceiling below.
        """

        def near(places: Array) -> Array:
            across = places[:, 1 - axis]
            own = (across > low) & (across < high)
            return np.asarray(side * places[own, axis])

        passes = near(self.through)
        inside = (passes > min(side * e for e in ends)) & (passes < max(side * e for e in ends))
        last = float(passes[inside].max(initial=side * sum(ends) / 2))

        def beyond_it(places: Array) -> Array:
            across = near(places)
            return np.sort(across[(across > last - MOST_SPREAD_M) & (across < last + NEAR_M)])

        on, beyond = beyond_it(self.edge), beyond_it(self.beside)
        if len(on) >= LEAST_ON_EDGE:
            middle = float(np.median(on))
            if np.median(np.abs(on - middle)) < MOST_SPREAD_M:
                return side * middle, self.sigma
        # beams that straddle the edge return from beside it
        first = max(float(beyond[STRAY]), last) if len(beyond) > STRAY else last + NEAR_M
        return side * 0.5 * (last + first), float(np.hypot((first - last) / np.sqrt(12.0), self.sigma))


def _hole(cells: NDArray[np.bool_], there: NDArray[np.bool_], low: Array, along: Array, places: _Places) -> SlabHole:
    ix, iy = np.nonzero(cells)
    i0, i1, j0, j1 = int(ix.min()), int(ix.max()) + 1, int(iy.min()), int(iy.max()) + 1
    back = [along[0], -along[1], along[1], along[0], 0.0, 0.0]
    share, floor = cells[i0:i1, j0:j1].mean(), there[i0:i1, j0:j1].mean()
    if share < LEAST_SHARE or floor > MOST_FLOOR:
        squares = [box(i, j, i + 1, j + 1) for i, j in zip(ix, iy, strict=True)]
        shape = affine_transform(union_all(squares), [CELL_M, 0.0, 0.0, CELL_M, *low])
        outline = affine_transform(Polygon(shape.exterior).simplify(CELL_M), back)
        return SlabHole(outline, along, None, (CELL_M, CELL_M), CELL_M, 1.0)
    (u0, v0), (u1, v1) = low + np.array([i0, j0]) * CELL_M, low + np.array([i1, j1]) * CELL_M
    across = (v0 + CORNER_M, v1 - CORNER_M), (u0 + CORNER_M, u1 - CORNER_M)
    (a, sa), (b, sb) = (places.border(0, side, (u0, u1), *across[0]) for side in (-1.0, 1.0))
    (c, sc), (d, sd) = (places.border(1, side, (v0, v1), *across[1]) for side in (-1.0, 1.0))
    outline = affine_transform(box(a, c, b, d), back)
    sizes = sorted([(b - a, float(np.hypot(sa, sb)), along), (d - c, float(np.hypot(sc, sd)), np.array([-along[1], along[0]]))],
                   key=lambda s: -s[0])  # fmt: skip
    (length, length_sigma, direction), (width, width_sigma, _) = sizes
    return SlabHole(outline, direction, (length, width), (length_sigma, width_sigma), max(sa, sb, sc, sd), float(share))
