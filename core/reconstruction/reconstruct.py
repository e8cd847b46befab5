"""A building from a scan campaign."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from shapely import MultiPolygon, Polygon, union_all

from ..errors import BimVerifyError
from ..planes.cloud import Cloud, read_cloud
from ..planes.noise import PointNoise
from ..planes.surfels import Surfels, make_surfels
from ..progress import Progress
from ..scans.campaign import ScanSource
from .building import ASSUMED, MEASURED, BuiltSlab, BuiltStorey, FitRecord, Reconstruction
from .fitted import Survey, agreement
from .levels import Storey, find_storeys
from .storey import StoreyDraft, StoreyParts, draft_storey, finish_storey

Array = NDArray[np.float64]

SLAB_M = 0.2
SMALLEST_SLAB_M2 = 1.0
LEAST_ON_OUTLINE = 0.85
THICKEST_SLAB_M = 1.2
SAME_LEVEL_M = 0.05
MOST_POINTS = 12_000_000
"""Rays that are followed; more are thinned evenly, their surfels are not."""


def reconstruct(
    source: ScanSource, sigma: float, memory_gb: float, progress: Progress | None = None,
    registration_sigma: float | None = None,
) -> Reconstruction:
    """Storeys, rooms, walls, openings, columns and slabs of what was scanned.

    ``sigma`` is the standard deviation of a return along its ray [m], ``registration_sigma`` that of a station's position
    (None: from how well the stations agree). The scans must be levelled (z up). Raises
    BimVerifyError when there is nothing that a building could be made of.
    """
    progress = progress or Progress()
    cloud = read_cloud(source, memory_gb, progress.part(0.0, 0.2))
    progress.update(0.2, "Finding surfaces")
    surfels = make_surfels(cloud)
    storeys = find_storeys(surfels, cloud.stations)
    if not storeys:
        raise BimVerifyError(
            f"{', '.join(source.paths)} shows no level floor below any of its {len(cloud.stations)} stations, so no storey "
            "can be told; give scans of rooms, levelled (z up), with their scanner positions."
        )
    noise = PointNoise(sigma)
    rays = _thinned(cloud)
    step = 0.6 / len(storeys)
    drafts: list[StoreyDraft] = []
    for k, storey in enumerate(storeys):
        below = drafts[k - 1] if storey.beside else None
        drafts.append(draft_storey(rays, surfels, storey, noise, progress.part(0.3 + step * k, 0.3 + step * (k + 1)), below))
    poses = agreement([f for d in drafts for f in d.faces], len(cloud.stations), registration_sigma)
    progress.update(0.9, "Fitting faces")
    parts = [finish_storey(d, Survey(cloud.stations, noise, poses)) for d in drafts]
    if not any(p.rooms or p.walls for p in parts):
        raise BimVerifyError(
            f"{', '.join(source.paths)} shows a floor, but no wall and no closed room, so there is no building to write; give "
            "scans from inside rooms."
        )
    built = tuple(_storey(k, storeys, parts, surfels, poses.sigma) for k in range(len(storeys)))
    result = Reconstruction(cloud.origin, built, cloud.total, len(cloud.stations), source.paths, poses)
    result.warnings += _warnings(result, storeys)
    return result


def _thinned(cloud: Cloud) -> Cloud:
    step = -(-len(cloud.points) // MOST_POINTS)
    if step == 1:
        return cloud
    return Cloud(cloud.points[::step].copy(), cloud.station[::step].copy(), cloud.stations, cloud.origin, cloud.total)


def _storey(k: int, storeys: list[Storey], parts: list[StoreyParts], surfels: Surfels, pose_sigma: float) -> BuiltStorey:
    storey, part = storeys[k], parts[k]
    name = "Ground floor" if k == 0 else f"Floor {k}"
    slabs = []
    gap = _to_ceilings_below(storey, storeys[k - 1], parts[k - 1]) if k else None
    measured = gap is not None and 0.05 < gap < THICKEST_SLAB_M
    for foot in _outlines(_on_floor(storey, part, parts[k - 1] if k else None)):
        fit = _level_fit(surfels, storey.floor, 1.0, MEASURED if measured else ASSUMED, pose_sigma)
        slabs.append(BuiltSlab(foot, storey.floor, gap if measured and gap else SLAB_M, "FLOOR" if k else "BASESLAB", fit))
    for level, shapes in _roofs(k, storeys, parts):
        fit = _level_fit(surfels, level, -1.0, ASSUMED, pose_sigma)
        slabs += [BuiltSlab(foot, level + SLAB_M, SLAB_M, "ROOF", fit) for foot in _outlines(shapes)]
    return BuiltStorey(
        name, storey.floor, storey.ceiling, tuple(part.walls), tuple(part.columns), tuple(slabs), tuple(part.built_rooms)
    )


def _to_ceilings_below(storey: Storey, below: Storey, under: StoreyParts) -> float | None:
    """From the floor down to the ceilings of the storey below [m]; None where none was seen under it."""
    if not np.isfinite(below.past):
        return storey.floor - below.ceiling if below.has_ceiling else None
    ceilings = [r.ceiling for r in under.rooms if r.ceiling < storey.floor]
    return storey.floor - float(np.median(ceilings)) if ceilings else None


def _on_floor(storey: Storey, part: StoreyParts, below: StoreyParts | None) -> list[Polygon]:
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


def _outlines(shapes: list[Polygon]) -> list[Polygon]:
    """Of a slab over ``shapes``, without holes."""
    whole = union_all([s.buffer(0.05, join_style="mitre") for s in shapes]).buffer(-0.05, join_style="mitre")
    outlines = list(whole.geoms) if isinstance(whole, MultiPolygon) else [whole]
    return [Polygon(p.exterior).simplify(0.002) for p in outlines if p.area > SMALLEST_SLAB_M2]


def _level_fit(surfels: Surfels, level: float, side: float, source: str, pose_sigma: float) -> FitRecord:
    own = (np.abs(surfels.position[:, 2] - level) < 0.03) & (side * surfels.normal[:, 2] > 0.95)
    if own.sum() < 10:
        return FitRecord(None, None, 0.0, None, source)
    off = surfels.position[own, 2] - level
    return FitRecord(
        float(np.abs(off).mean()), float(np.sqrt((surfels.roughness[own] ** 2).mean())), 1.0,
        float(np.hypot(off.std() / np.sqrt(max(own.sum() / 50, 1)), pose_sigma)), source, int(surfels.count[own].sum()),
    )


def _warnings(result: Reconstruction, storeys: list[Storey]) -> list[str]:
    out = []
    for built, storey in zip(result.storeys, storeys, strict=True):
        if not storey.has_ceiling:
            out.append(f"{built.name}: no ceiling was seen, so its rooms and heights follow from the walls.")
        if any(r.ceiling > storey.past for r in built.rooms):
            out.append(
                f"{built.name}: some of its rooms reach past the next storey's floor (split levels, a gallery): storeys are "
                "parted in plan there, and a wall that goes through both is two, one upon the other, or the lower storey's."
            )
        if not built.rooms:
            out.append(f"{built.name}: no closed room was found.")
    for built in result.storeys[1:]:
        own = union_all([r.outline for r in built.rooms] + [w.footprint for w in built.walls])
        beyond = sum(s.footprint.difference(own.buffer(0.1)).area for s in built.slabs if s.kind == "FLOOR")
        if beyond > SMALLEST_SLAB_M2:
            out.append(
                f"{built.name}: {beyond:.0f} m2 of its slab follow from the ceilings below; what lies on it there was not seen."
            )
    assumed = sum(w.fit.thickness_source == ASSUMED for s in result.storeys for w in s.walls)
    if assumed:
        out.append(f"{assumed} of {result.count('walls')} walls were seen from one side only; their thickness is assumed.")
    columns = [c for s in result.storeys for c in s.columns]
    hidden = sum(bool(c.hidden) for c in columns)
    if hidden:
        out.append(
            f"{hidden} of {len(columns)} columns have a side that no scanner saw; its place follows from where the faces "
            "beside it end."
        )
    unlike = sum(c.on < LEAST_ON_OUTLINE for c in columns)
    if unlike:
        out.append(
            f"{unlike} of {len(columns)} columns have more than {100 * (1 - LEAST_ON_OUTLINE):.0f} % of the returns about them "
            "off their outline: something stands against them, or they are no plain columns."
        )
    return out
