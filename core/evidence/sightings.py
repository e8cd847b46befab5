"""What each station saw in the direction of each query position."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.on_element import ElementSurfaces, plane_crossing
from ..model.raycast import RayScene
from ..parallel import in_chunks
from .gather import StationEvidence
from .station_index import StationIndex

BEYOND, AT, FRONT, THROUGH_GLASS = 0, 1, 2, 3
"""The return lies behind the query (its ray passed through), on its surface, before it (and hides it), or behind glass."""
ON_FACE_M = 0.005
"""Depth within which the foot of a return must meet its own element's surface: sagitta of round members, chord error."""
VISIBLE_SPACINGS = 1.1
"""A query is in view when a ray passes this close, in point spacings (a square grid leaves 0.71 at most)."""
SEARCH_M = 0.25
"""How far from its plan an element is looked for. Farther away it is a new object, and the planned one is absent."""
RAYLESS = -1
"""The station of dense points: no ray is known, and what belongs to them stands last in arrays by station."""
WIDER_SIGMAS = 3.0
"""A window holds three standard deviations of a usual return; points that are less certain get a wider one."""
GRAZE = 0.1
"""Smallest cosine with which a planned surface can explain a return."""


@dataclass(frozen=True)
class Sightings:
    """One row for each pair of a query position and a station with a ray close by. Lengths in metres, local frame."""

    sample: NDArray[np.int32]
    station: NDArray[np.int16]
    """(M,) its number; ``RAYLESS`` for dense points of photos."""
    deviation: NDArray[np.float64]
    """(M,) of the surface seen, along the planned outward normal."""
    count: NDArray[np.int32]
    """(M,) returns averaged."""
    cosine: NDArray[np.float32]
    distance: NDArray[np.float32]
    point: NDArray[np.float32]
    """(M, 3) the nearest return."""
    glass: NDArray[np.bool_]
    """(M,) the query lies on glass that this campaign looks through: a ray that passes is no evidence."""
    log_masses: NDArray[np.float64]
    """(M, 3) sums of log(m_occ + m_unk), log(m_emp + m_unk), log(m_unk) over the station's returns."""
    on_face: NDArray[np.bool_]
    """(M,) the ray meets the query's own element where it is planned, not the air beside its edge."""
    face_normal: NDArray[np.float32]
    """(M, 3) outward normal of the face that the ray meets; the query's own beside the element."""
    residual: NDArray[np.float64]
    """(M,) of the nearest return alone, from the face that its ray meets: exact on curved surfaces too."""
    explained: NDArray[np.bool_]
    """(M,) another planned surface lies closer to the return than the query's own."""
    photo: NDArray[np.float64]
    """(M, 0), or (M, 4) in campaigns with photogrammetric points: standard deviation of the point along the normal [m] (0: a
    scan's return), the part of it that neighbours share [m], by how much the window is wider for it [m], and a number of the
    point (-1: a scan's return)."""

    def __len__(self) -> int:
        return len(self.sample)

    def state(self, window: float) -> NDArray[np.uint8]:
        """(M,) BEYOND, AT or FRONT, for a planned surface that may be off by ``window`` metres along its normal."""
        wider = self.photo[:, 2] if self.photo.shape[1] else 0.0
        own = (np.abs(self.deviation) <= window + wider) & ~self.explained
        passed = np.where(self.glass, THROUGH_GLASS, BEYOND)
        return np.where(own, AT, np.where(self.deviation < 0, passed, FRONT)).astype(np.uint8)

    @property
    def from_photos(self) -> NDArray[np.bool_]:
        """(M,) the row is of a tie point or of a dense point, not of a scan."""
        return self.photo[:, 3] >= 0 if self.photo.shape[1] else np.zeros(len(self), np.bool_)

    def ray_key(self, chosen: NDArray[np.bool_] | NDArray[np.int64] | slice) -> NDArray[np.uint64]:
        """A number for each chosen row, the same for the same return: several queries may look at one.

        A tie point is one return, from however many cameras.
        """
        key = self.station[chosen].astype(np.uint64)
        for bits in self.point[chosen].view(np.uint32).T:
            key = (key * np.uint64(0x9E3779B97F4A7C15)) ^ bits
            key = (key ^ (key >> np.uint64(29))) * np.uint64(0xBF58476D1CE4E5B9)
        if self.photo.shape[1]:
            number = self.photo[chosen, 3]
            key = np.where(number >= 0, number.astype(np.uint64), key | np.uint64(1 << 63))
        return key

    def rows(self, chosen: NDArray[np.bool_] | NDArray[np.int64] | slice) -> Sightings:
        """A subset; a slice of rows shares memory with the whole."""
        return Sightings(**{name: value[chosen] for name, value in vars(self).items()})

    def explained_too(self, row: NDArray[np.int64]) -> Sightings:
        """The same with these rows explained."""
        explained = self.explained.copy()
        explained[row] = True
        return Sightings(**{**vars(self), "explained": explained})

    def beside(self, row: NDArray[np.int64]) -> Sightings:
        """The same with these rows beside their element: they say nothing of it."""
        on_face = self.on_face.copy()
        on_face[row] = False
        return Sightings(**{**vars(self), "on_face": on_face})

    @staticmethod
    def join(parts: list[Sightings]) -> Sightings:
        """All rows of several."""
        return Sightings(**{name: np.concatenate([getattr(p, name) for p in parts]) for name in vars(parts[0])})


def sight(
    evidence: StationEvidence,
    index: StationIndex,
    station: int,
    position: NDArray[np.float64],
    sample: NDArray[np.int64],
    query: NDArray[np.float64],
    normal: NDArray[np.float64],
    element: NDArray[np.int32],
    triangle: NDArray[np.int32],
    shift: NDArray[np.float64],
    surfaces: ElementSurfaces,
    photo: PhotoStation | None = None,
) -> Sightings:
    """Sightings of one station.

    position (3,) of the station and query (N, 3) in the local frame, normal (N, 3), element and triangle (N,), sample
    (N,) their numbers. ``shift`` (N, 3) is how far a query stands from its planned place (zero for the plan itself). ``photo``:
    in a campaign with photogrammetric points, what a tie point's row needs. Nothing is explained yet.
    """
    row = np.flatnonzero(
        (evidence.nearest >= 0) & (evidence.nearest_dy <= VISIBLE_SPACINGS * index.spacing_rad * evidence.distance)
    )
    offset = index.returns[evidence.nearest[row]].astype(np.float64)
    reach = np.linalg.norm(offset, axis=1)
    ray = offset / reach[:, None]
    point = position + offset
    n, q = normal[row], query[row]
    level = np.einsum("ij,ij->i", point - q, n)
    deviation = evidence.deviation[row]

    crossing = np.where(
        (np.abs(level) > ON_FACE_M)[:, None], plane_crossing(position, ray, q, n), point - level[:, None] * n
    )
    face = surfaces.face_at(crossing - shift[row], n, element[row], triangle[row], ON_FACE_M)
    on_face = face >= 0
    n_face = surfaces.normal[face]
    residual = np.einsum("ij,ij->i", point - shift[row] - surfaces.corner[face, 0], n_face)

    return Sightings(
        sample=sample[row].astype(np.int32),
        station=np.full(len(row), station, dtype=np.int16),
        deviation=deviation,
        count=evidence.count[row],
        cosine=evidence.cosine[row].astype(np.float32),
        distance=evidence.distance[row].astype(np.float32),
        point=point.astype(np.float32),
        log_masses=np.column_stack([evidence.log_occ[row], evidence.log_emp[row], evidence.log_unk[row]]),
        on_face=on_face,
        face_normal=np.where(on_face[:, None], n_face, n).astype(np.float32),
        residual=np.where(on_face, residual, level),
        explained=np.zeros(len(row), dtype=np.bool_),
        glass=np.zeros(len(row), dtype=np.bool_),
        photo=np.zeros((len(row), 0)) if photo is None else photo.columns(index, evidence.nearest[row]),
    )


NUMBERS_OF_BODY = 1 << 32
"""Tie points and dense points of a block have numbers below this."""
FIRST_DENSE = 1 << 31


@dataclass(frozen=True)
class PhotoStation:
    """A station of a campaign with photogrammetric points."""

    body: int
    """Number of the first camera of its block; its own for a scanner."""
    sigma: float
    """Of a usual return of the campaign, metres: the window is made for it."""

    def columns(self, index: StationIndex, nearest: NDArray[np.int64]) -> NDArray[np.float64]:
        """(M, 4) ``Sightings.photo`` of the returns at rows ``nearest`` (M,) of the index."""
        if index.photo is None:
            return np.tile([0.0, 0.0, 0.0, -1.0], (len(nearest), 1))
        sigma, shared, number = index.photo[nearest].T
        return np.column_stack([
            sigma, shared, WIDER_SIGMAS * np.maximum(sigma - self.sigma, 0.0), self.body * NUMBERS_OF_BODY + number
        ])


@dataclass(frozen=True)
class Yielding:
    """Queries that leave a return to another element unless their own surface is nearer to it by ``give_way``."""

    queries: NDArray[np.bool_]
    """(M,) rows of the sightings."""
    elements: NDArray[np.bool_]
    """(E,) to which they yield."""
    give_way: float
    """Metres."""


def explain(
    seen: Sightings,
    origins: NDArray[np.float64],
    scene: RayScene,
    sigma: float,
    within: float,
    asked: NDArray[np.bool_],
    element: NDArray[np.int32],
    *,
    strength: NDArray[np.float64] | None = None,
    yielding: Yielding | None = None,
) -> NDArray[np.bool_]:
    """(M,) whether another surface accounts for the return better than the query's own.

    Asked only where it matters: not of returns farther than ``SEARCH_M`` from the query's surface, which hide it or have
    passed it whatever they met.

    origins (M, 3) where the rays begin, local frame. A surface in ``scene``, of another element or another face of the same
    one, explains a return when the ray meets it from outside, it is nearer to the return along its normal than the
    query's own surface, and not farther than ``within`` metres. With ``strength`` (E,) only elements of more strength than
    the query's own ``element`` (M,) count. ``asked`` (M,) are the rows to look at.
    """
    explained = np.zeros(len(seen), dtype=np.bool_)
    away_from_own = np.abs(seen.deviation)
    near_enough = away_from_own >= sigma
    if yielding is not None:
        near_enough |= yielding.queries
    doubtful = np.flatnonzero(near_enough & (away_from_own <= SEARCH_M) & ~seen.explained & asked)

    def work(part: slice) -> None:
        row = doubtful[part]
        for away, other in surfaces_at(scene, origins[row], seen.point[row].astype(np.float64), within):
            met = away <= within
            if strength is not None:
                met &= strength[other] > strength[element[row]]
            lead: NDArray[np.float64] | float = sigma
            if yielding is not None:
                yields = yielding.queries[row] & yielding.elements[other] & (other != element[row])
                lead = np.where(yields, -yielding.give_way, sigma)
            explained[row] |= met & (away + lead < away_from_own[row])

    in_chunks(len(doubtful), work)
    return explained


def surfaces_at(
    scene: RayScene, station: NDArray[np.float64], point: NDArray[np.float64], within: float
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.int32]]]:
    """The same as ``hits_around``, with the surfaces' elements."""
    for away, triangle in hits_around(scene, station, point, within):
        yield away, scene.element[triangle]


def hits_around(
    scene: RayScene, station: NDArray[np.float64], point: NDArray[np.float64], within: float
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.int32]]]:
    """The surfaces that rays from ``station`` (K, 3) meet from outside around their returns ``point`` (K, 3), one by one.

    Yields how far each return lies from the surface along its normal [m] (K,), infinite where there is none, and the
    surface's triangle (K,). Those within ``within`` metres are all among them. Local frame.
    """
    ray = point - station
    ray /= np.maximum(np.linalg.norm(ray, axis=1, keepdims=True), 1e-9)
    back = within / GRAZE
    hits = scene.all_hits(point - back * ray, ray, 2 * back, most=8)
    for distance, triangle, entering in zip(hits.distance, hits.triangle, hits.entering, strict=True):
        facing = np.abs(np.einsum("ij,ij->i", ray, scene.normal[triangle]))
        with np.errstate(invalid="ignore"):
            away = np.abs(distance - back) * facing
        yield np.where((triangle >= 0) & entering, away, np.inf), triangle
