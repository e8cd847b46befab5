"""A building from a scan campaign."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon, union_all
from shapely.geometry.polygon import orient

from ..errors import BimVerifyError
from ..planes.cloud import Cloud, read_cloud
from ..planes.noise import PointNoise
from ..planes.surfels import Surfels, make_surfels
from ..progress import Progress
from ..scans.campaign import ScanSource
from .building import ASSUMED, BuiltStorey, Reconstruction
from .fitted import Survey, agreement
from .levels import Storey, find_storeys
from .slabs import SMALLEST_SLAB_M2, storey_slabs
from .storey import StoreyDraft, StoreyParts, draft_storey, finish_storey

Array = NDArray[np.float64]

LEAST_ON_OUTLINE = 0.85
LEAST_TURN_DEG, MOST_TURN_DEG, LEAST_ROUND = 3.0, 40.0, 4
"""So many corners of a room that turn so little to the same side are a round wall."""
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
    built = tuple(_storey(k, storeys, parts, rays, surfels, poses.sigma) for k in range(len(storeys)))
    result = Reconstruction(cloud.origin, built, cloud.total, len(cloud.stations), source.paths, poses)
    result.warnings += _warnings(result, storeys)
    return result


def _thinned(cloud: Cloud) -> Cloud:
    step = -(-len(cloud.points) // MOST_POINTS)
    if step == 1:
        return cloud
    return Cloud(cloud.points[::step].copy(), cloud.station[::step].copy(), cloud.stations, cloud.origin, cloud.total)


def _storey(
    k: int, storeys: list[Storey], parts: list[StoreyParts], cloud: Cloud, surfels: Surfels, pose_sigma: float
) -> BuiltStorey:
    storey, part = storeys[k], parts[k]
    name = "Ground floor" if k == 0 else f"Floor {k}"
    slabs = storey_slabs(k, storeys, parts, cloud, surfels, pose_sigma)
    return BuiltStorey(
        name, storey.floor, storey.ceiling, tuple(part.walls), tuple(part.columns), tuple(slabs), tuple(part.built_rooms)
    )


def round_corners(outline: Polygon) -> int:
    """The most corners in a row of a room that turn a little and to the same side."""
    ring = np.array(orient(outline).exterior.coords)[:-1]
    along = np.roll(ring, -1, axis=0) - ring
    course = np.degrees(np.arctan2(along[:, 1], along[:, 0]))
    turn = (course - np.roll(course, 1) + 180.0) % 360.0 - 180.0
    most = 0
    for side in (1.0, -1.0):
        bent = (side * turn > LEAST_TURN_DEG) & (side * turn < MOST_TURN_DEG)
        if bent.all():
            return len(bent)
        first = int(np.argmin(bent))  # a row may go on over the ring's start
        for run in np.split(np.roll(bent, -first), np.flatnonzero(~np.roll(bent, -first))):
            most = max(most, int(run.sum()))
    return most


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
        if built.slab_holes:
            areas = ", ".join(f"{hole.outline.area:.1f}" for hole in built.slab_holes)
            out.append(f"{built.name}: its slab is open over {areas} m2, where rays pass its level.")
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
    for built in result.storeys:
        out += [
            f"{built.name}, wall {k}: {100 * w.step.share:.0f} % of what was seen of a face lies "
            f"{1000 * abs(w.step.by):.0f} mm {'before' if w.step.by < 0 else 'behind'} the rest: a board, a lining, a leaf "
            "that stands open, or wall beside one. The wall has one of the two for its face, or a place between them where "
            "they are less than 15 mm apart."
            for k, w in enumerate(built.walls, start=1) if w.step is not None
        ]
        out += [
            f"{built.name}, room {k}: {turns} corners in a row turn by {LEAST_TURN_DEG:.0f} to {MOST_TURN_DEG:.0f} degrees to "
            "the same side, so a wall is probably round there; it is not modelled as such, but as straight pieces."
            for k, r in enumerate(built.rooms, start=1) if (turns := round_corners(r.outline)) >= LEAST_ROUND
        ]
    recesses = sum(o.kind == "recess" for s in result.storeys for w in s.walls for o in w.openings)
    if recesses:
        out.append(
            f"Openings written as a recess, because their back is solid and no frame stands before it: {recesses}. A closed "
            "leaf without a frame looks alike."
        )
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
