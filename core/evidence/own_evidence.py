"""How much of what was seen of an element speaks for it alone, and how many beams say so.

Areas alone can be large where a single beam stands for all of a small part. Beams are therefore counted, each once, and one
that comes closer to the outline than the beam's width allows is not said to have passed through: part of its light may have
met the element, and the reported range is that of the stronger part.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom

from ..model.elements import BuildingModel
from ..model.on_element import ElementSurfaces
from ..model.parts import Parts
from ..model.samples import SurfaceSamples
from .as_found import AsFound, medians
from .decide import shared_area
from .shared_surface import on_others
from .sightings import AT, BEYOND, GRAZE, ON_FACE_M, Sightings
from .slide import crossings

BEAM_EXIT_RADIUS_M = 0.003
BEAM_SPREAD_RAD = 1.5e-4
"""Half of the diameter (1/e2) and divergence that makers of terrestrial scanners state: 6 mm and 0.3 mrad."""
WELL_INSIDE = 0.5
"""A beam whose middle lies this many radii inside an edge has 84 % of its light on the surface (normal distribution)."""
TOLD_APART_SIGMAS = 2.0
"""Returns within this many sensor sigmas of a surface lie on it (95 %)."""
LEAST_OPPOSED = 0.1
"""Of what tells of an element: when less of it passes, as at edges and recesses, the element stands."""
ERROR_RATE = 0.05
"""Of a wrong verdict by the chance of few beams."""


@dataclass(frozen=True)
class OwnEvidence:
    """What speaks for and against each element at its planned place. Arrays (E,); areas in m2."""

    at: NDArray[np.float64]
    """Found, and no other element's."""
    either: NDArray[np.float64]
    """Found, but another element has the same surface there."""
    beyond: NDArray[np.float64]
    """Rays passed through."""
    silent: NDArray[np.float64]
    """Of positions near an edge: the nearest beams passed beside it, or returned from what touches it there."""
    beams_at: NDArray[np.int64]
    """Different returns from what is its alone."""
    beams_through: NDArray[np.int64]
    """Different returns whose beams clearly passed through it."""
    beams_either: NDArray[np.int64]
    """Different returns that may be another element's, or from between two."""
    beams_split: NDArray[np.int64]
    """Of these, different returns of beams of which a part meets another element first: its own, or from between the two; and
    returns that others explain where they are planned, but not where they were found."""

    def own_by_chance(self, row: int) -> bool:
        """Whether so few of its returns are its alone that they may be the other element's too: of those one in twenty lies
        farther than two sigmas from that one's face."""
        at, either = int(self.beams_at[row]), int(self.beams_either[row])
        return either > 0 and not shows_standing(at, either, ERROR_RATE)

    def share(self, row: int) -> float:
        """Share of what was seen of it that is at its place."""
        return float(self.at[row] / max(self.at[row] + self.beyond[row], 1e-12))


@dataclass(frozen=True)
class Touching:
    """Returns at an element's place that lie on a face of another one as well."""

    row: NDArray[np.int64]
    """(K,) of the sightings."""
    other: NDArray[np.int64]
    """(K,) the other element."""
    farther: NDArray[np.bool_]
    """(K,) the own face is farther from the return than the sensor's error allows: it came from the other one."""

    def split(self, gone: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """(from another element, from either) rows, of others that are not known to be ``gone`` (E,)."""
        stands = ~gone[self.other]
        return self.row[stands & self.farther], self.row[stands & ~self.farther]


def find_touching(
    seen: Sightings, at: NDArray[np.bool_], opposed: NDArray[np.bool_], model: BuildingModel, samples: SurfaceSamples,
    origins: NDArray[np.float64], surfaces: ElementSurfaces, as_found: AsFound, sigma: float, parts: Parts,
) -> Touching:
    """Such returns, of those ``at`` their element's place (M,). Where nothing passes it (not ``opposed``, (M,)), those as near
    to its own face are left out: there is nothing to explain.

    A board's back lies in the face of the wall that it covers: rays through the model (``explain``) may meet the one and miss
    the other; without the board its wall is seen within the window. A return came from the other element when it lies on
    that one's face where it was found, and off the own face, also if that is off by as much. One beam tells this to two sigmas,
    all of them together to one. ``origins`` (M, 3) of the rays, metres, local frame.
    """
    near, element = TOLD_APART_SIGMAS * sigma, samples.element[seen.sample]
    off = np.abs(seen.deviation) > near + sigma
    row = np.flatnonzero(at & (off | opposed))
    point, normal = seen.point[row].astype(np.float64), samples.normal[seen.sample[row]].astype(np.float64)
    back = origins[row] - point
    back /= np.maximum(np.linalg.norm(back, axis=1, keepdims=True), 1e-9)
    pair, other, face = on_others(model, surfaces, point, back, element[row], near, parts, GRAZE, as_found.shift)
    row, point, normal = row[pair], point[pair], normal[pair]
    with_it = np.abs(seen.deviation[row] - np.einsum("ij,ij->i", as_found.shift[other], normal)) > near + sigma
    known = as_found.is_known(other, surfaces.normal[face]) | (np.abs(seen.deviation[row]) > as_found.placed)
    level = np.einsum("ij,ij->i", point - as_found.shift[other] - surfaces.corner[face, 0], surfaces.normal[face])
    farther = off[row] & with_it & known
    _, group = np.unique(np.column_stack([element[row], other]), axis=0, return_inverse=True)
    group = group.ravel()
    farther[farther] = np.abs(medians(group[farther], level[farther], int(group.max(initial=-1)) + 1))[group[farther]] <= sigma
    return Touching(row, other, farther)


def at_opposed(
    seen: Sightings, samples: SurfaceSamples, window: float, elements: int
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """(M,) of the sightings: returns from the place of the own element; and whether more of that element passes than at edges
    and recesses of one that stands."""
    state = seen.state(window)
    at, beyond = (seen.on_face & (state == what) for what in (AT, BEYOND))
    element = samples.element[seen.sample]
    there, passed = (np.bincount(element[of], minlength=elements) for of in (at, beyond))
    return at, (passed >= LEAST_OPPOSED * (there + passed))[element]


def own_evidence(
    seen: Sightings, samples: SurfaceSamples, origins: NDArray[np.float64], surfaces: ElementSurfaces,
    doubt: NDArray[np.bool_], either: NDArray[np.int64], split: NDArray[np.int64], window: float,
    registration_sigma: float, elements: int,
) -> OwnEvidence:
    """Weigh the sightings ``seen`` of the samples at their planned places.

    origins (M, 3) of the rays [m, local frame]; doubt (N,) whether a sample is another element's surface as well;
    ``either``: rows of sightings that may be another element's, ``split``: or from between the own one and another;
    ``window`` [m] within which a return is at its place.
    """
    state = seen.state(window)
    at, beyond = (seen.on_face & (state == what) for what in (AT, BEYOND))
    sample = seen.sample.astype(np.int64)
    element = samples.element[sample].astype(np.int64)
    area = shared_area(seen, samples.area[sample], at | beyond)
    unsure = doubt[sample]
    unsure[either] = unsure[split] = True
    unsure &= at
    found, shared, passed = (
        np.bincount(element[of], weights=area[of], minlength=elements).astype(np.float64)
        for of in (at & ~unsure, unsure, beyond)
    )
    rows = (
        np.flatnonzero(at & ~unsure), passed_through(seen, samples, origins, surfaces, window, registration_sigma),
        np.flatnonzero(unsure), split[at[split]],
    )
    return OwnEvidence(
        found, shared, passed, _silent(seen, samples, window, at | beyond, elements),
        *(_count_beams(element[row], _beam_of(seen, element, row), elements) for row in rows),
    )


def passed_through(
    seen: Sightings, samples: SurfaceSamples, origins: NDArray[np.float64], surfaces: ElementSurfaces, window: float,
    registration_sigma: float,
) -> NDArray[np.int64]:
    """Rows of beams that clearly passed through their element, and returned from nowhere on it. Arguments: ``own_evidence``."""
    state = seen.state(window)
    telling = np.flatnonzero(seen.on_face & ((state == AT) | (state == BEYOND)))
    element = samples.element[seen.sample].astype(np.int64)
    beam, passed = _beam_of(seen, element, telling), state[telling] == BEYOND
    row = telling[passed & ~np.isin(beam, beam[~passed])]
    return row[clearly_inside(seen.rows(row), samples, origins[row], surfaces, registration_sigma)]


def _silent(
    seen: Sightings, samples: SurfaceSamples, window: float, telling: NDArray[np.bool_], elements: int
) -> NDArray[np.float64]:
    """(E,) m2 of exposed positions of which beams close by tell nothing, though nothing hides them."""
    aside = ~seen.on_face | (seen.explained & (np.abs(seen.deviation) <= window))
    told, near = (np.bincount(seen.sample[of], minlength=len(samples)) > 0 for of in (telling, aside))
    weight = samples.area * (samples.exposed & near & ~told)
    return np.bincount(samples.element, weights=weight, minlength=elements).astype(np.float64)


def _beam_of(seen: Sightings, element: NDArray[np.int64], row: NDArray[np.int64]) -> NDArray[np.uint64]:
    """(K,) a number for each row's beam and element: the same beam may tell of several elements."""
    mixed = (seen.ray_key(row) + element[row].astype(np.uint64)) * np.uint64(0x9E3779B97F4A7C15)
    return np.asarray(mixed ^ (mixed >> np.uint64(29)))


def _count_beams(element: NDArray[np.int64], beam: NDArray[np.uint64], elements: int) -> NDArray[np.int64]:
    """(E,) different beams of each element."""
    _, first = np.unique(beam, return_index=True)
    return np.bincount(element[first], minlength=elements)


def clearly_inside(
    seen: Sightings, samples: SurfaceSamples, origins: NDArray[np.float64], surfaces: ElementSurfaces,
    registration_sigma: float,
) -> NDArray[np.bool_]:
    """(M,) whether each beam's middle crosses its element's face well inside the outline, registration counted."""
    sample = seen.sample.astype(np.int64)
    normal, position = samples.normal[sample], samples.position[sample]
    place = crossings(seen, origins, position, normal)
    margin = WELL_INSIDE * beam_radius(seen) + 2.0 * registration_sigma
    inside = np.ones(len(seen), np.bool_)
    for beside in four_sides(place, normal, margin):
        inside &= _on_face(beside, seen, samples, surfaces)
    return inside


def clearly_outside(
    seen: Sightings, samples: SurfaceSamples, origins: NDArray[np.float64], surfaces: ElementSurfaces,
    shift: NDArray[np.float64], registration_sigma: float,
) -> NDArray[np.bool_]:
    """(M,) whether no light of a beam reaches its element's face where that stands off by ``shift`` (3,), registration counted.

    Of a beam that does, a part of its light is enough for a return.
    """
    sample = seen.sample.astype(np.int64)
    normal, position = samples.normal[sample], samples.position[sample]
    place = crossings(seen, origins, position, normal) - shift
    outside = ~_on_face(place, seen, samples, surfaces)
    for beside in four_sides(place, normal, beam_radius(seen) + 2.0 * registration_sigma):
        outside &= ~_on_face(beside, seen, samples, surfaces)
    return outside


def clearly_over(
    seen: Sightings, samples: SurfaceSamples, surfaces: ElementSurfaces, margin: float
) -> NDArray[np.bool_]:
    """(M,) whether each return lies over a face of its element, at least ``margin`` [m] inside the outline.

    A ray that meets a face may have returned from what stands at its edge.
    """
    sample = seen.sample.astype(np.int64)
    normal, position, point = samples.normal[sample], samples.position[sample], seen.point.astype(np.float64)
    foot = point - np.einsum("ij,ij->i", point - position, normal)[:, None] * normal
    over = np.ones(len(seen), np.bool_)
    for beside in four_sides(foot, normal, np.full(len(seen), margin)):
        over &= _on_face(beside, seen, samples, surfaces)
    return over


def from_edges(
    seen: Sightings, samples: SurfaceSamples, surfaces: ElementSurfaces, at: NDArray[np.bool_], sigma: float, elements: int
) -> NDArray[np.int64]:
    """Rows of returns, of those ``at`` the places of their elements (M,), that came from what stands at an edge.

    They lie farther from the face than the sensor's error allows, and not over it, as half of such returns of the element may:
    a few at the border of a face that is off are its own.
    """
    row = np.flatnonzero(at & (np.abs(seen.deviation) > (TOLD_APART_SIGMAS + 1.0) * sigma))
    beside = ~clearly_over(seen.rows(row), samples, surfaces, TOLD_APART_SIGMAS * sigma)
    element = samples.element[seen.sample[row]]
    asked, aside = (np.bincount(of, minlength=elements) for of in (element, element[beside]))
    return row[beside & may_be_half(aside, asked)[element]]


def beam_radius(seen: Sightings) -> NDArray[np.float64]:
    """(M,) metres (1/e2), where the beams cross the queries' planes."""
    return BEAM_EXIT_RADIUS_M + BEAM_SPREAD_RAD * seen.distance.astype(np.float64)


def four_sides(
    place: NDArray[np.float64], normal: NDArray[np.float64], margin: NDArray[np.float64]
) -> Iterator[NDArray[np.float64]]:
    """Places (M, 3) beside ``place`` (M, 3), by ``margin`` (M,) metres each, in the planes of ``normal`` (M, 3)."""
    up = np.where((np.abs(normal[:, 2]) < 0.9)[:, None], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
    u = np.cross(normal, up)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(normal, u)
    for step in (u, -u, v, -v):
        yield place + margin[:, None] * step


def _on_face(
    place: NDArray[np.float64], seen: Sightings, samples: SurfaceSamples, surfaces: ElementSurfaces
) -> NDArray[np.bool_]:
    """(M,) whether ``place`` (M, 3) lies on a face, turned like the query's, of the query's element as planned."""
    sample = seen.sample.astype(np.int64)
    face = surfaces.face_at(
        place, samples.normal[sample], samples.element[sample].astype(np.int32),
        samples.triangle[sample].astype(np.int32), ON_FACE_M,
    )
    return np.asarray(face >= 0)


def shows_gone(at: int, through: int, present: float) -> bool:
    """Whether so many beams through it would be unlikely if at least the share ``present`` of it stood."""
    return bool(binom.cdf(at, at + through, present) < ERROR_RATE)


def may_be_half(part: NDArray[np.integer], whole: NDArray[np.integer]) -> NDArray[np.bool_]:
    """(N,) whether so few of the ``whole`` (N,) as ``part`` (N,) would not be unlikely if half of them were such."""
    return np.asarray(binom.cdf(part, whole, 0.5) >= ERROR_RATE)


def shows_standing(at: int, through: int, absent: float, tried: float = 1.0) -> bool:
    """Whether so many returns from it would be unlikely if no more than the share ``absent`` of it stood.

    ``tried`` places were looked at, of which any could have fitted by chance.
    """
    return bool(binom.sf(at - 1, at + through, absent) * tried < ERROR_RATE)
