"""One pass over all stations: what each saw of every query position, and why it did not see the others."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..evidence.collect import StationIndexes
from ..evidence.gather import SensorModel
from ..evidence.sightings import VISIBLE_SPACINGS
from ..evidence.station_index import StationIndex
from ..model.elements import BuildingModel
from ..model.on_element import ElementSurfaces
from ..model.raycast import RayScene
from ..model.samples import SurfaceSamples
from ..parallel import in_chunks
from ..progress import Progress
from ..scans.store import in_sector
from .field_of_view import FieldOfView, FieldOfViewCounter
from .local_surface import REACH, LocalSurface, measure_surface
from .missing import (
    ABSORBED,
    GRAZING,
    OCCLUDED,
    OUT_OF_RANGE,
    OUTSIDE_VIEW,
    PASSED,
    SEEN,
    TURNED_AWAY,
    BestView,
    Limits,
    half_lost,
)
from .options import QualityOptions

Array = NDArray[np.float64]
SIGHT_TOLERANCE_M = 0.003
"""What the plan puts no more than this before a surface does not hide it: touching faces, chords of curved ones."""
STEEP_ENOUGH = 0.35
"""Cosine from which on a view takes part in the comparison of stations (70 degrees)."""
FEWEST_FOR_OVERLAP = 10
"""Returns of a plane that takes part in the comparison of stations."""
FAINTNESS_EDGES = np.geomspace(0.05, 4e6, 181)
"""Of distance^2 / cos(incidence) [m2]: what a surface sends back goes with its inverse (the laser's equation)."""
EDGE_RETURNS = 60_000
"""Returns near edges that one station gives to the study of edge noise."""


@dataclass
class Survey:
    """What the pass found. Per query position (N,) unless said otherwise; metres, local frame."""

    best: BestView
    density: Array
    """Returns per m2 of surface, all stations that see it."""
    stations: NDArray[np.int16]
    """How many see it."""
    square: Array
    """Sum of squared residuals from local planes, and its degrees of freedom, away from edges."""
    freedom: Array
    square_near: Array
    """The same near edges: of slender members there is nothing else."""
    freedom_near: Array
    moved: Array
    """How far the surface stands before its plan, along the normal; it is measured there."""
    overlap: list[Overlap]
    """One a station."""
    views: list[FieldOfView]
    """One a station."""
    edge_point: list[Array] = field(default_factory=list)
    """(K, 3) returns near edges, one array a tile, with the sample they were found at, and their station."""
    edge_sample: list[NDArray[np.int64]] = field(default_factory=list)
    edge_station: list[NDArray[np.int16]] = field(default_factory=list)
    limits: Limits = field(default_factory=lambda: Limits(math.inf, -math.pi / 2, math.pi / 2, math.inf, math.pi / 2))

    @property
    def seen(self) -> NDArray[np.bool_]:
        return self.best.state == SEEN

    @property
    def spacing(self) -> Array:
        """Distance between returns of all stations together [m]; NaN where there are none."""
        with np.errstate(divide="ignore"):
            return np.where(self.density > 0, 1.0 / np.sqrt(np.maximum(self.density, 1e-30)), np.nan)


@dataclass
class Overlap:
    """Offsets of one station's local planes, to be compared with other stations'."""

    row: list[NDArray[np.int64]] = field(default_factory=list)
    offset: list[Array] = field(default_factory=list)
    variance: list[Array] = field(default_factory=list)


@dataclass
class _Silent:
    """Views that nothing planned obstructs and from which nothing came back; judged when the limits are known."""

    row: list[NDArray[np.int64]] = field(default_factory=list)
    station: list[NDArray[np.int16]] = field(default_factory=list)
    cosine: list[Array] = field(default_factory=list)
    distance: list[Array] = field(default_factory=list)
    direction: list[Array] = field(default_factory=list)


def survey(
    model: BuildingModel,
    samples: SurfaceSamples,
    stations: StationIndexes,
    scene: RayScene,
    edge: Array,
    moved: Array,
    options: QualityOptions,
    progress: Progress,
) -> Survey:
    """Look at all exposed samples from all stations. ``edge`` (N,) is each sample's distance to the nearest edge [m],
    ``moved`` (N,) how far its surface stands before the plan [m]: there it is measured."""
    count = len(samples)
    built = samples.position + moved[:, None] * samples.normal
    found = Survey(
        best=BestView.empty(count), density=np.zeros(count), stations=np.zeros(count, np.int16),
        square=np.zeros(count), freedom=np.zeros(count), square_near=np.zeros(count), freedom_near=np.zeros(count),
        moved=moved, overlap=[Overlap() for _ in stations.stations], views=[],
    )
    surfaces = ElementSurfaces(model)
    silent = _Silent()
    counters = [FieldOfViewCounter(s.rotation) for s in stations.stations]
    tally = np.zeros((2, len(FAINTNESS_EDGES)), np.int64)
    exposed = np.flatnonzero(samples.exposed)
    for station, index, sector in stations.visit(SensorModel(0.0, 0.0), progress):
        counters[station].add(index.returns)
        position = stations.position[station]
        relative = built[exposed] - position
        row = exposed
        if sector is not None:
            own = in_sector(relative, *sector)
            row, relative = exposed[own], relative[own]
        _look(found, silent, tally, station, index, position, row, relative, samples, scene, surfaces, edge, options)
    for station in np.flatnonzero([math.isnan(s) for s in stations.spacing]):  # nothing came back to it
        position = stations.position[station]
        relative = samples.position[exposed] - position
        facing = np.einsum("ij,ij->i", relative, samples.normal[exposed]) < 0
        row, relative = exposed[facing], relative[facing]
        _quiet(found, silent, int(station), position, row, relative, samples, scene)
    found.views = [c.result() for c in counters]
    _judge(found, silent, tally, stations, samples, model, options)
    return found


def _look(
    found: Survey, silent: _Silent, tally: NDArray[np.int64], station: int,
    index: StationIndex, position: Array, row: NDArray[np.int64], relative: Array, samples: SurfaceSamples,
    scene: RayScene, surfaces: ElementSurfaces, edge: Array, options: QualityOptions,
) -> None:
    """Everything about one station (or one sector of it). ``relative`` (K, 3): from it to where the surface stands."""
    distance = np.linalg.norm(relative, axis=1)
    facing = np.einsum("ij,ij->i", relative, samples.normal[row]) < 0
    away = row[~facing]
    found.best.offer(
        away, np.full(len(away), TURNED_AWAY, np.int8), station, np.zeros(len(away)), distance[~facing],
        np.full((len(away), 3), np.nan),
    )
    row, relative = row[facing], relative[facing]
    seen = measure_surface(index, relative, samples.normal[row], options.window)
    steepest = math.cos(options.max_incidence)
    close = seen.nearest_dy <= VISIBLE_SPACINGS * index.spacing_rad * seen.distance
    at = close & (np.abs(seen.level) <= options.window)
    front = close & (seen.level > options.window)
    through = np.flatnonzero(close & (seen.level < -options.window))
    through_face = np.zeros(len(row), dtype=np.bool_)
    through_face[through] = _meets_face(index, seen, position, through, row, samples, surfaces)
    # a ray that passes beside the element says nothing; the closest one that met its surface does
    beside = close & (seen.level < -options.window) & ~through_face
    at |= beside & (seen.on_dy <= VISIBLE_SPACINGS * index.spacing_rad * seen.distance)
    # met too steeply, a return in the window may lie a metre away along the surface, on something else
    at &= seen.cosine >= steepest
    silent_view = ~at & ~front & ~through_face

    state = np.full(len(row), SEEN, np.int8)
    state[front] = OCCLUDED
    state[through_face] = PASSED
    blocker = np.full((len(row), 3), np.nan)
    blocked = np.flatnonzero(front)
    blocker[blocked] = position + index.returns[seen.nearest[blocked]]

    told = ~silent_view
    found.best.offer(row[told], state[told], station, seen.cosine[told], seen.distance[told], blocker[told])
    quiet = row[silent_view]  # what the plan puts before them is asked where the plan puts them
    _quiet(found, silent, station, position, quiet, samples.position[quiet] - position, samples, scene)
    _count(tally, 1, seen.distance[at], seen.cosine[at])
    _keep_surface(found, station, index, position, row, seen, at, samples, edge)


def _quiet(
    found: Survey, silent: _Silent, station: int, position: Array, row: NDArray[np.int64], relative: Array,
    samples: SurfaceSamples, scene: RayScene,
) -> None:
    """Views from which no ray came back: what is planned before the surface hides it, the others are judged later."""
    distance = np.linalg.norm(relative, axis=1)
    cosine = -np.einsum("ij,ij->i", relative, samples.normal[row]) / np.maximum(distance, 1e-9)
    planned = _first_planned(scene, position, samples, row, distance, relative)
    hidden = np.isfinite(planned)
    blocker = position + relative[hidden] * (planned[hidden] / distance[hidden])[:, None]
    found.best.offer(
        row[hidden], np.full(int(hidden.sum()), OCCLUDED, np.int8), station, cosine[hidden], distance[hidden], blocker
    )
    silent.row.append(row[~hidden])
    silent.station.append(np.full(int((~hidden).sum()), station, np.int16))
    silent.cosine.append(cosine[~hidden])
    silent.distance.append(distance[~hidden])
    silent.direction.append(relative[~hidden] / np.maximum(distance[~hidden], 1e-9)[:, None])


def _count(tally: NDArray[np.int64], which: int, distance: Array, cosine: Array) -> None:
    """Views that were answered (1) or not (0), by how faint their answer is."""
    faint = distance**2 / np.maximum(cosine, 1e-3)
    place = np.clip(np.searchsorted(FAINTNESS_EDGES, faint, side="right") - 1, 0, len(FAINTNESS_EDGES) - 1)
    tally[which] += np.bincount(place, minlength=len(FAINTNESS_EDGES))


def _meets_face(
    index: StationIndex, seen: LocalSurface, position: Array, at: NDArray[np.int64], row: NDArray[np.int64],
    samples: SurfaceSamples, surfaces: ElementSurfaces,
) -> NDArray[np.bool_]:
    """(K,) whether the ray of the nearest return crosses the element's own face, not the air beside it."""
    r = row[at]
    ray = index.returns[seen.nearest[at]].astype(np.float64)
    ray = ray / np.linalg.norm(ray, axis=1, keepdims=True)
    n = samples.normal[r]
    slope = np.einsum("ij,ij->i", ray, n)
    to_plane = np.einsum("ij,ij->i", samples.position[r] - position, n) / np.where(np.abs(slope) < 1e-6, -1e-6, slope)
    crossing = position + ray * to_plane[:, None]
    return surfaces.face_at(crossing, n, samples.element[r], samples.triangle[r], 0.005) >= 0


def _first_planned(
    scene: RayScene, position: Array, samples: SurfaceSamples, row: NDArray[np.int64], distance: Array, relative: Array
) -> Array:
    """(K,) range of the first planned surface before each sample [m]; infinite where the line of sight is free."""
    out = np.full(len(row), np.inf)

    def work(part: slice) -> None:
        ray = relative[part] / np.maximum(distance[part], 1e-9)[:, None]
        reach = distance[part] - SIGHT_TOLERANCE_M
        origin = np.broadcast_to(position, ray.shape)
        out[part] = scene.first_hit(origin, ray, np.maximum(reach, 1e-6))[0]

    in_chunks(len(row), work)
    return out


def _keep_surface(
    found: Survey, station: int, index: StationIndex, position: Array, row: NDArray[np.int64], seen: LocalSurface,
    is_seen: NDArray[np.bool_], samples: SurfaceSamples, edge: Array,
) -> None:
    """Density, noise, overlap and edge returns of the samples that this station sees."""
    at = np.flatnonzero(is_seen)
    r = row[at]
    reach = REACH * index.spacing_rad * seen.distance[at]
    local = reach * np.sqrt(np.pi / np.maximum(seen.rays[at], 1))
    found.density[r] += seen.cosine[at] / np.maximum(local, 1e-9) ** 2
    found.stations[r] += 1
    inner = edge[r] > reach / np.maximum(seen.cosine[at], 0.1)
    fitted = np.isfinite(seen.square[at]) & (seen.on[at] > 3)
    good = inner & fitted
    outer = ~inner & fitted
    found.square_near[r[outer]] += seen.square[at[outer]]
    found.freedom_near[r[outer]] += seen.on[at[outer]] - 3
    found.square[r[good]] += seen.square[at[good]]
    found.freedom[r[good]] += seen.on[at[good]] - 3
    use = good & (seen.cosine[at] > STEEP_ENOUGH) & (seen.on[at] >= FEWEST_FOR_OVERLAP)
    overlap = found.overlap[station]
    overlap.row.append(r[use])
    overlap.offset.append(seen.offset[at[use]])
    overlap.variance.append(seen.square[at[use]] / (seen.on[at[use]] - 3.0) / seen.on[at[use]])
    near = np.flatnonzero((edge[r] <= 0.5 * reach) & (found.moved[r] == 0))  # edges are looked for where they are planned
    near = near[:: max(len(near) // EDGE_RETURNS, 1)]
    found.edge_point.append(position + index.returns[seen.nearest[at[near]]])
    found.edge_sample.append(r[near])
    found.edge_station.append(np.full(len(near), station, np.int16))


def _judge(
    found: Survey, silent: _Silent, tally: NDArray[np.int64], stations: StationIndexes,
    samples: SurfaceSamples, model: BuildingModel, options: QualityOptions,
) -> None:
    """Put a cause to the silent views: the limits of the scanners follow from all views together."""
    if not silent.row:
        return
    row, station = np.concatenate(silent.row), np.concatenate(silent.station)
    cosine, distance = np.concatenate(silent.cosine), np.concatenate(silent.distance)
    direction = np.concatenate(silent.direction)
    incidence = np.arccos(np.clip(cosine, 0.0, 1.0))
    glass = model.transparent[samples.triangle[row]]
    low, high = min(v.elevation_min for v in found.views), max(v.elevation_max for v in found.views)
    outside = np.zeros(len(row), dtype=np.bool_)
    for s, view in enumerate(found.views):
        own = np.flatnonzero(station == s)
        sensor = direction[own] @ stations.stations[s].rotation
        margin = 0.5 * (stations.spacing[s] if math.isfinite(stations.spacing[s]) else 0.0)
        outside[own] = view.outside(sensor, margin, low, high)
    inside = ~outside & ~glass & (incidence <= options.max_incidence)
    _count(tally, 0, distance[inside], cosine[inside])
    faintest = half_lost(tally, FAINTNESS_EDGES)
    reach = options.range_max or min(math.sqrt(faintest), max(v.range_max for v in found.views))
    found.limits = Limits(reach, low, high, faintest, options.max_incidence)
    state = np.full(len(row), ABSORBED, np.int8)
    state[(incidence > options.max_incidence) | (distance**2 > faintest * cosine)] = GRAZING
    state[(distance > reach) & ~glass] = OUT_OF_RANGE
    state[outside] = OUTSIDE_VIEW
    order = np.lexsort((row, station))
    edge = np.flatnonzero(np.diff(station[order], prepend=-1, append=-1))
    for begin, end in pairwise(edge):
        part = order[begin:end]
        found.best.offer(
            row[part], state[part], int(station[part[0]]), cosine[part], distance[part], np.full((len(part), 3), np.nan)
        )
