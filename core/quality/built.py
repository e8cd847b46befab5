"""Where the faces of the elements stand: one that was built beside its plan is measured there, and hides nothing of itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..evidence.collect import StationIndexes
from ..evidence.gather import SensorModel
from ..evidence.sightings import SEARCH_M, VISIBLE_SPACINGS
from ..model.elements import BuildingModel
from ..model.raycast import RayScene
from ..model.samples import SurfaceSamples
from ..progress import Progress
from ..scans.store import in_sector
from .faces import Face, face_rectangle
from .local_surface import measure_surface
from .planned_at import planned_at

Array = NDArray[np.float64]
LOOKS_PER_FACE = 60
FEWEST_VIEWS = 12
AGREE_M = 0.015
"""Views whose returns lie this close to their median, along the normal, are on one face."""
MOST_OF_THEM = 0.6
"""Share of the views of a face that must agree on where it stands."""

PARALLEL = 0.9
"""Cosine from which on two faces of an element move together."""


@dataclass(frozen=True)
class Built:
    """Where things stand."""

    moved: Array
    """(N,) how far the face of each sample stands before its plan, along the outward normal [m]; 0 as planned or unknown."""
    shift: Array
    """(E, 3) metres, of each element: that of its largest face that is moved."""


@dataclass(frozen=True)
class _Views:
    """Rays that end near a face or behind it, ordered by face; metres, local frame."""

    face: NDArray[np.int64]
    element: NDArray[np.int32]
    level: Array
    """Where the ray ends, along the face's normal."""
    point: Array
    other: NDArray[np.bool_]
    """It ends on another element, as planned."""


def find_built(
    model: BuildingModel, samples: SurfaceSamples, face: NDArray[np.int64], stations: StationIndexes, scene: RayScene,
    window: float, progress: Progress,
) -> Built:
    """Look for faces that stand beside their plan; ``face`` (T,) numbers the flat faces of the triangles.

    Faces are looked for up to ``SEARCH_M`` away. One counts as moved when most of its views end on one parallel plane
    more than half a ``window`` off, where no other element stands. Large faces come first: what ends on one of them is
    not asked again for a small one before or behind it, and an element moves as its largest face does or not at all.
    """
    of_sample = face[samples.triangle]
    views = _look(samples, of_sample, stations, scene, window, progress)
    count = int(face.max(initial=-1)) + 1
    area = np.bincount(of_sample, weights=samples.area * samples.exposed, minlength=count)
    start = np.searchsorted(views.face, np.arange(count + 1))
    order = np.argsort(face, kind="stable")
    first = np.searchsorted(face[order], np.arange(count + 1))
    offset, shift = np.zeros(count), np.zeros((len(model.elements), 3))
    taken: list[tuple[Face, float]] = []
    main: dict[int, tuple[Array, float]] = {}
    for f in np.argsort(-area, kind="stable"):
        of = slice(int(start[f]), int(start[f + 1]))
        found = _agreed(views.level[of], views.other[of], window)
        if found is None:
            continue
        rectangle = face_rectangle(model, order[first[f] : first[f + 1]])
        element, normal = rectangle.element, rectangle.axes[2]
        if found:
            other = views.other[of].copy()
            for large, away in taken:
                other |= (views.element[of] != large.element) & _lies_on(large, away, views.point[of])
            found = _agreed(views.level[of], other, window)
        if found is None or not _fits(normal, found, *main.setdefault(element, (normal, found))):
            continue
        if found:
            taken.append((rectangle, found))
            offset[f] = found
            if not shift[element].any():
                shift[element] = found * normal
    return Built(offset[of_sample], shift)


def _look(
    samples: SurfaceSamples, face: NDArray[np.int64], stations: StationIndexes, scene: RayScene, window: float,
    progress: Progress,
) -> _Views:
    row = _few_of_each(np.flatnonzero(samples.exposed), face)
    parts = []
    for station, index, sector in stations.visit(SensorModel(0.0, 0.0), progress):
        position = stations.position[station]
        relative = samples.position[row] - position
        own = np.einsum("ij,ij->i", relative, samples.normal[row]) < 0
        if sector is not None:
            own &= in_sector(relative, *sector)
        r = row[own]
        seen = measure_surface(index, relative[own], samples.normal[r], window)
        told = np.flatnonzero(seen.nearest_dy <= VISIBLE_SPACINGS * index.spacing_rad * seen.distance)
        told = told[seen.level[told] <= SEARCH_M]  # what ends before that says nothing
        point = position + index.returns[seen.nearest[told]]
        found = planned_at(scene, np.broadcast_to(position, point.shape), point, 0.5 * window)
        r = r[told]
        parts.append((face[r], samples.element[r], seen.level[told], point, (found >= 0) & (found != samples.element[r])))
    if not parts:
        return _Views(np.zeros(0, np.int64), np.zeros(0, np.int32), np.zeros(0), np.zeros((0, 3)), np.zeros(0, np.bool_))
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
    order = np.lexsort((columns[2], columns[0]))
    return _Views(*(column[order] for column in columns))


def _few_of_each(row: NDArray[np.int64], face: NDArray[np.int64]) -> NDArray[np.int64]:
    """At most ``LOOKS_PER_FACE`` of the samples of every face, evenly chosen."""
    order = row[np.argsort(face[row], kind="stable")]
    start = np.flatnonzero(np.diff(face[order], prepend=-1))
    count = np.diff(np.append(start, len(order)))
    rank = np.arange(len(order)) - np.repeat(start, count)
    stride = np.repeat(np.maximum(count / LOOKS_PER_FACE, 1.0), count)
    return np.sort(order[np.floor((rank + 1) / stride) > np.floor(rank / stride)])


def _agreed(level: Array, other: NDArray[np.bool_], window: float) -> float | None:
    """Where most views of one face end [m], 0 where that is as planned; None where they do not agree."""
    asked = level[~(other & (level > 0))]  # another element before it hides it
    its = level[~other & (np.abs(level) <= SEARCH_M)]
    if len(its) < FEWEST_VIEWS:
        return None
    middle = float(np.median(its))
    agree = its[np.abs(its - middle) <= AGREE_M]
    if len(agree) < MOST_OF_THEM * len(asked):
        return None
    return float(np.median(agree)) if abs(middle) > 0.5 * window else 0.0


def _fits(normal: Array, offset: float, larger: Array, its_offset: float) -> bool:
    """Whether a face moved together with the largest one of its element: only one parallel to it can tell."""
    along = float(normal @ larger)
    return offset == 0.0 or (abs(along) >= PARALLEL and abs(offset - along * its_offset) <= AGREE_M)


def _lies_on(face: Face, away: float, point: Array) -> NDArray[np.bool_]:
    """(K,) points on the rectangle of a face that stands ``away`` before its plan."""
    u, v, w = ((point - face.corner) @ face.axes.T).T
    return np.asarray(
        (np.abs(w - away) <= AGREE_M) & (u >= -AGREE_M) & (u <= face.width + AGREE_M)
        & (v >= -AGREE_M) & (v <= face.height + AGREE_M)
    )
