"""Slabs of a storey: its floor, and the roofs over what nothing stands on."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from shapely import MultiPolygon, Polygon, set_precision, union_all

from ..planes.cloud import Cloud
from ..planes.surfels import Surfels
from .building import ASSUMED, MEASURED, BuiltSlab, FitRecord
from .levels import Storey
from .slab_holes import find_holes
from .storey import StoreyParts

SLAB_M = 0.2
SMALLEST_SLAB_M2 = 1.0
THICKEST_SLAB_M = 1.2
SAME_LEVEL_M = 0.05
GAP_M = 0.05
"""Shapes no farther apart than twice this are one slab."""
GRID_M = 1e-6


def storey_slabs(
    k: int, storeys: list[Storey], parts: list[StoreyParts], cloud: Cloud, surfels: Surfels, pose_sigma: float
) -> list[BuiltSlab]:
    """Floor and roofs of storey ``k``."""
    storey, part = storeys[k], parts[k]
    gap = _to_ceilings_below(storey, storeys[k - 1], parts[k - 1]) if k else None
    thickness, source = (gap, MEASURED) if gap is not None and 0.05 < gap < THICKEST_SLAB_M else (SLAB_M, ASSUMED)
    fit = _level_fit(surfels, storey.floor, 1.0, source, pose_sigma)
    feet = outlines(on_floor(storey, part, parts[k - 1] if k else None))
    slabs = [BuiltSlab(foot, storey.floor, thickness, "FLOOR" if k else "BASESLAB", fit) for foot in feet]
    if k and part.walls:
        along = max(part.walls, key=lambda w: w.length).along
        holes = [find_holes(cloud, surfels, s.footprint, s.top, thickness, along, pose_sigma) for s in slabs]
        slabs = [replace(s, holes=tuple(own)) for s, own in zip(slabs, holes, strict=True)]
    for level, shapes in _roofs(k, storeys, parts):
        fit = _level_fit(surfels, level, -1.0, ASSUMED, pose_sigma)
        slabs += [BuiltSlab(foot, level + SLAB_M, SLAB_M, "ROOF", fit) for foot in outlines(shapes)]
    return slabs


def _to_ceilings_below(storey: Storey, below: Storey, under: StoreyParts) -> float | None:
    """From the floor down to the ceilings of the storey below [m]; None where none was seen under it."""
    if not np.isfinite(below.past):
        return storey.floor - below.ceiling if below.has_ceiling else None
    ceilings = [r.ceiling for r in under.rooms if r.ceiling < storey.floor]
    return storey.floor - float(np.median(ceilings)) if ceilings else None


def on_floor(storey: Storey, part: StoreyParts, below: StoreyParts | None) -> list[Polygon]:
    """What a storey's slab carries: its rooms and walls, and what lies over the storey below whose ceilings were seen."""
    shapes = _shapes(part, range(len(part.rooms))) + [w.footprint for w in part.walls if not w.rooms]
    if below is not None and shapes:
        rooms = zip(below.rooms, below.built_rooms, strict=True)
        covered = [k for k, (r, b) in enumerate(rooms) if b.ceiling_face is not None and r.ceiling < storey.floor]
        shapes += [below.rooms[k].outline for k in covered] if storey.beside else _shapes(below, covered)
    return shapes


def _shapes(part: StoreyParts, rooms: Iterable[int]) -> list[Polygon]:
    """Rooms and their walls."""
    own = set(rooms)
    return [part.rooms[k].outline for k in own] + [w.footprint for w in part.walls if own & set(w.rooms)]


def _roofs(k: int, storeys: list[Storey], parts: list[StoreyParts]) -> list[tuple[float, list[Polygon]]]:
    """Heights of the ceilings over which no storey stands, with what they cover; one over several storeys is the last one's."""
    storey, part, last = storeys[k], parts[k], len(storeys) - 1
    if k == last:
        under = _shapes(part, range(len(part.rooms)))
        for below, rooms in zip(storeys[:k], parts[:k], strict=True):
            under += _shapes(rooms, (r for r, level in _past(below, rooms) if abs(level - storey.ceiling) < SAME_LEVEL_M))
        return [(storey.ceiling, under)] if storey.has_ceiling else []
    out: list[tuple[float, list[Polygon]]] = []
    groups: list[list[tuple[int, float]]] = []
    for room, level in sorted(_past(storey, part), key=lambda found: found[1]):
        carried = any(0.0 < s.floor - level < THICKEST_SLAB_M for s in storeys)
        if carried or (storeys[last].has_ceiling and abs(level - storeys[last].ceiling) < SAME_LEVEL_M):
            continue
        if groups and level - groups[-1][-1][1] < SAME_LEVEL_M:
            groups[-1].append((room, level))
        else:
            groups.append([(room, level)])
    for group in groups:
        out.append((float(np.median([level for _, level in group])), _shapes(part, (room for room, _ in group))))
    return out


def _past(storey: Storey, part: StoreyParts) -> list[tuple[int, float]]:
    """Rooms that reach past the next storey's floor, with their ceilings."""
    return [(k, r.ceiling) for k, r in enumerate(part.rooms) if r.ceiling > storey.past]


def outlines(shapes: list[Polygon]) -> list[Polygon]:
    """Of a slab over ``shapes``, without holes."""
    whole = shrunk(union_all([s.buffer(GAP_M, join_style="mitre") for s in shapes]), GAP_M)
    outlines = list(whole.geoms) if isinstance(whole, MultiPolygon) else [whole]
    return [Polygon(p.exterior).simplify(0.002) for p in outlines if p.area > SMALLEST_SLAB_M2]


def shrunk(whole: Polygon | MultiPolygon, by: float) -> Polygon | MultiPolygon:
    """``whole`` without its border of width ``by`` [m].

    With a few outlines the library gives nothing for mitred corners; on a grid, or without them, it does.
    """
    found = whole.buffer(-by, join_style="mitre")
    if found.area < whole.area - 2.0 * by * whole.length:
        found = set_precision(whole, GRID_M).buffer(-by, join_style="bevel")
    return found


def _level_fit(surfels: Surfels, level: float, side: float, source: str, pose_sigma: float) -> FitRecord:
    own = (np.abs(surfels.position[:, 2] - level) < 0.03) & (side * surfels.normal[:, 2] > 0.95)
    if own.sum() < 10:
        return FitRecord(None, None, 0.0, None, source)
    off = surfels.position[own, 2] - level
    return FitRecord(
        float(np.abs(off).mean()), float(np.sqrt((surfels.roughness[own] ** 2).mean())), 1.0,
        float(np.hypot(off.std() / np.sqrt(max(own.sum() / 50, 1)), pose_sigma)), source, int(surfels.count[own].sum()),
    )
