"""How much of what was seen of an element speaks for it alone, and how many beams say so.

Areas alone can be large where a single beam stands for all of a small part. Beams are therefore counted, each once, and one
that comes closer to the outline than the beam's width allows is not said to have passed through: part of its light may have
met the element, and the reported range is that of the stronger part.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom

from ..evidence.decide import shared_area
from ..evidence.sightings import AT, BEYOND, ON_FACE_M, Sightings
from ..evidence.slide import crossings
from ..model.on_element import ElementSurfaces
from ..model.samples import SurfaceSamples

BEAM_EXIT_RADIUS_M = 0.003
BEAM_SPREAD_RAD = 1.5e-4
"""Half of the diameter (1/e2) and divergence that makers of terrestrial scanners state: 6 mm and 0.3 mrad."""
WELL_INSIDE = 0.5
"""A beam whose middle lies this many radii inside an edge has 84 % of its light on the surface (normal distribution)."""
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
    beams_at: NDArray[np.int64]
    """Different returns from what is its alone."""
    beams_through: NDArray[np.int64]
    """Different returns whose beams clearly passed through it."""

    def share(self, row: int) -> float:
        """Share of what was seen of it that is at its place."""
        return float(self.at[row] / max(self.at[row] + self.beyond[row], 1e-12))


def own_evidence(
    seen: Sightings, samples: SurfaceSamples, stations: NDArray[np.float64], surfaces: ElementSurfaces,
    doubt: NDArray[np.bool_], window: float, registration_sigma: float, elements: int,
) -> OwnEvidence:
    """Weigh the sightings ``seen`` of the samples at their planned places.

    stations (S, 3) positions [m, local frame]; doubt (N,) whether a sample is another element's surface as well; ``window`` [m]
    within which a return is at its place.
    """
    state = seen.state(window)
    at, beyond = (seen.on_face & (state == what) for what in (AT, BEYOND))
    sample = seen.sample.astype(np.int64)
    element = samples.element[sample].astype(np.int64)
    area = shared_area(seen, samples.area[sample], at | beyond)
    unsure = at & doubt[sample]
    sums = [np.bincount(element[of], weights=area[of], minlength=elements) for of in (at & ~unsure, unsure, beyond)]
    key = seen.ray_key(slice(None))
    own = _count_beams(element, key, at & ~unsure, elements)
    through = beyond.copy()
    row = np.flatnonzero(beyond)
    through[row] = clearly_inside(seen.rows(row), samples, stations, surfaces, registration_sigma)
    through &= ~_same_beam(element, key, at)
    return OwnEvidence(sums[0], sums[1], sums[2], own, _count_beams(element, key, through, elements))


def _same_beam(element: NDArray[np.int64], key: NDArray[np.uint64], at: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(M,) whether the same beam returned from another position of the same element."""
    pair = np.stack([element.astype(np.uint64), key], axis=1)
    kind = np.dtype([("element", np.uint64), ("key", np.uint64)])
    flat = np.ascontiguousarray(pair).view(kind).ravel()
    return np.asarray(np.isin(flat, flat[at]))


def _count_beams(
    element: NDArray[np.int64], key: NDArray[np.uint64], chosen: NDArray[np.bool_], elements: int
) -> NDArray[np.int64]:
    """(E,) different beams among the ``chosen`` rows."""
    pair = np.unique(np.stack([element[chosen].astype(np.uint64), key[chosen]], axis=1), axis=0)
    return np.bincount(pair[:, 0].astype(np.int64), minlength=elements)


def clearly_inside(
    seen: Sightings, samples: SurfaceSamples, stations: NDArray[np.float64], surfaces: ElementSurfaces,
    registration_sigma: float,
) -> NDArray[np.bool_]:
    """(M,) whether each beam's middle crosses its element's face well inside the outline, registration counted."""
    sample = seen.sample.astype(np.int64)
    normal, position = samples.normal[sample], samples.position[sample]
    place = crossings(seen, stations, position, normal)
    beam = BEAM_EXIT_RADIUS_M + BEAM_SPREAD_RAD * seen.distance.astype(np.float64)
    margin = WELL_INSIDE * beam + 2.0 * registration_sigma
    up = np.where((np.abs(normal[:, 2]) < 0.9)[:, None], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
    u = np.cross(normal, up)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(normal, u)
    inside = np.ones(len(seen), np.bool_)
    for step in (u, -u, v, -v):
        face = surfaces.face_at(
            place + margin[:, None] * step, normal, samples.element[sample].astype(np.int32),
            samples.triangle[sample].astype(np.int32), ON_FACE_M,
        )
        inside &= face >= 0
    return inside


def shows_gone(at: int, through: int, present: float) -> bool:
    """Whether so many beams through it would be unlikely if at least the share ``present`` of it stood."""
    return bool(binom.cdf(at, at + through, present) < ERROR_RATE)


def shows_standing(at: int, through: int, absent: float, tried: float = 1.0) -> bool:
    """Whether so many returns from it would be unlikely if no more than the share ``absent`` of it stood.

    ``tried`` places were looked at, of which any could have fitted by chance.
    """
    return bool(binom.sf(at - 1, at + through, absent) * tried < ERROR_RATE)
