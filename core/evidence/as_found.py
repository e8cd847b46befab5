"""Where the neighbours of an element were found, and which of its returns they explain there.

A floor that lies 10 mm low carries its covering as low: what returns from the covering lies near the floor's planned face, but
12 mm before the floor. And of a wall that nobody saw but where a removed board may have uncovered it, nobody knows where it
stands.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..model.raycast import RayScene
from ..model.samples import SurfaceSamples
from ..sensing.loa import level_sigma
from .decide import Context, assess_place, enough_seen
from .scenery import Scenery
from .sightings import Sightings, hits_around
from .verify import Findings

KNOWN_COSINE = 0.9
"""A place is known along a direction of which this part lies in what the scan determines."""


@dataclass(frozen=True)
class AsFound:
    """Where elements stand that were found at their planned place, more or less; all others count as planned. Metres."""

    shift: NDArray[np.float64]
    """(E, 3) against the plan, from what their neighbours leave open by plan."""
    known: NDArray[np.float64]
    """(E, 3, 3) projection onto the directions in which that is known."""
    placed: float
    """See ``placed``."""

    @classmethod
    def of(cls, found: Findings, by_plan: SurfaceSamples, context: Context) -> AsFound:
        """From what was ``found``; ``by_plan`` are the samples with those exposed that are so by plan."""
        count, t = len(found.plans), context.thresholds
        shift, known = np.zeros((count, 3)), np.tile(np.eye(3), (count, 1, 1))
        first = np.searchsorted(found.seen.sample, by_plan.first_of(count))
        for e, plan in enumerate(found.plans):
            if found.best[e] is not plan and np.linalg.norm(found.best[e].fit.vector) > context.window:
                continue
            part = found.seen.rows(slice(first[e], first[e + 1]))
            part = part.rows(by_plan.exposed[part.sample])
            place = assess_place(plan.shift, part, by_plan.area[part.sample], plan.exposed, context)
            if not enough_seen(place, (place.at + place.beyond) / max(plan.exposed, 1e-12), t):
                known[e] = 0.0
            elif place.share >= t.present_share:
                shift[e] = place.fit.vector
                known[e] = place.fit.determined.T @ place.fit.determined
        return cls(shift, known, placed(context))

    def is_known(self, element: NDArray[np.integer], normal: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(N,) whether the place of each element (N,) is known along ``normal`` (N, 3)."""
        along = np.einsum("ni,nij,nj->n", normal, self.known[element], normal)
        return np.asarray(along >= KNOWN_COSINE**2)

    def scene(self, scenery: Scenery, found: Findings, window: float) -> RayScene:
        """Everything where it was found, also farther than the ``window`` [m] from its plan."""
        shift = self.shift.copy()
        for e, (plan, best) in enumerate(zip(found.plans, found.best, strict=True)):
            if best is not plan and np.linalg.norm(best.fit.vector) > window:
                shift[e] = best.fit.vector
        return RayScene(scenery.model, shift) if shift.any() else scenery.scene


def placed(context: Context) -> float:
    """Metres that the accuracy of the model, of a return and of the registration may put a surface off its place (95 %)."""
    return 2.0 * math.hypot(level_sigma(context.loa), context.sigma, context.registration_sigma)


def explained_anew(
    scenery: Scenery, found: Findings, as_found: AsFound, scene: RayScene, context: Context
) -> tuple[Findings, NDArray[np.int64]]:
    """The same, without returns that others explain where they are planned but not where they were found; and the rows of
    returns that others may have sent back whose place is not known, or that lie off them all the same.

    ``scene``: everything where it was found. Such returns are no longer explained; they may be either's.
    """
    samples, seen = found.samples, found.seen
    element = samples.element[seen.sample].astype(np.int64)
    row = np.flatnonzero(
        seen.on_face & seen.explained & (seen.station >= 0) & (np.abs(seen.deviation) <= context.window)
    )
    origins, within = scenery.origins(seen.rows(row)), scenery.explain_within
    own = element[row]
    off, reach = np.abs(seen.deviation[row]), as_found.placed
    stays, moved, unknown = (np.zeros(len(row), np.bool_) for _ in range(3))
    nearest, whose = np.full(len(row), np.inf), np.zeros(len(row), np.int64)
    for away, triangle in hits_around(scenery.scene, origins, seen.point[row].astype(np.float64), within):
        other = scenery.scene.element[triangle].astype(np.int64)
        met = (away <= within) & (away + context.sigma < off)
        normal = scenery.scene.normal[triangle]
        here, know = other == own, as_found.is_known(other, normal)
        elsewhere = np.abs(np.einsum("ij,ij->i", as_found.shift[other], normal)) > context.sigma
        stays |= met & (here | (know & ~elsewhere))
        closer = met & ~here & know & ~elsewhere & (away < nearest)
        nearest[closer], whose[closer] = away[closer], other[closer]
        moved |= met & ~here & know & elsewhere
        unknown |= met & ~here & ~know
    again = np.flatnonzero(~stays)  # of two faces that lie in each other a ray through the plan meets one
    for away, triangle in hits_around(scene, origins[again], seen.point[row[again]].astype(np.float64), within):
        other = scene.element[triangle].astype(np.int64)
        met = (away <= within) & (away + context.sigma < off[again])
        met &= (other != own[again]) & as_found.is_known(other, scene.normal[triangle])
        stays[again] |= met
        closer = met & (away < nearest[again])
        nearest[again[closer]], whose[again[closer]] = away[closer], other[closer]
    between = np.isfinite(nearest) & (off <= reach)
    _, pair = np.unique(np.column_stack([own, whose]), axis=0, return_inverse=True)
    pair = pair.ravel()
    beside = medians(pair[between], nearest[between], int(pair.max(initial=-1)) + 1) > context.sigma
    either = (unknown & ~stays & (off <= reach)) | (between & beside[pair])
    freed = either | (moved & ~stays & ~unknown)
    changed = row[freed]
    if not len(changed):
        return found, changed
    explained = seen.explained.copy()
    explained[changed] = False
    seen = Sightings(**{**vars(seen), "explained": explained})
    return reassessed(replace(found, seen=seen), np.unique(element[changed]), context), row[either]


def reassessed(found: Findings, elements: NDArray[np.integer], context: Context) -> Findings:
    """The same, with these ``elements`` looked at anew at their planned places."""
    samples, seen, count = found.samples, found.seen, len(found.plans)
    first = np.searchsorted(seen.sample, samples.first_of(count))
    plans, best = list(found.plans), list(found.best)
    for e in elements.tolist():
        part = seen.rows(slice(first[e], first[e + 1]))
        plans[e] = assess_place(plans[e].shift, part, samples.area[part.sample], plans[e].exposed, context)
        if found.best[e] is found.plans[e]:
            best[e] = plans[e]
    return replace(found, plans=plans, best=best)


def medians(group: NDArray[np.int64], value: NDArray[np.float64], groups: int) -> NDArray[np.float64]:
    """(G,) median of the values (N,) of each group (N,); zero where there is none."""
    out = np.zeros(groups)
    order = np.lexsort((value, group))
    edge = np.searchsorted(group[order], np.arange(groups + 1))
    some = np.flatnonzero(np.diff(edge) > 0)
    out[some] = value[order][(edge[some] + edge[some + 1] - 1) // 2]
    return out
