"""Station after station: index its returns, look at every query position, keep what was seen."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from ..model.on_element import ElementSurfaces
from ..progress import Progress
from ..scans.store import ReturnStore, in_sector
from .dense_points import DensePoints
from .gather import CUT, LEAST_RANGE_M, SensorModel, gather
from .sightings import VISIBLE_SPACINGS, PhotoStation, Sightings, sight
from .station_index import (
    StationIndex,
    build_index,
    median_spacing,
    neighbour_angles,
    sorting_spacing,
    view_cone,
)


@dataclass(frozen=True)
class Queries:
    """Positions to look at, in the local frame; ``shift`` is how far they stand from the plan. Metres."""

    number: NDArray[np.int64]
    """(N,) what ``Sightings.sample`` says of them."""
    position: NDArray[np.float64]
    normal: NDArray[np.float64]
    element: NDArray[np.int32]
    triangle: NDArray[np.int32]
    shift: NDArray[np.float64]


@dataclass(frozen=True)
class PhotoCampaign:
    """What a campaign with photogrammetric points knows beyond its stations."""

    body: NDArray[np.int64]
    """(S + 1,) see ``ErrorModel.body``."""
    sigma: float
    """Of a usual return of the campaign, metres."""
    dense: DensePoints | None = None


class StationIndexes:
    """The stations of a campaign, indexed one after the other; kept between passes when memory allows."""

    def __init__(self, store: ReturnStore, origin: NDArray[np.float64], photo: PhotoCampaign | None = None) -> None:
        self.photo = photo
        self._store = store
        self.stations = store.stations
        self._kept: dict[int, StationIndex] = {}
        self._sorted: dict[int, StationIndex] = {}
        """Without their returns, which the store has in this order."""
        self.position = [s.position - origin for s in store.stations]
        self.spacing = [math.nan for _ in store.stations]

    def count(self, station: int) -> int:
        """Returns of a station."""
        return self._store.count(station)

    def visit(
        self, sensor: SensorModel, progress: Progress, reach: float = 0.0, sines: NDArray[np.float64] | None = None
    ) -> Iterator[tuple[int, StationIndex, NDArray[np.float64] | None]]:
        """Yield (station, index, sector) for every tile; sector (2,) is the azimuth range it owns, None for all.

        A tile has the returns around it that the sensor model asks for, those within ``reach`` spacings by which the
        whole station would be sorted, and those within the angle that ``sines`` (S,) has of its station.
        """
        total = max(sum(self._store.count(s) for s in range(len(self.position))), 1)
        done = 0
        for station in range(len(self.position)):
            count = self._store.count(station)
            if count:
                progress.update(done / total, f"Station {station + 1} of {len(self.position)}")
                yield from self._tiles(station, sensor, reach, 0.0 if sines is None else float(sines[station]))
            done += count
        progress.update(1.0, "All stations done")

    def around(
        self, station: NDArray[np.integer], place: NDArray[np.float64], sensor: SensorModel, progress: Progress, *,
        spacings: float = 0.0, within: float = 0.0,
    ) -> Iterator[tuple[NDArray[np.int64], int, NDArray[np.float64], StationIndex]]:
        """Yield (rows, station, offset, index) for every tile: the rows of each ``place`` (K, 3) [m, local frame] that it owns,
        of those asked of its ``station`` (K,), and where they lie from it.

        All returns within so many ``spacings``, or ``within`` metres, of these places are in the index.
        """
        away = np.full(len(self.position), np.inf)
        np.minimum.at(away, station, np.linalg.norm(place - np.array(self.position)[station], axis=1))
        for number, index, sector in self.visit(sensor, progress, spacings, within / np.maximum(away, 1e-9)):
            rows = np.flatnonzero(station == number)
            offset = place[rows] - self.position[number]
            if sector is not None:
                own = in_sector(offset, *sector)
                rows, offset = rows[own], offset[own]
            yield rows, number, offset, index

    def _tiles(
        self, station: int, sensor: SensorModel, reach: float, sine: float
    ) -> Iterator[tuple[int, StationIndex, NDArray[np.float64] | None]]:
        if station in self._kept:
            yield station, self._kept[station], None
            return
        if math.isnan(self.spacing[station]) and (whole_index := self._measure_spacing(station)) is not None:
            yield station, whole_index, None
            return
        if station in self._sorted:
            yield station, replace(self._sorted[station], returns=self._store.whole(station)), None
            return
        for tile in self._store.tiles(station, self._margin(station, sensor, reach, sine)):
            sector = np.array([tile.first, tile.last])
            whole = tile.last - tile.first >= 2 * np.pi
            yield station, build_index(tile.offsets, self.spacing[station], tile.photo), None if whole else sector

    def _margin(self, station: int, sensor: SensorModel, reach: float, sine: float) -> float:
        sorting = sorting_spacing(self.spacing[station], self._store.count(station))
        widest = max(CUT * self.spacing[station], reach * sorting, sine)
        if sensor.fixed is not None:
            widest = max(widest, CUT * math.sqrt(math.log(2.0) / sensor.fixed.kappa) / LEAST_RANGE_M)
        return 1.2 * math.asin(min(widest, 1.0))

    def _measure_spacing(self, station: int) -> StationIndex | None:
        """Measure the spacing; returns the index of the station where it was taken as a whole."""
        rough = math.sqrt(4.0 * math.pi / self._store.count(station))
        angles = []
        for tile in self._store.tiles(station, 40.0 * rough):
            index = build_index(tile.offsets, rough, tile.photo)
            direction, angle = neighbour_angles(index, self._store.count(station))
            angles.append(angle[tile.owns(direction)])
            if tile.last - tile.first >= 2 * np.pi:
                measured = median_spacing(angles[0])
                if 0.5 < measured / rough < 2.0:
                    index = replace(index, spacing_rad=measured)
                else:
                    index = build_index(index.returns, measured if measured > 0 else rough, index.photo)
                self.spacing[station] = index.spacing_rad
                if self._store.fits:
                    self._kept[station] = index
                    self._store.release(station)
                elif index.photo is None:
                    self._store.rewrite(station, index.returns)
                    self._sorted[station] = replace(index, returns=np.zeros((0, 3), np.float32))
                return index
        measured = median_spacing(np.concatenate(angles))
        self.spacing[station] = measured if measured > 0 else rough
        return None


@njit(cache=True, nogil=True, parallel=True)
def _before(
    position: NDArray[np.float64], normal: NDArray[np.float64], station: NDArray[np.float64], axis: NDArray[np.float64],
    cosine: float,
) -> NDArray[np.bool_]:
    """(N,) whether a station stands before a query's face, and the query within the angle of ``cosine`` to ``axis``."""
    out = np.empty(len(position), np.bool_)
    for i in prange(len(position)):
        x, y, z = position[i, 0] - station[0], position[i, 1] - station[1], position[i, 2] - station[2]
        facing = x * normal[i, 0] + y * normal[i, 1] + z * normal[i, 2] < 0.0
        out[i] = facing and x * axis[0] + y * axis[1] + z * axis[2] >= cosine * math.sqrt(x * x + y * y + z * z)
    return out


def look(
    stations: StationIndexes, queries: Queries, surfaces: ElementSurfaces, sensor: SensorModel, progress: Progress
) -> Sightings:
    """What all stations saw at the queries, ordered by query and station."""
    parts = []
    photo = stations.photo
    for station, index, sector in stations.visit(sensor, progress):
        position = stations.position[station]
        axis, cosine = (np.array([0.0, 0.0, 1.0]), -2.0) if index.photo is None else view_cone(index, VISIBLE_SPACINGS)
        row = np.flatnonzero(_before(queries.position, queries.normal, position, axis, cosine))
        relative = queries.position[row] - position
        if sector is not None:
            own = in_sector(relative, *sector)
            row, relative = row[own], relative[own]
        evidence = gather(index, relative, queries.normal[row], sensor, progress)
        parts.append(
            sight(
                evidence, index, station, position, queries.number[row], queries.position[row], queries.normal[row],
                queries.element[row], queries.triangle[row], queries.shift[row], surfaces,
                None if photo is None else PhotoStation(int(photo.body[station]), photo.sigma),
            )
        )
    if photo is not None and photo.dense is not None:
        parts.append(photo.dense.sight(
            sensor, queries.number, queries.position, queries.normal, queries.element, queries.triangle, queries.shift, surfaces
        ))
    seen: Sightings = Sightings.join(parts)
    return seen.rows(np.lexsort((seen.station, seen.sample)))
