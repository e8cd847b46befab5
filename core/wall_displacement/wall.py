"""The wall in a scan: the largest upright surface, its frame, and the points on it."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..errors import BimVerifyError
from .epoch import Epoch

Array = NDArray[np.float64]
VOXEL_M = 0.15
"""Of the thinned cloud in which the wall is looked for."""
UPRIGHT_SIN = np.sin(np.radians(20.0))
"""A wall's normal may lean this far from the horizontal: battered faces are built at up to 1 : 4."""
SAME_HEADING = np.cos(np.radians(20.0))
CELL_M = 0.3
"""Of the grid of the wall's smooth surface."""
REACH_M = 0.45
"""Points this near to the wall's surface belong to it: panels' thickness, and movements up to it."""
SMALLEST_WALL_M2 = 1.0
MOST_CELLS = 5e7
"""Of a grid that is held in memory."""


@dataclass(frozen=True)
class Wall:
    """A frame on the wall: x along it (horizontal), y out of it, z up. Rows of ``axes`` are the frame's axes.

    wall = axes @ (local - origin). The surface is the median depth y per cell of a grid over x and z; NaN: no points.
    """

    origin: Array
    axes: Array
    low: Array
    """(2,) x and z of the grid's corner."""
    surface: Array
    """(nx, nz) metres."""

    def to_wall(self, points: Array) -> Array:
        """(N, 3) local frame to wall frame."""
        return (points - self.origin) @ self.axes.T

    def to_local(self, points: Array) -> Array:
        """(N, 3) wall frame to local frame."""
        return points @ self.axes + self.origin

    def depth(self, x: Array, z: Array) -> Array:
        """(N,) depth of the smooth surface [m]; NaN off the wall."""
        cell = np.floor((np.column_stack([x, z]) - self.low) / CELL_M).astype(np.int64)
        inside = ((cell >= 0) & (cell < self.surface.shape)).all(axis=1)
        cell[~inside] = 0
        return np.where(inside, self.surface[cell[:, 0], cell[:, 1]], np.nan)

    @property
    def area(self) -> float:
        """Square metres of the cells with points."""
        return float(np.isfinite(self.surface).sum() * CELL_M**2)


def find_wall(epoch: Epoch, near: Array | None = None, within: float = np.inf) -> Wall:
    """The largest upright surface, or the one nearest to ``near`` (3,) [m, local frame] and no farther than ``within`` [m].

    Raises BimVerifyError where there is none.
    """
    voxel = _thin(epoch.points, VOXEL_M)
    normal = _normals(voxel)
    upright = np.abs(normal[:, 2]) < UPRIGHT_SIN
    patch = _patches(voxel[upright], normal[upright])
    sizes = np.bincount(patch) if len(patch) else np.zeros(1, np.int64)
    if sizes.max() * VOXEL_M**2 < SMALLEST_WALL_M2:
        raise BimVerifyError(
            f"{', '.join(epoch.paths) or 'The scan'} holds no upright surface of a square metre; the wall must be in the scan "
            "and its z axis must point up."
        )
    chosen = int(np.argmax(sizes))
    if near is not None:
        large = np.flatnonzero(sizes * VOXEL_M**2 >= SMALLEST_WALL_M2)
        away = [np.linalg.norm(voxel[upright][patch == k] - near, axis=1).min() for k in large]
        chosen = int(large[int(np.argmin(away))])
        if min(away) > within:
            raise BimVerifyError(
                f"The upright surface nearest to the point that was named is {min(away):.0f} m from it; name a point on the "
                "wall, in metres in the scans' frame."
            )
    return _framed(epoch, voxel[upright][patch == chosen])


@dataclass(frozen=True)
class WallPoints:
    """Returns on a wall, wall frame: points (M, 3), the station of each (M,), the stations (S, 3); NaN where not known."""

    points: Array
    station: NDArray[np.int32]
    stations: Array

    def take(self, rows: NDArray[np.bool_] | NDArray[np.int64]) -> WallPoints:
        """Only these points."""
        return WallPoints(self.points[rows], self.station[rows], self.stations)


def on_wall(epoch: Epoch, wall: Wall) -> WallPoints:
    """The points near the wall's surface; isolated ones are left out."""
    points = wall.to_wall(epoch.points)
    depth = wall.depth(points[:, 0], points[:, 2])
    rows = np.flatnonzero(np.abs(points[:, 1] - depth) < REACH_M)
    rows = rows[_has_company(points[rows])]
    return WallPoints(points[rows], epoch.station[rows], wall.to_wall(epoch.stations))


def spacing_on(points: Array) -> float:
    """Point spacing on the wall [m]: the square root of the area per point in the most usual density.

    The density is the median over 10 cm squares that hold points (larger squares for sparse scans).
    """
    if not len(points):
        return float("inf")
    x, z = points[:, 0] - points[:, 0].min(), points[:, 2] - points[:, 2].min()
    edge, middle = 0.1, 1.0
    for _ in range(6):
        rows = int(z.max() / edge) + 1
        count = np.bincount((x / edge).astype(np.int64) * rows + (z / edge).astype(np.int64))
        middle = float(np.median(count[count > 0]))
        if middle >= 8:
            break
        edge *= 1.5
    return float(edge / np.sqrt(max(middle, 1.0)))


def _has_company(points: Array) -> NDArray[np.bool_]:
    """False for outliers: fewer than 2 % of the usual number of points within their cell and its 26 neighbours."""
    if not len(points):
        return np.zeros(0, np.bool_)
    edge = max(0.1, 4 * spacing_on(points))
    low = points.min(axis=0) - edge
    shape = ((points.max(axis=0) - low) / edge).astype(np.int64) + 2
    if np.prod(shape.astype(np.float64)) > MOST_CELLS:
        return np.ones(len(points), np.bool_)
    key = _cell_keys(points, low, edge, shape)
    around = np.bincount(key, minlength=int(np.prod(shape))).reshape(shape)
    for axis in range(3):
        around = around + np.roll(around, 1, axis) + np.roll(around, -1, axis)
    own = around.ravel()[key]
    return np.asarray(own >= 0.02 * np.median(own))


def _cell_keys(points: Array, low: Array, edge: float, shape: NDArray[np.int64]) -> NDArray[np.int64]:
    """(N,) numbers of the cells of a grid over all three axes."""
    x, y, z = (((points[:, k] - low[k]) / edge).astype(np.int64) for k in range(3))
    return np.asarray((x * shape[1] + y) * shape[2] + z)


def _thin(points: Array, edge: float) -> Array:
    """Means of the points in each cell of a grid."""
    low = points.min(axis=0)
    shape = ((points.max(axis=0) - low) / edge).astype(np.int64) + 1
    if np.prod(shape.astype(np.float64)) > 2**62:
        return points[:: max(len(points) // 200_000, 1)]
    key = _cell_keys(points, low, edge, shape)
    if np.prod(shape.astype(np.float64)) > MOST_CELLS:
        key = np.unique(key, return_inverse=True)[1].ravel()
    count = np.bincount(key)
    total = np.stack([np.bincount(key, weights=points[:, k]) for k in range(3)], axis=1)
    return np.asarray(total[count > 0] / count[count > 0, None])


def _normals(points: Array, neighbours: int = 12) -> Array:
    k = min(neighbours, len(points))
    if k < 3:
        return np.tile([0.0, 0.0, 1.0], (len(points), 1))
    _, near = cKDTree(points).query(points, k=k)
    local = points[near] - points[near].mean(axis=1, keepdims=True)
    return np.linalg.eigh(np.einsum("nki,nkj->nij", local, local))[1][:, :, 0]


def _patches(points: Array, normal: Array) -> NDArray[np.int64]:
    """(N,) number of the connected patch of like heading that each point belongs to."""
    if not len(points):
        return np.zeros(0, np.int64)
    pairs = cKDTree(points).query_pairs(3.0 * VOXEL_M, output_type="ndarray")
    first, second = pairs[:, 0], pairs[:, 1]
    like = np.abs(np.einsum("ij,ij->i", normal[first], normal[second])) > SAME_HEADING
    step = points[second] - points[first]
    off = np.abs(np.einsum("ij,ij->i", step, normal[first]))
    pairs = pairs[like & (off < 0.5 * np.linalg.norm(step, axis=1) + 0.05)]
    graph = coo_array((np.ones(len(pairs), np.int8), (pairs[:, 0], pairs[:, 1])), shape=(len(points), len(points)))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def _framed(epoch: Epoch, members: Array) -> Wall:
    origin = np.median(members, axis=0)
    level = members[:, :2] - origin[:2]
    along = np.linalg.svd(level - level.mean(axis=0), full_matrices=False)[2][0]
    out = np.array([along[1], -along[0], 0.0])
    known = epoch.stations[np.isfinite(epoch.stations).all(axis=1)]
    side = float(np.sum((known - origin) @ out)) if len(known) else 0.0
    if side == 0.0:
        side = -_skew((members - origin) @ out)
    out *= 1.0 if side >= 0 else -1.0
    up = np.array([0.0, 0.0, 1.0])
    axes = np.stack([np.cross(out, up), out, up])
    placed = (members - origin) @ axes.T
    low = placed[:, [0, 2]].min(axis=0) - CELL_M
    shape = tuple(np.ceil((placed[:, [0, 2]].max(axis=0) + CELL_M - low) / CELL_M).astype(int))
    surface = _cell_medians(placed, low, shape, CELL_M)
    grown = _grow(_grow(surface))
    return Wall(origin, axes, low, grown)


def resurfaced(wall: Wall, points: Array) -> Wall:
    """The same frame and grid with the smooth surface of other points (N, 3), wall frame."""
    return replace(wall, surface=_grow(_grow(_cell_medians(points, wall.low, wall.surface.shape, CELL_M))))


def _skew(values: Array) -> float:
    centred = values - np.median(values)
    return float(np.mean(centred**3))


def _cell_medians(points: Array, low: Array, shape: tuple[int, ...], edge: float) -> Array:
    cell = np.floor((points[:, [0, 2]] - low) / edge).astype(np.int64)
    inside = ((cell >= 0) & (cell < shape)).all(axis=1)
    points, cell = points[inside], cell[inside]
    key = cell[:, 0] * shape[1] + cell[:, 1]
    order = np.lexsort((points[:, 1], key))
    keys, first, count = np.unique(key[order], return_index=True, return_counts=True)
    out = np.full(shape[0] * shape[1], np.nan)
    out[keys] = points[order, 1][first + count // 2]
    return out.reshape(shape)


def _grow(surface: Array) -> Array:
    """Cells without points next to cells with some take their neighbours' median depth."""
    neighbours = np.stack([np.roll(np.roll(_pad(surface), i, 0), j, 1)[1:-1, 1:-1] for i in (-1, 0, 1) for j in (-1, 0, 1)])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # cells whose neighbours are empty too
        middle = np.nanmedian(neighbours, axis=0)
    return np.where(np.isfinite(surface), surface, middle)


def _pad(surface: Array) -> Array:
    return np.pad(surface, 1, constant_values=np.nan)


def smooth(surface: Array) -> Array:
    """Median over 3 x 3 cells, cells without points left as they are."""
    known = np.isfinite(surface)
    filled = np.where(known, surface, np.nanmedian(surface))
    return np.where(known, median_filter(filled, size=3, mode="nearest"), np.nan)
