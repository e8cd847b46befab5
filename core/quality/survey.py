"""One pass over all stations: what each saw of every query position, and why it did not see the others."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

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
RANGE_EDGES_M = np.geomspace(0.5, 2000.0, 121)
INCIDENCE_EDGES = np.radians(np.arange(0.0, 91.0, 1.0))
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
    overlap: list[Overlap]
    """One a station."""
    views: list[FieldOfView]
    """One a station."""
    edge_point: list[Array] = field(default_factory=list)
    """(K, 3) returns near edges, one array a tile, with the sample they were found at, and their station."""
    edge_sample: list[NDArray[np.int64]] = field(default_factory=list)
    edge_station: list[NDArray[np.int16]] = field(default_factory=list)
    limits: Limits = Limits(math.inf, -math.pi / 2, math.pi / 2, math.pi / 2)

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
    options: QualityOptions,
    progress: Progress,
) -> Survey:
    """Look at all exposed samples from all stations. ``edge`` (N,) is each sample's distance to the nearest edge [m]."""
    count = len(samples)
    found = Survey(
        best=BestView.empty(count), density=np.zeros(count), stations=np.zeros(count, np.int16), square=np.zeros(count),
        freedom=np.zeros(count), square_near=np.zeros(count), freedom_near=np.zeros(count), overlap=[Overlap() for _ in stations.stations], views=[],
    )
    surfaces = ElementSurfaces(model)
    silent = _Silent()
    counters = [FieldOfViewCounter(s.rotation) for s in stations.stations]
    tallies = np.zeros((2, len(RANGE_EDGES_M)), np.int64), np.zeros((2, len(INCIDENCE_EDGES)), np.int64)
    exposed = np.flatnonzero(samples.exposed)
    for station, index, sector in stations.visit(SensorModel(0.0, 0.0), progress):
        counters[station].add(index.returns)
        position = stations.position[station]
        relative = samples.position[exposed] - position
        row = exposed
        if sector is not None:
            azimuth = np.arctan2(relative[:, 1], relative[:, 0]) % (2 * np.pi)
            own = (azimuth >= sector[0]) & (azimuth < sector[1])
            row, relative = exposed[own], relative[own]
        _look(found, silent, tallies, station, index, position, row, relative, samples, scene, surfaces, edge, options)
    found.views = [c.result() for c in counters]
    _judge(found, silent, tallies, stations, samples, model, options)
    return found


def _look(
    found: Survey, silent: _Silent, tallies: tuple[NDArray[np.int64], NDArray[np.int64]], station: int,
    index: StationIndex, position: Array, row: NDArray[np.int64], relative: Array, samples: SurfaceSamples,
    scene: RayScene, surfaces: ElementSurfaces, edge: Array, options: QualityOptions,
) -> None:
    """Everything about one station (or one sector of it)."""
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
    silent_view = ~at & ~front & ~through_face

    state = np.full(len(row), ABSORBED, np.int8)
    state[at] = np.where(seen.cosine[at] >= steepest, SEEN, GRAZING)
    state[front] = OCCLUDED
    state[through_face] = PASSED
    blocker = np.full((len(row), 3), np.nan)
    blocked = np.flatnonzero(front)
    blocker[blocked] = position + index.returns[seen.nearest[blocked]]

    quiet = np.flatnonzero(silent_view)
    planned = _first_planned(scene, position, samples, row[quiet], seen.distance[quiet], relative[quiet])
    hidden = np.isfinite(planned)
    state[quiet[hidden]] = OCCLUDED
    blocker[quiet[hidden]] = position + relative[quiet[hidden]] * (
        planned[hidden] / seen.distance[quiet[hidden]]
    )[:, None]
    open_view = quiet[~hidden]
    told = np.ones(len(row), dtype=np.bool_)
    told[open_view] = False
    found.best.offer(row[told], state[told], station, seen.cosine[told], seen.distance[told], blocker[told])

    silent.row.append(row[open_view])
    silent.station.append(np.full(len(open_view), station, np.int16))
    silent.cosine.append(seen.cosine[open_view])
    silent.distance.append(seen.distance[open_view])
    silent.direction.append(relative[open_view] / np.maximum(seen.distance[open_view], 1e-9)[:, None])
    _tally(tallies, np.flatnonzero(state == SEEN), seen, 1)
    _keep_surface(found, station, index, position, row, seen, state == SEEN, samples, edge)


def _tally(
    tallies: tuple[NDArray[np.int64], NDArray[np.int64]], rows: NDArray[np.int64], seen: LocalSurface, which: int
) -> None:
    steep = seen.cosine[rows] >= 0.5
    _count(tallies, which, seen.distance[rows], np.arccos(np.clip(seen.cosine[rows], 0.0, 1.0)), steep)


def _count(
    tallies: tuple[NDArray[np.int64], NDArray[np.int64]], which: int, distance: Array, incidence: Array,
    steep: NDArray[np.bool_],
) -> None:
    """Ranges of the views at less than 60 degrees, and incidences of all, that were answered (1) or not (0)."""
    place = np.clip(np.searchsorted(RANGE_EDGES_M, distance[steep], side="right") - 1, 0, len(RANGE_EDGES_M) - 1)
    tallies[0][which] += np.bincount(place, minlength=len(RANGE_EDGES_M))
    place = np.clip(np.searchsorted(INCIDENCE_EDGES, incidence, side="right") - 1, 0, len(INCIDENCE_EDGES) - 1)
    tallies[1][which] += np.bincount(place, minlength=len(INCIDENCE_EDGES))


def _meets_face(
    index: StationIndex, seen: LocalSurface, position: Array, at: NDArray[np.int64], row: NDArray[np.int64],
    samples: SurfaceSamples, surfaces: ElementSurfaces,
) -> NDArray[np.bool_]:
    """(K,) whether the ray of the nearest return crosses the element's own face, not the air beside it."""
    r = row[at]
    ray = index.returns[seen.nearest[at]]
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
    near = np.flatnonzero(edge[r] <= 0.5 * reach)
    near = near[:: max(len(near) // EDGE_RETURNS, 1)]
    found.edge_point.append(position + index.returns[seen.nearest[at[near]]])
    found.edge_sample.append(r[near])
    found.edge_station.append(np.full(len(near), station, np.int16))


def _judge(
    found: Survey, silent: _Silent, tallies: tuple[NDArray[np.int64], NDArray[np.int64]], stations: StationIndexes,
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
    inside = ~outside & ~glass
    _count(tallies, 0, distance[inside], incidence[inside], cosine[inside] >= 0.5)
    reach = _reach(found, tallies[0], options)
    steepest = min(half_lost(tallies[1], INCIDENCE_EDGES), options.max_incidence)
    found.limits = Limits(reach, low, high, steepest)
    state = np.full(len(row), ABSORBED, np.int8)
    state[incidence > steepest] = GRAZING
    state[(distance > reach) & ~glass] = OUT_OF_RANGE
    state[outside] = OUTSIDE_VIEW
    order = np.lexsort((row, station))
    edge = np.flatnonzero(np.diff(station[order], prepend=-1, append=-1))
    for begin, end in zip(edge[:-1], edge[1:], strict=True):
        part = order[begin:end]
        found.best.offer(
            row[part], state[part], int(station[part[0]]), cosine[part], distance[part], np.full((len(part), 3), np.nan)
        )


def _reach(found: Survey, tally: NDArray[np.int64], options: QualityOptions) -> float:
    """Range beyond which hardly any surface in plain view answered."""
    if options.range_max is not None:
        return options.range_max
    longest = max(v.range_max for v in found.views)
    return min(half_lost(tally, RANGE_EDGES_M), longest)
